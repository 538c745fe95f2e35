"""Interfaces of a controller in flight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

from symheli.values.named_vector import NamedVector

Answer = Callable[[NamedVector, NamedVector, NamedVector], Any]
"""Commands from (measured, reference, p), called sample after sample of one flight."""


@runtime_checkable
class StatefulController(Protocol):
    """A controller that keeps its own state: a sample period, a reset, and a command at every
    sample.

    Such an object flies one flight after the other; to fly in several threads at once, each
    thread needs its own. A `PureController` needs no such care.

    Examples
    --------
    >>> class Hold:
    ...     "Keeps the wings level, and leaves the rest at its trim."
    ...     dt = 0.02
    ...
    ...     def reset(self):
    ...         pass
    ...
    ...     def step(self, measured, reference, p):
    ...         u = np.array([reference[name] for name in ("d_lon", "d_lat", "d_col", "d_ped")])
    ...         u[1] -= 0.03 * (measured["phi"] - reference["phi"])
    ...         return u
    >>> hover = symheli.AirspeedSchedule((0.0,), (1.0,), (0.0,), lead=0.2)
    >>> bool(np.abs(symheli.fly(heli, hover, controller=Hold())["phi"]).max() < 0.2)
    True
    """

    dt: float
    """Sample period, s."""

    def reset(self) -> None:
        """Called once, before the first sample of a flight."""

    def step(self, measured: NamedVector, reference: NamedVector, p: NamedVector) -> object:
        """Blade pitch commands (4,), rad, d_lon d_lat d_col d_ped in all, at one sample.

        `measured`: u v w p q r phi theta and airspeed as the sensors read them, and with governor
        "pi" Om om_i. `reference`: states and inputs of the trim that the flight is held to. `p`:
        commanded airspeed and acceleration. SI and radians.
        """
        ...


@runtime_checkable
class PureController(Protocol):
    """A controller without internal state: its `step` takes the state as an argument and returns
    the next one.

    Whoever flies it keeps the state, so that one object flies in any number of flights at once.
    Every controller of this package is one.

    Examples
    --------
    >>> class Slow:
    ...     "Levels the wings by a bank that is filtered first, half of it new at every sample."
    ...     dt = 0.02
    ...
    ...     def init(self):
    ...         return 0.0
    ...
    ...     def step(self, state, measured, reference, p):
    ...         bank = 0.5 * (state + measured["phi"] - reference["phi"])
    ...         u = np.array([reference[name] for name in ("d_lon", "d_lat", "d_col", "d_ped")])
    ...         u[1] -= 0.03 * bank
    ...         return u, bank
    >>> hover = symheli.AirspeedSchedule((0.0,), (1.0,), (0.0,), lead=0.2)
    >>> bool(np.abs(symheli.fly(heli, hover, controller=Slow())["phi"]).max() < 0.2)
    True
    """

    @property
    def dt(self) -> float:
        """Sample period, s."""
        ...

    def init(self) -> Any:
        """The state before the first sample of a flight."""

    def step(
        self, state: Any, measured: NamedVector, reference: NamedVector, p: NamedVector
    ) -> tuple[Any, Any]:
        """Blade pitch commands (4,), rad, at one sample, and the state for the next; its
        arguments are those of a `StatefulController`.
        """
        ...


def begun(controller: Any) -> Answer:
    """Return the function that computes commands along one flight: it keeps the state of a pure
    controller, and resets one that keeps its own.
    """
    if hasattr(controller, "reset"):
        controller.reset()
        return controller.step
    state = controller.init()

    def answer(measured: NamedVector, reference: NamedVector, p: NamedVector) -> Any:
        nonlocal state
        u, state = controller.step(state, measured, reference, p)
        return u

    return answer
