"""Worst-case gains proven in cells: against responses solved for at every frequency, and forged."""

import copy
import json

import numpy as np
import pytest

from symheli import LFT, LinearModel, Scheduling
from symheli.errors import InputError
from symheli.lpv import connect
from synthesis.certify.statement.statement_file import read
from synthesis.robust import worst_case_gain

B = np.array([[0.9, 0.7, -0.3]])
C = np.array([[0.2], [0.5], [0.7]])
D = np.array([[0.5, -0.4, 0.4], [-0.4, 0.0, -0.4], [0.2, 0.4, 0.2]])
OMEGA = np.append(np.geomspace(1e-2, 1e3, 100), 0.0)


def loop():
    """x' = -2 x + B (p, w), (q, z) = C x + D (p, w), p = diag(d1, d2) q, |d| <= 1: scalings alone
    leave ten percent.
    """
    model = LinearModel([[-2.0]], B, C, D, ["x"], ["p1", "p2", "w"], ["q1", "q2", "z"])
    deltas = [LFT.parameter(Scheduling(f"d{k}", "1", -1.0, 1.0), f"q{k}", f"p{k}") for k in (1, 2)]
    return connect(model, *deltas, inputs=["w"], outputs=["z"])


def frozen_gain(delta, omega):
    """The largest |z/w| at these frequencies, from the equations of the loop."""
    worst = 0.0
    for s in 1j * np.asarray(omega):
        M = C @ B / (s + 2) + D
        p = np.linalg.solve(np.eye(2) - np.diag(delta) @ M[:2, :2], np.diag(delta) @ M[:2, 2])
        worst = max(worst, abs(M[2, 2] + M[2, :2] @ p))
    return worst


@pytest.fixture(scope="module")
def divided():
    return worst_case_gain(loop(), cells=16)


def test_more_cells_close_the_gap_that_scalings_leave(divided):
    """The bound is within the .1 % at which cells are divided, of a gain that a member attains."""
    whole = worst_case_gain(loop())
    assert whole.upper > 1.05 * whole.lower  # the gap
    assert divided.lower == pytest.approx(whole.lower, rel=1e-6)
    assert divided.upper < whole.lower * (1 + 2e-3)
    assert len(divided.proof.cells) > 1


def test_no_member_exceeds_the_bound_and_the_worst_attains_the_lower_one(divided):
    rng = np.random.default_rng(0)
    draws = [*rng.uniform(-1, 1, (40, 2)), *np.array([(a, b) for a in (-1, 1) for b in (-1, 1)])]
    assert max(frozen_gain(d, OMEGA) for d in draws) <= divided.upper
    # rounding of the parameters and of one response
    assert frozen_gain(divided.p, [divided.omega]) == pytest.approx(divided.lower, rel=1e-7)


def test_the_second_writing_agrees(divided):
    assert divided.verify(rigorous=True)


def test_a_file_of_cells_is_proven_again_and_forged_ones_are_not(divided, tmp_path):
    path = divided.save(tmp_path / "gain.json")
    assert read(path).verified
    whole = json.loads(path.read_text())

    def forged(change):
        content = copy.deepcopy(whole)
        change(content)
        path.write_text(json.dumps(content))
        return read(path).verified

    def shrink(content):
        content["cells"][0]["high"][0] -= 0.25

    def overlap(content):
        content["cells"].append(content["cells"][0])

    def lower(content):
        content["bound"] *= 0.999

    changes = (lambda c: c["cells"].pop(), shrink, overlap, lower)
    assert not any(map(forged, (*changes, lambda c: c["cells"].clear())))
    moved = copy.deepcopy(divided.proof.cells)
    assert not divided.proof._replace(cells=(moved[0], *moved[2:])).covers


def test_a_number_of_cells_below_one_is_refused():
    with pytest.raises(InputError, match="cells"):
        worst_case_gain(loop(), cells=0)
