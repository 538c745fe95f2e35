"""Long work tells how far it is, to whoever listens and to nobody else."""

import contextlib
import io
import sys
import time

import numpy as np
import pytest

import identification as idn
import symheli
import synthesis
from symheli import LPVStateSpace, Scheduling, progress
from symheli.progress import task, tracked


class Heard(list):
    """Every `Progress`, in order."""

    def titles(self):
        return list(dict.fromkeys(p.task for p in self))

    def of(self, title):
        return [p for p in self if p.task == title]


@pytest.fixture
def heard():
    said = Heard()
    with symheli.progress.watched(said.append):
        yield said


def spring():
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    A = [[[0.0, 1.0], [-1.0, -0.6]], [[0.0, 0.0], [-0.3, 0.0]]]
    return LPVStateSpace.polynomial(A, [[[0.0], [1.0]]], [[[1.0, 0.0]]], [[[0.0]]], p)


def well_formed(heard):
    """Every task begins at nothing, never goes back, ends once, and its parts lie within it."""
    open_ones = []
    for p in heard:
        assert p.depth <= len(open_ones)
        if p.depth == len(open_ones):
            assert p.done == 0
            assert not p.over
            open_ones.append(p)
            continue
        last = open_ones[p.depth]
        assert p.depth == len(open_ones) - 1, f"{p.task} goes on while a part of it is open"
        assert p.task == last.task
        assert p.done >= last.done
        assert p.total is None or p.done <= p.total
        if p.over:
            open_ones.pop()
        else:
            open_ones[p.depth] = p
    return not open_ones


def test_tasks_lie_within_each_other(heard):
    for _ in tracked("outer", range(2)):
        for _ in tracked("inner", iter("abc"), 3):
            pass
    assert well_formed(heard)
    assert [str(p) for p in heard.of("outer")] == [f"outer: {k} of 2" for k in (0, 1, 2, 2)]
    assert [p.depth for p in heard.of("inner")] == [1] * 10


def test_a_task_ends_when_it_fails_or_is_left(heard):
    def left():
        for k in tracked("left", range(5)):
            if k == 2:
                return

    def failing():
        with task("failing", 3) as own:
            own.step("a half")
            raise ValueError

    left()
    with pytest.raises(ValueError):  # noqa: PT011 - whichever
        failing()
    assert well_formed(heard)
    assert [(p.task, p.done) for p in heard if p.over] == [("left", 2), ("failing", 1)]


def test_nobody_is_told_after_the_block_nor_within_one_for_nobody():
    said = []
    with symheli.progress.watched(said.append), symheli.progress.watched(None):
        list(tracked("quiet", range(3)))
    list(tracked("late", range(3)))
    assert not said


def test_an_exception_of_the_listener_ends_the_work():
    def enough(progress):
        if progress.done == 2:
            raise KeyboardInterrupt

    with symheli.progress.watched(enough), pytest.raises(KeyboardInterrupt):
        list(tracked("work", range(5)))


def test_sweeps_and_trim_maps_count_their_points(heard, ideal):
    symheli.trim_map(ideal, [4.0, 8.0], [-2.0, 0.0])
    assert well_formed(heard)
    assert heard.of("trimming")[-1].done == 4


def test_flights_are_counted(heard, ideal, tmp_path):
    climb = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
    symheli.flight.fly_batch(ideal, climb, seeds=range(3))
    symheli.flight.fly_campaign(ideal, climb, tmp_path / "flights", seeds=range(2), signals=["q"])
    assert well_formed(heard)
    assert [p.done for p in heard.of("flying") if p.over] == [3, 2]


@pytest.mark.slow
def test_a_certificate_tells_of_its_search_its_attempts_and_its_verification(heard):
    cert = synthesis.l2_gain(spring())
    assert cert.verify(rigorous=True)
    assert well_formed(heard)
    assert {"searching along lines", "searching a proof", "verifying in rational arithmetic"} <= {
        *heard.titles()
    }
    attempts = [p for p in heard.of("searching a proof") if p.over]
    assert sum(p.done for p in attempts) == len(cert.attempts)
    exact = heard.of("verifying in rational arithmetic")[-1]
    assert exact.done == exact.total


@pytest.mark.slow
def test_a_design_tells_the_digits_of_its_gamma(heard):
    lag = LPVStateSpace.polynomial(
        A=[[[-1.0]], [[2.0]]],
        B=[[[1.0, 0.0, 1.0]]],
        C=[[[1.0], [0.0], [1.0]]],
        D=[[[0, 0, 0], [0, 0, 1.0], [0, 0.1, 0]]],
        scheduling=Scheduling("p", "1", 0.0, 1.0, rate=0.5),
    )
    plant = synthesis.Plant(
        lag,
        disturbances=lag.inputs[:2],
        performance=lag.outputs[:2],
        controls=lag.inputs[2:],
        measurements=lag.outputs[2:],
    )
    synthesis.output_feedback(plant)
    assert well_formed(heard)
    digits = [p for p in heard.of("digits of the least level") if p.over]
    assert digits
    # of tolerances of 1e-3 while points are added, 1e-5 at the end, 0.1 once gamma is settled
    assert {p.total for p in digits} == {1, 3, 5}
    assert max(p.done for p in digits) == 5


@pytest.mark.parametrize("method", ["rls", "lasso", "ridge"])
def test_estimators_tell_where_they_are(heard, method):
    rng = np.random.default_rng(0)
    p, u = np.sin(0.05 * np.arange(400)), rng.normal(size=400)
    y = np.zeros(400)
    for k in range(1, 400):
        y[k] = (0.4 + 0.2 * p[k]) * y[k - 1] + u[k - 1]
    record = symheli.FlightRecord.from_arrays(
        0.1 * np.arange(400), {"y": "1", "u": "1", "p": "1"}, y=y, u=u, p=p
    )
    arx = idn.LPVARX(
        outputs=("y",),
        inputs=("u",),
        scheduling="p",
        na=1,
        nb=1,
        delay=1,
        basis=idn.Polynomial(1, -1.0, 1.0),
    )
    idn.fit(arx, record, method=method)
    assert well_formed(heard)
    assert heard


class Screen(io.StringIO):
    """A terminal that keeps what is written."""

    def isatty(self):
        return True


def test_long_work_shows_a_line_on_a_terminal_unasked_and_takes_it_away(monkeypatch):
    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(progress._Line, "AFTER", 0.01)
    monkeypatch.setattr(progress._Line, "EVERY", 0.01)
    for _ in progress.tracked("flying", range(2)):
        seen = screen.getvalue()
        while screen.getvalue() == seen:  # ends, or the line never comes
            time.sleep(0.001)
    assert "symheli: flying: 1 of 2, 0 s" in screen.getvalue()
    last = screen.getvalue().rsplit("\r", 2)
    assert (last[1].strip(), last[2]) == ("", "")


@pytest.mark.parametrize("how", ["environment", "listener", "no terminal"])
def test_it_is_silent_where_that_is_asked_for_or_nobody_looks(monkeypatch, how):
    screen = io.StringIO() if how == "no terminal" else Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(progress._Line, "AFTER", 0.001)
    if how == "environment":
        monkeypatch.setenv("SYMHELI_PROGRESS", "0")
    with progress.watched(None) if how == "listener" else contextlib.nullcontext():
        for _ in progress.tracked("flying", range(2)):
            time.sleep(0.01)
    assert screen.getvalue() == ""
