"""Campaigns of flights flown elsewhere: the same bits, whatever flies them."""

import pickle
from concurrent.futures import Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
from flight.flown import SHORT, STIRRED

import symheli
from symheli.flight.batch import CHUNK

COUNT = 2 * CHUNK + 5


class Copying(Executor):
    """What it runs and what it returns went through bytes, as between machines."""

    def __init__(self):
        self.calls = 0

    def submit(self, fn, /, *args, **kwargs):
        self.calls += 1
        future = Future()
        call, args, kwargs = pickle.loads(pickle.dumps((fn, args, kwargs)))
        try:
            future.set_result(pickle.loads(pickle.dumps(call(*args, **kwargs))))
        except Exception as error:
            future.set_exception(error)
        return future


@pytest.fixture(scope="module")
def campaign(ideal):
    pilot = symheli.flight.gain_scheduled_lqr(ideal, 0.0, 13.0, 0.02)

    def fly(path, **changes):
        options = {"seeds": range(COUNT), "signals": ["q", "phi"], "controller": pilot} | changes
        return symheli.flight.fly_campaign(ideal, SHORT, path, excitation=STIRRED, **options)

    return fly


@pytest.mark.slow
def test_a_flight_has_the_same_bits_wherever_its_chunk_was_flown(campaign, tmp_path):
    here = campaign(tmp_path / "here.zarr")
    copying, seen = Copying(), []
    there = campaign(
        tmp_path / "there.zarr", workers=copying, progress=lambda done, count: seen.append(done)
    )
    assert copying.calls == 3
    assert seen == sorted(seen)
    assert (seen[0], seen[-1], len(seen)) == (0, COUNT, 4)
    for name in ("q", "phi"):
        np.testing.assert_array_equal(there[name], here[name])
    np.testing.assert_array_equal(there.duration, here.duration)
    np.testing.assert_array_equal(there.lost, here.lost)


@pytest.mark.slow
def test_what_is_there_is_not_handed_out_again(campaign, tmp_path):
    path, first = tmp_path / "flights.zarr", Copying()
    whole = campaign(path, workers=first)["q"]
    (path / "duration" / "1").unlink()
    second = Copying()
    np.testing.assert_array_equal(campaign(path, workers=second)["q"], whole)
    assert second.calls == 1


def test_what_a_chunk_raises_comes_through(campaign, tmp_path):
    class Broken(ThreadPoolExecutor):
        def submit(self, fn, /, *args, **kwargs):
            return super().submit(int, "x")

    with Broken(1) as broken, pytest.raises(ValueError, match="invalid literal"):
        campaign(tmp_path / "flights.zarr", workers=broken)
