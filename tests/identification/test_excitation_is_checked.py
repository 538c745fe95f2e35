"""What the data cannot determine is refused, in words."""

import re

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from symheli.errors import ExcitationError, InputError, UnknownNameError

P_OF_THE_PAPER = 6.5 * (1 + np.sin(np.pi * np.arange(400) / 3))


@pytest.mark.parametrize("method", ["ls", "rls", idn.methods.InstrumentalVariables("u")])
def test_three_scheduling_values_never_determine_a_cubic(method):
    arx = structure(basis=idn.Polynomial(3, 0.0, 13.0))
    record = Truth(arx).record(P_OF_THE_PAPER)
    with pytest.raises(
        ExcitationError, match=r"p takes 3 distinct values and .* needs 4.*degree 2 at most"
    ) as caught:
        idn.fit(arx, record, method=method)
    assert caught.value.report.distinct == 3
    assert caught.value.report.needed == 4


def test_an_input_that_never_moves_is_named():
    arx = structure(outputs=("y",), inputs=("lat", "col"), na=1, nb=1)
    record = Truth(arx).record(moving(200))
    still = record.with_signals({"col": "1"}, col=np.zeros(200))
    with pytest.raises(ExcitationError, match=r"rank 6 of 9.*col\(k-1\)"):
        idn.fit(arx, still)


def test_two_inputs_that_move_together_are_named():
    arx = structure(inputs=("lat", "col"), na=1, nb=1)
    record = Truth(arx).record(moving(200))
    together = record.with_signals({"col": "1"}, col=0.7 * record["lat"])
    report = idn.excitation_report(arx, together)
    assert report.rank == 6
    assert [(row.value, row.threshold) for row in report.criteria if row.verdict == "not fit"] == [
        (6, 9)
    ]
    assert "lat(k-1)" in report.worst_direction
    assert "col(k-1)" in report.worst_direction


def test_too_few_samples_are_refused_with_the_numbers():
    arx = structure()
    with pytest.raises(ExcitationError, match="8 usable samples cannot determine 12 coefficients"):
        idn.fit(arx, Truth(arx).record(moving(10)))


def test_report_of_a_good_record_says_so():
    arx = structure()
    report = idn.excitation_report(arx, Truth(arx).record(moving(400)))
    assert report.sufficient
    assert report.rank == len(report.names) == 12
    assert report.singular_values[0] / report.singular_values[-1] == pytest.approx(report.condition)
    # columns of length 1: the squares of the singular values add up to their number
    assert np.sum(report.singular_values**2) == pytest.approx(12)
    assert report.occupancy.sum() == report.samples == 398
    assert {row.verdict for row in report.criteria} == {"fit"}
    text = str(report)
    assert re.search(r"excitation: sufficient\n.*\n  samples +398 +at least 12 +met\n", text)
    assert "worst determined" in text


def test_wrong_requests_get_the_promised_sentence():
    arx = structure()
    record = Truth(arx).record(moving(100))
    with pytest.raises(UnknownNameError, match=r"did you mean 'rls' or 'ls'"):
        idn.fit(arx, record, method="rsl")
    with pytest.raises(UnknownNameError, match="unknown signal 'yy'"):
        idn.fit(structure(outputs=("yy",)), record)
    with pytest.raises(InputError, match="basis is declared on"):
        idn.fit(structure(basis=idn.Polynomial(2, 0.0, 5.0)), record)
    with pytest.raises(InputError, match="needs its instruments"):
        idn.fit(arx, record, method="iv")
    with pytest.raises(TypeError, match="forgetting"):
        idn.fit(arx, record, method="ls", forgetting=0.9)
    with pytest.raises(InputError, match="or a method with its options"):
        idn.fit(arx, record, method=idn.methods.Ridge)
    with pytest.raises(InputError, match="expected a factor in"):
        idn.methods.Recursion(1.1)
    with pytest.raises(InputError, match="expected a FlightRecord"):
        idn.fit(arx, [])
    with pytest.raises(InputError, match="either an output or an input"):
        structure(outputs=("y",), inputs=("y",))
    with pytest.raises(InputError, match="na: expected an integer"):
        structure(na=-1)
    with pytest.raises(InputError, match="scheduling_at"):
        structure(scheduling_at="soon")
    with pytest.raises(InputError, match="nothing to identify"):
        structure(na=0, nb=0)
