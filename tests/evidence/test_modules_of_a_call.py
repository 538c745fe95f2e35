"""The command that counts modules enters those that a certificate rests on, and no design."""

from evidence.modules_of_a_call import entered


def test_a_certificate_passes_through_both_proofs_and_no_design():
    names = entered(search=None)
    assert {"synthesis.proof.inequalities", "synthesis.proof.pointwise"} <= set(names)
    assert not any(n.startswith("synthesis.design.") for n in names if "riccati" not in n)
