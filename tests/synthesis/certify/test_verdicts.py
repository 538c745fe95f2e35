"""Whichever analysis made it, a certificate answers the same questions, and contradicts itself
nowhere.
"""

import math
from dataclasses import replace

import pytest
from models import lag

from symheli.errors import CertificateError
from synthesis import Certificate, decay_rate, l2_gain, lft_gain, stability
from synthesis.analysis import energy_to_peak, lft_stability
from synthesis.forms import Spline
from synthesis.impose import SumOfSquares

ANALYSES = {
    "splines": lambda: l2_gain(lag(), form=Spline(segments=2), search=None),
    "box": lambda: l2_gain(lag(), form=Spline(degree=1), impose=SumOfSquares(), search=None),
    "energy to peak": lambda: energy_to_peak(lag(), form=Spline(degree=1, segments=1), search=None),
    "decay rate": lambda: decay_rate(lag(), form=Spline(degree=1, segments=1), search=None),
    "lft": lambda: lft_gain(lag().to_lft().reduce(), search=None),
    "stability, splines": lambda: stability(lag(), form=Spline(segments=2), search=None),
    "stability, box": lambda: stability(
        lag(), form=Spline(degree=1), impose=SumOfSquares(), search=None
    ),
    "stability, lft": lambda: lft_stability(lag().to_lft().reduce(), search=None),
}


@pytest.mark.slow(only=("splines", "box"))
@pytest.mark.parametrize("analysis", ANALYSES)
def test_every_certificate_answers_the_same_questions(analysis):
    cert = ANALYSES[analysis]()
    assert isinstance(cert, Certificate)
    assert cert.verified
    assert cert.verify()
    assert cert.verify(rigorous=True)
    # dx/dt = -(1 + p) x + u, p in [0, 1]: gain 1, peak 1/sqrt 2, decay rate 1
    exact = {"l2 gain": 1.0, "energy-to-peak gain": math.sqrt(0.5), "decay rate": 1.0}.get(
        cert.kind
    )
    if exact is None:
        assert all(map(math.isnan, (cert.bound, cert.limit, cert.frozen, cert.gap)))
    else:
        # 3e-3: the decay rate is found by bisection to 2e-3, gains are loosened by 1e-6 or so
        assert (cert.bound, cert.limit, cert.frozen) == pytest.approx([exact] * 3, rel=3e-3)
        assert 1.0 <= cert.gap < 1.003
    faster = math.inf if "lft" in analysis else 1.0
    assert cert.rates == (faster,)
    assert cert.rate == faster
    # one state: P is a number, and its condition number one at every p
    assert cert.conditioning == pytest.approx(1.0)
    assert cert.attempts
    assert sum(cert.seconds) > 0
    text = cert.details
    for part in (
        cert.kind,
        cert.status.value,
        cert.solver,
        "condition number 1",
        "tried: ",
        "exogenous",
        "CLARABEL",
        "tolerance",
    ):
        assert part in text
    assert all(f"  - {sentence}" in text for sentence in cert.hypotheses)


@pytest.mark.slow(only="splines")
@pytest.mark.parametrize("analysis", [name for name in ANALYSES if "stability" not in name])
def test_no_certificate_can_be_made_out_of_order(analysis):
    cert = ANALYSES[analysis]()
    proven, limit, worse = (
        ("alpha", "upper", 0.9) if cert.kind == "decay rate" else ("gamma", "lower", 1.1)
    )
    # beyond what a frozen model or a trajectory shows, and a trajectory better than the frozen
    # model it began with
    for change, said in (
        ({"frozen": worse * cert.bound}, "the frozen"),
        ({limit: worse * cert.bound}, "bound"),
        ({proven: cert.bound / worse}, "contradicts the certified"),
        ({limit: cert.limit / worse}, "is inconsistent with the frozen"),
    ):
        with pytest.raises(CertificateError, match=said):
            replace(cert, **change)
