"""A gain over several parameters stops after its effort, with what is proven and what was left."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import l2_gain
from synthesis.certify.statement.outcome import Status
from synthesis.numerics.program.effort import Effort, work
from synthesis.numerics.program.lyapunov_program import LyapunovProgram, Sizes


def spring(rate=0.1):
    """x'' + (.3 + .1 b) x' + (1 + .5 a) x = u: a slow P(a, b) proves less than a constant P."""
    a, b = (Scheduling(name, "1", -1.0, 1.0, rate=rate) for name in "ab")
    A = {(0, 0): [[0.0, 1.0], [-1.0, -0.3]], (1, 0): [[0.0, 0.0], [-0.5, 0.0]]}
    A[0, 1] = [[0.0, 0.0], [0.0, -0.1]]
    return LPVStateSpace.polynomial(
        A, {(0, 0): [[0.0], [1.0]]}, {(0, 0): [[1.0, 0.0]]}, {(0, 0): [[0.0]]}, [a, b]
    )


@pytest.fixture(scope="module")
def short():
    return l2_gain(spring(), search=None, effort=1e-6)


def test_a_gain_returns_what_is_proven_and_names_what_was_left(short):
    left = [each for each in short.attempts if each.left]
    assert short.status is Status.PROVEN
    assert short.verify(rigorous=True)
    assert left
    assert str(left[-1].answer) in str(short)


def test_the_effort_that_is_named_tries_what_was_left(short):
    left = next(each for each in short.attempts if each.left)
    named = float(re.search(r"effort=([\d.e-]+) ", left.answer)[1])
    longer = l2_gain(spring(), search=None, effort=named)
    tried = [each for each in longer.attempts if each.program == left.program]
    assert any(not each.left for each in tried)
    assert longer.gamma <= short.gamma


@pytest.mark.slow
def test_nothing_is_left_of_an_effort_without_limit():
    every = l2_gain(spring(), search=None, effort=np.inf)
    usual = l2_gain(spring(), search=None)
    assert not any(each.left for each in every.attempts)
    assert_allclose(usual.gamma, every.gamma, rtol=1e-12)


def test_programs_are_taken_on_until_something_is_proven():
    effort = Effort(limit=1.0)
    assert not effort.refused(50.0)
    effort.proven = True
    assert effort.refused(0.1)
    assert effort.spent == 50.0


def test_a_bound_that_is_not_enough_does_not_end_the_work():
    usual = l2_gain(spring(), search=None)
    short = l2_gain(spring(), search=None, effort=Effort(1e-6, enough=np.inf))
    asked = l2_gain(spring(), search=None, effort=Effort(1e-6, enough=1.01 * usual.gamma))
    assert any(each.left for each in short.attempts)
    assert asked.gamma <= 1.01 * usual.gamma < short.gamma


def test_an_effort_that_is_given_twice_begins_anew():
    given = Effort(1.0)
    first = Effort.of(given)
    first.proven, first.spent = True, 5.0
    assert Effort.of(given) == given == Effort(1.0)


def test_work_grows_with_the_unknowns():
    few, many = (LyapunovProgram((), Sizes(4, 1, k), 1e-6, None) for k in (3, 30))
    assert work(many) > 100 * work(few)


@pytest.mark.parametrize("effort", [0.0, -1.0, np.nan, "much"])
def test_an_effort_is_a_time(effort):
    with pytest.raises(InputError, match="effort: expected a number"):
        l2_gain(spring(), effort=effort)
