"""Worst-case gains proven in cells: against responses solved for at every frequency, and forged."""

import copy
import json

import numpy as np
import published_h3 as h3
import pytest

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv import connect
from synthesis.certify.statement.statement_file import read
from synthesis.robust import worst_case_gain

STATIC = LinearModel.gain([[0.55], [-11.0]], ["y"], ["u1", "u2"])
OMEGA = np.linspace(0, np.pi, 200)


def loop():
    return connect(h3.plant(), STATIC, inputs=["w1", "w2"], outputs=["z1", "z2"])


@pytest.fixture(scope="module")
def divided():
    return worst_case_gain(loop(), cells=16)


def test_more_cells_close_the_gap_that_scalings_leave(divided):
    """The bound is within the .1 % at which cells are divided, of a gain that a member attains."""
    whole = worst_case_gain(loop())
    assert whole.upper > 1.005 * whole.lower  # the gap
    assert divided.lower == pytest.approx(whole.lower, rel=1e-6)
    assert divided.upper < whole.lower * (1 + 2e-3)
    assert len(divided.proof.cells) > 1
    assert divided.verify()


def test_no_member_exceeds_the_bound_and_the_worst_attains_the_lower_one(divided):
    rng = np.random.default_rng(0)
    draws = [rng.uniform(*np.array(h3.RANGES).T) for _ in range(10)]
    corners = [(a, b) for a in h3.RANGES[0] for b in h3.RANGES[1]]
    assert max(h3.frozen_gain(STATIC, d, OMEGA) for d in [*draws, *corners]) <= divided.upper
    at = np.append(np.linspace(0, np.pi, 50), divided.omega)
    # the parameters are returned in doubles, from normalised ones
    assert h3.frozen_gain(STATIC, divided.p, at) == pytest.approx(divided.lower, rel=1e-7)


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
