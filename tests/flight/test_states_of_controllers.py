"""What a controller keeps in flight is a value outside it: nothing that flies it changes it."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np
import pytest
from flight.flown import INPUTS, SHORT, STORM, InPython, dynamic

import symheli
from symheli import TableController, fly
from symheli.errors import InputError
from symheli.flight import PureController, StatefulController
from symheli.flight.controller import CONTROLLER_INPUTS, SCHEDULING
from symheli.flight.plan_text import described
from symheli.values import NamedVector, Signal

MAKES = {
    "table": lambda heli: TableController.of(dynamic(heli).model),
    "scheduled": dynamic,
    "asked": lambda heli: InValues(dynamic(heli)),
}
BACK = symheli.AirspeedSchedule((2.0, 6.0), (2.0, 2.0), (0.5, 0.5), lead=0.5)


@dataclass(frozen=True)
class InValues:
    """A controller with its state outside, asked in Python at every sample."""

    controller: symheli.flight.ScheduledController

    @property
    def dt(self):
        return self.controller.dt

    def init(self):
        return self.controller.init()

    def step(self, *asked):
        return self.controller.step(*asked)


@pytest.fixture(params=MAKES)
def controller(request, ideal):
    return MAKES[request.param](ideal)


@pytest.mark.slow(but="scheduled")
def test_one_object_in_two_threads_flies_as_alone(ideal, controller):
    """Two schedules, several times each, so that their samples fall between each other."""
    schedules = 3 * (SHORT, BACK)
    alone = [fly(ideal, s, controller=controller, wind=STORM).values for s in schedules[:2]]
    with ThreadPoolExecutor(2) as pool:
        together = pool.map(lambda s: fly(ideal, s, controller=controller, wind=STORM), schedules)
        for k, record in enumerate(together):
            np.testing.assert_array_equal(record.values, alone[k % 2])


@pytest.mark.slow(only="table")
def test_a_flight_leaves_its_controller_as_it_was(ideal, controller):
    """The first flight fills what is computed once, as matrices in the order of a flight."""
    fly(ideal, SHORT, controller=controller)
    key, content = hash(controller), described(controller)
    known, before = dict(vars(controller)), pickle.dumps(controller)
    record = fly(ideal, BACK, controller=controller)
    assert pickle.dumps(controller) == before
    assert vars(controller) == known
    assert hash(controller) == key
    assert {controller: 1}[controller] == 1
    assert described(controller) == content
    held = {f.name for f in fields(controller)} | {
        name for name in vars(controller) if hasattr(type(controller), name)
    }
    assert set(vars(controller)) == held  # fields and what follows from them, nothing more
    copy = pickle.loads(before)
    assert described(copy) == content
    np.testing.assert_array_equal(fly(ideal, BACK, controller=copy).values, record.values)


def told(k):
    rng = np.random.default_rng(k)
    states = (*CONTROLLER_INPUTS, Signal("airspeed", "m/s"))
    reference = NamedVector(
        (*CONTROLLER_INPUTS, *INPUTS), np.zeros(len(CONTROLLER_INPUTS) + len(INPUTS))
    )
    return (
        NamedVector(states, 0.1 * rng.standard_normal(len(states))),
        reference,
        NamedVector(SCHEDULING, np.array([5.0, 0.0])),
    )


def numbers(state):
    return np.concatenate(
        [
            np.ravel(getattr(state, f.name)).astype(float)
            for f in (fields(state) if isinstance(state, symheli.flight.TableState) else ())
        ]
        or [np.asarray(state)]
    )


def test_a_step_is_a_function_of_its_state(controller):
    """From any state on, whatever was asked between."""
    states, answers = [controller.init()], []
    for k in range(5):
        u, state = controller.step(states[-1], *told(k))
        states.append(state)
        answers.append(u)
    assert np.ptp(answers, axis=0).max() > 0.0
    kept = [numbers(s) for s in states]
    for k in (3, 0, 4, 1, 2):
        for _ in range(2):
            u, state = controller.step(states[k], *told(k))
            np.testing.assert_array_equal(u, answers[k])
            np.testing.assert_array_equal(numbers(state), kept[k + 1])
    for state, before in zip(states, kept, strict=True):
        np.testing.assert_array_equal(numbers(state), before)


def test_a_state_is_not_written_to(ideal):
    scheduled, table = dynamic(ideal), TableController.of(dynamic(ideal).model)
    for state in (scheduled.init(), scheduled.step(scheduled.init(), *told(0))[1]):
        with pytest.raises(ValueError, match="read-only"):
            state[0] = 1.0
    for state in (table.init(), table.step(table.init(), *told(0))[1]):
        for array in (state.x, state.command, state.offset, state.entry, state.flown):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0
    with pytest.raises(InputError, match=r"state: expected the 3 numbers of init\(\)"):
        scheduled.step(np.zeros(4), *told(0))


def test_a_controller_of_the_users_own_is_reset_once_a_flight(ideal):
    class Counting(InPython):
        resets = 0

        def reset(self):
            self.resets += 1
            super().reset()

    own, pure = Counting(dynamic(ideal)), InValues(dynamic(ideal))
    assert isinstance(own, StatefulController)
    assert isinstance(pure, PureController)
    assert not isinstance(pure, StatefulController)
    flown = [fly(ideal, SHORT, controller=c, wind=STORM).values for c in (own, own, pure)]
    assert own.resets == 2
    np.testing.assert_array_equal(flown[1], flown[0])
    np.testing.assert_array_equal(flown[2], flown[0])


def test_an_object_that_resets_keeps_its_state_whatever_else_it_has(ideal):
    """`init` of a class of the user's own may mean anything."""

    class Own(InPython):
        def init(self):
            raise AssertionError("not asked")

    own = Own(dynamic(ideal))
    np.testing.assert_array_equal(
        fly(ideal, SHORT, controller=own).values,
        fly(ideal, SHORT, controller=InPython(dynamic(ideal))).values,
    )
