"""A used helicopter goes to another process, and comes back as the same one."""

import copy
import multiprocessing
import pickle
from operator import methodcaller

import numpy as np
import pytest

import symheli


@pytest.fixture
def used():
    heli = symheli.Helicopter.load("xcell60", governor="ideal").with_parameters({"body.mass": 9.0})
    symheli.trim(heli, 5.0)
    heli.jacobian, heli.diagnostics, heli.numeric("rhs")
    return heli


def pickled(heli):
    return pickle.loads(pickle.dumps(heli))


@pytest.mark.slow(but="deepcopy")
@pytest.mark.parametrize("travel", [copy.deepcopy, copy.copy, pickled])
def test_a_used_helicopter_is_copied_and_flies_as_before(used, travel):
    other = travel(used)
    assert other == used
    point = symheli.trim(used, 5.0)
    np.testing.assert_array_equal(
        other.numeric("rhs")(point.x.array, point.u.array, 0.0)[0],
        used.numeric("rhs")(point.x, point.u, 0.0)[0],
    )
    stitched = symheli.flight.StitchedModel.from_family(symheli.sweep(other, [0.0, 5.0]))
    assert len(pickle.loads(pickle.dumps(stitched)).states) == len(other.states)


def test_a_used_helicopter_is_flown_in_another_process(used):
    point = symheli.trim(used, 5.0)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        (there,) = pool.map(methodcaller("switches", point.x.array, point.u.array), [used])
    assert there == used.switches(point.x.array, point.u.array)


def test_a_named_vector_is_its_numbers_for_numpy(used):
    point = symheli.trim(used, 5.0)
    np.testing.assert_array_equal(np.asarray(point.u), [point.u[name] for name in point.u])
    assert np.asarray(point.x, dtype=np.float32).dtype == np.float32
    np.testing.assert_array_equal(2 * np.array(point.x), 2 * point.x.array)
    copied = np.array(point.x)
    copied[0] = 1.0  # a copy, not the frozen vector
    assert point.x.array[0] != 1.0
