"""Orders and delays by signal, groups of equations, several scheduling parameters: what a structure
says about itself.
"""

import numpy as np
import pytest
from known_systems import structure

import identification as idn
from symheli import lpv
from symheli.errors import InputError, UnknownNameError

TWO = dict(outputs=("a", "b"), inputs=("u", "v"))
BOX = lpv.Product((idn.Polynomial(1, 0.0, 13.0), idn.Polynomial(2, 0.9, 1.3)))


def test_the_same_orders_written_three_ways_are_the_same_structure():
    by_output = structure(**TWO, na={"a": 2, "b": 2}, nb={"u": 1, "v": 3}, delay={"u": 0, "v": 1})
    nested = structure(
        **TWO,
        na=2,
        nb={"a": {"u": 1, "v": 3}, "b": {"u": 1, "v": 3}},
        delay={"a": {"u": 0, "v": 1}, "b": {"u": 0, "v": 1}},
    )
    rows = structure(**TWO, na=((2, 2), (2, 2)), nb=((1, 3), (1, 3)), delay=((0, 1), (0, 1)))
    assert by_output == nested == rows
    assert by_output.na == 2
    assert by_output.input_lag_ranges == ((range(0, 1), range(1, 4)),) * 2


def test_outputs_with_the_same_regressors_form_one_group():
    arx = structure(outputs=("a", "b", "c"), inputs=("u",), na={"a": 2, "b": 1, "c": 2}, nb=1)
    assert [g.outputs for g in arx.groups] == [(0, 2), (1,)]
    names = [
        [arx.regressor_names[i].split(" ")[0] for i in arx.regressors(g)[:: arx.basis.size]]
        for g in arx.groups
    ]
    assert names == [
        ["a(k-1)", "b(k-1)", "c(k-1)", "a(k-2)", "b(k-2)", "c(k-2)", "u(k-1)"],
        ["a(k-1)", "b(k-1)", "c(k-1)", "u(k-1)"],
    ]
    assert len(structure(**TWO).groups) == 1


def test_free_coefficients_are_those_of_the_groups():
    arx = structure(
        **TWO, na={"a": {"a": 2, "b": 0}, "b": {"a": 1, "b": 3}}, nb={"a": 0, "b": 2}, delay=0
    )
    # the equation of a has 2 lags of a; that of b has 1 of a, 3 of b and 2 of each input; 3
    # functions each
    assert arx.free.sum(axis=0).tolist() == [3 * 2, 3 * (1 + 3 + 4)]
    assert arx.memory == 3


@pytest.mark.parametrize(
    ("over", "message"),
    [
        (dict(na={"a": 1, "b": 2, "z": 1}), "unknown signal in na 'z'"),
        (dict(na={"a": 1}), "give a number for b too"),
        (dict(nb={"a": {"u": 1}, "b": 1}), "nb of a: give a number for v too"),
        (dict(nb=[[1, 2]]), "one row an output with 2 numbers"),
        (dict(delay={"u": 1, "v": -1}), "delay: expected an integer from 0"),
        (dict(na={"a": 0, "b": 1}, nb={"a": 0, "b": 1}), "nothing to identify for a"),
        (dict(scheduling=("p", "q")), r"names 2 parameters \(p, q\) and the basis has 1"),
        (dict(basis=BOX), "the basis has 2"),
        (dict(scheduling=("p", "p"), basis=BOX), "names must differ"),
    ],
)
def test_a_structure_that_cannot_be_is_refused_when_made(over, message):
    with pytest.raises(InputError, match=message):
        structure(**{**TWO, **over})


def test_a_misspelt_signal_gets_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'd_lon'"):
        structure(inputs=("d_lon", "d_col"), nb={"d_lno": 1, "d_col": 2})


def test_the_lti_baseline_is_one_line_and_keeps_everything_but_the_basis():
    arx = structure(**TWO, na={"a": 2, "b": 1}, offset=True)
    assert arx.lti().basis == idn.Polynomial(0, 0.0, 13.0)
    assert [t[:2] for t in arx.lti().terms] == [t[:2] for t in arx.terms]
    several = structure(scheduling=("p", "q"), basis=BOX).lti()
    assert several.basis.size == 1
    np.testing.assert_allclose(several.basis([[3.0, 1.0]]), 1.0)


def test_names_of_regressors_with_several_parameters():
    arx = structure(scheduling=("p", "q"), basis=BOX, na=1, nb=1, offset_rate=True)
    assert arx.regressor_names[0] == "y(k-1) f0(p(k-1), q(k-1))"
    assert arx.regressor_names[-1] == "change of q f5(p(k-1), q(k-1))"
