"""A controller that was synthesized, with the plant it was made for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.lpv import LinearModel, LPVStateSpace
from synthesis.certificate import Attempt, Certificate

if TYPE_CHECKING:
    from symheli.flight import ScheduledController
    from synthesis.design.plant import Plant


@dataclass(frozen=True, eq=False, kw_only=True)
class Controller:
    """x' = A(p) x + B(p) y, u = C(p) x + D(p) y from the measurements of a plant to its controls.

    Attributes
    ----------
    model : LPVStateSpace
        The controller itself; what flies and what is certified.
    plant : Plant
        What it was made for.
    gamma : float
        What its synthesis promised, in units of performance per unit of disturbance: a number to
        compare with, no proof. `certify` proves.
    method : str
        By which it was made, in some words.
    misfit : float
        Of the functions of p in the model to the gains that were computed, relative.
    attempts : tuple of Attempt
        Every program that was solved.

    Examples
    --------
    >>> from symheli.lpv import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial(
    ...     A=[[[-1.0]], [[2.0]]], B=[[[1.0, 0.0, 1.0]]], C=[[[1.0]], [[0.0]], [[1.0]]],
    ...     D=[[[0, 0, 0], [0, 0, 1], [0, 0.1, 0]]], scheduling=p,
    ...     inputs=("w", "noise", "u"), outputs=("x", "effort", "y"))
    """

    model: LPVStateSpace
    plant: Plant
    gamma: float
    method: str
    misfit: float = 0.0
    attempts: tuple[Attempt, ...] = ()

    def at(self, *p: float) -> LinearModel:
        """The controller frozen at p, one value a parameter."""
        return self.model.at(*p)

    @property
    def dt(self) -> float | None:
        """Sample period, s; None in continuous time."""
        return self.model.dt

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.model.states)

    def closed(self) -> Any:
        """The plant under this controller, from disturbances to performance."""
        return self.plant.close(self.model)

    def certify(self, rate: Any = None, **options: Any) -> Certificate:
        """Its proven gain: `synthesis.l2_gain` of the closed loop, which knows nothing of how the
        controller was made.
        """
        from synthesis.analysis.l2_gain import l2_gain

        return l2_gain(self.closed(), rate, **options)

    def discretize(self, dt: float) -> Controller:
        """Sampled by Tustin's rule at every frozen p, by functions of the same degree."""
        from synthesis.design.sampling import tustin

        model = tustin(self.model, dt)
        return replace(self, model=model)

    def reduce(self, order: int) -> Controller:
        """At most `order` states: one projection that keeps what the closed loop sees of the
        controller; see `synthesis.design.reduction`.
        """
        from synthesis.design.reduction import reduced

        return reduced(self, order)

    @property
    def scheduled_controller(self) -> ScheduledController:
        """For `symheli.fly`: a sampled controller from measured states to helicopter inputs."""
        from symheli.flight import ScheduledController

        return ScheduledController(self.model)

    def reset(self) -> None:
        """States to zero, before a flight."""
        self.scheduled_controller.reset()

    def __str__(self) -> str:
        names = ", ".join(s.name for s in self.model.parameters)
        return (
            f"{self.method}: {self.order} states, {', '.join(self.model.inputs)} ->"
            f" {', '.join(self.model.outputs)} over {names}; gamma {self.gamma:.6g} in synthesis"
        )


def gains_of(model: LPVStateSpace, p: np.ndarray) -> tuple[np.ndarray, ...]:
    """A, B, C, D (K, ..) at p (K, m)."""
    return tuple(model.matrices(p[:, 0] if len(model.parameters) == 1 else p))
