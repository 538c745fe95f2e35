"""A solver that says "optimal" to a wrong point: no question believes it, and none ends in a bare
error of arithmetic.
"""

import casadi
import numpy as np
import pytest
from test_proven_statements import QUICK, SLOW, TRIPLED, lag, pushed, with_feedthrough

from symheli.errors import SymheliError
from synthesis import decay_rate, h2_gain, l2_gain, lft_gain, stability
from synthesis.analysis import energy_to_peak, passivity_index
from synthesis.impose import SumOfSquares
from synthesis.numerics.program import cone_program
from synthesis.numerics.program.answer import Answer
from synthesis.sets import invariant_set
from synthesis.switching import dwell_time
from synthesis.tubes import Motions, tube

pytestmark = pytest.mark.guard

LIES = {
    "zero": lambda x, rng: 0 * x,
    "minus": lambda x, rng: -x,
    "garbage": lambda x, rng: rng.standard_normal(len(x)),
    "infinite": lambda x, rng: np.full(len(x), np.inf),
    "not a number": lambda x, rng: np.full(len(x), np.nan),
    "a little outside": lambda x, rng: x + 1e-3 * np.abs(x).max() * rng.standard_normal(len(x)),
    "halved": lambda x, rng: 0.5 * x,
}


def falls(gust=0.1):
    x, u, w, c = (casadi.SX.sym(n, k) for n, k in (("x", 1), ("u", 1), ("w", 1), ("c", 0)))
    model = casadi.Function("cubic", [x, u, w], [u - x**3 + w])
    rest = casadi.Function("rest", [c], [casadi.SX(0), casadi.SX(0)])
    return tube(model, Motions(rest, [[-1.0]]), gust=gust, sizes=[0.1])


QUESTIONS = {
    "l2 gain": lambda: l2_gain(lag(), **QUICK),
    "sampled l2 gain": lambda: l2_gain(lag(0.1), **QUICK),
    "stability": lambda: stability(lag(), **QUICK),
    "decay rate": lambda: decay_rate(lag(), **QUICK),
    "sums of squares": lambda: l2_gain(lag(), **QUICK, impose=SumOfSquares()),
    "energy-to-peak gain": lambda: energy_to_peak(lag(), **QUICK),
    "h2 gain": lambda: h2_gain(lag(), **QUICK),
    "passivity index": lambda: passivity_index(with_feedthrough(), **QUICK),
    "LFT gain": lambda: lft_gain(lag().to_lft(), "DG", search=None),
    "ellipsoid": lambda: invariant_set(pushed(), input_bounds={"u": 1.0}),
    "dwell time": lambda: dwell_time(SLOW, TRIPLED, within=1.2, parts=4),
    "tube": falls,
}
TRUTH = {
    "l2 gain": 1.0,
    "sums of squares": 1.0,
    "sampled l2 gain": 2.0,
    "decay rate": 1.0,
    "energy-to-peak gain": np.sqrt(0.5),
    "h2 gain": np.sqrt(0.5),
    "passivity index": 0.25,
    "LFT gain": 1.0,
    "dwell time": np.log(3.0),
}


@pytest.mark.parametrize("lie", LIES)
@pytest.mark.parametrize("question", QUESTIONS)
def test_nothing_false_is_proven(question, lie, monkeypatch):
    honest, rng = cone_program._interruptible, np.random.default_rng(0)

    def liar(method, program, solver):
        _, x, word, dual = honest(method, program, solver)
        x = np.zeros(len(program.c)) if x is None else np.asarray(x)
        return Answer.SOLVED, LIES[lie](x, rng), word, dual

    monkeypatch.setattr(cone_program, "_interruptible", liar)
    try:
        found = QUESTIONS[question]()
    except SymheliError:
        return
    if found.verified and question in TRUTH:
        # right in spite of the lie: it is near the truth, or looser
        sense = -1.0 if question in ("decay rate", "passivity index") else 1.0
        assert sense * (found.bound - TRUTH[question]) >= -1e-6 * TRUTH[question]
    assert found.verify() == found.verified
