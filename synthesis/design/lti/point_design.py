"""A controller for one frozen model with the check of its loop, or the reason why there is none."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from symheli import LinearModel, UncertainStateSpace
from symheli.errors import InputError
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from synthesis.design.loops.controller import Controller
from synthesis.design.plant.generalized import Channels, Generalized
from synthesis.design.plant.plant import Plant
from synthesis.numerics.linear.norm import norm

Matrices = tuple[Any, Any, Any, Any]


class DesignStatus(Enum):
    """Outcome of a design; the value is the sentence to print."""

    SOLVED = "solved: the loop was recomputed, it is stable and keeps the level"
    IMPOSSIBLE = "no design: the problem has no solution, or none that the method can find"
    TOO_LOW = "no design: no controller reaches this level"
    FAILED = "no design: no controller passed the check of its loop"


@dataclass(frozen=True, eq=False)
class PointDesign:
    """A controller u = K y of one model, with the verified properties of its loop.

    Parameters
    ----------
    status : DesignStatus
        Whether there is one; `reasons` say why there is none, or what the level is worth.
    controller : LinearModel or None
        K from measurements to controls, with positive feedback. Its states estimate those of the
        model, in the same coordinates: controllers of neighbouring models may be interpolated.
    loop : LinearModel or None
        From disturbances to performance.
    hinf_norm : float
        Norm of that loop, recomputed from its matrices; inf where there is none.
    optimum : float
        Lower bound for every controller, to the requested accuracy; NaN where it was not computed.
    reasons : tuple of str
        Sentences.
    limit : str
        Which of the conditions keeps a lower level out of reach.
    """

    status: DesignStatus
    controller: LinearModel | None
    loop: LinearModel | None
    hinf_norm: float
    optimum: float
    reasons: tuple[str, ...] = ()
    limit: str = ""

    __repr__ = summarized

    @classmethod
    def without(
        cls, status: DesignStatus, reasons: Sequence[str], optimum: float = float("nan")
    ) -> PointDesign:
        """Return a design without a controller, with the reason."""
        return cls(status, None, None, float("inf"), optimum, tuple(reasons))

    def __str__(self) -> str:
        head = self.status.value
        if self.controller is not None:
            head += f"; gamma = {self.hinf_norm:.6g}"
        return "\n".join([head, *([self.limit] if self.limit else []), *self.reasons])


def design_at(plant: Plant, p: Sequence[float], design: Callable[..., PointDesign]) -> PointDesign:
    """Return the design for the model of a plant at p, one value a parameter, with its channels."""
    w, z = plant.disturbances, plant.performance
    return design(
        plant.nominal.at(*p), plant.controls, plant.measurements, disturbances=w, performance=z
    )


def on_plant(
    plant: Plant,
    names: Iterable[object],
    design: Callable[..., PointDesign],
    method: str,
    *,
    gain: bool,
) -> Controller:
    """Return the controller of a plant that is one model, with a promise where the design is of the
    gain; raise `InputError` for another plant and for `names` of channels beside it, and
    `SynthesisError` where there is none.
    """
    if any(names):
        raise InputError("a plant names its channels: leave out controls, measurements and others")
    if plant.basis.size > 1 or isinstance(plant.model, UncertainStateSpace):
        names = ", ".join(s.name for s in plant.parameters)
        raise InputError(
            f"{method} is of one model, and the plant depends on {names} or is uncertain:"
            " synthesis.output_feedback takes it whole, dataclasses.replace(plant,"
            " model=plant.nominal.at(...)) is one model of it"
        )
    found = design_at(plant, [0.5 * (s.low + s.high) for s in plant.parameters], design)
    made = Controller.of(plant, found, method)
    if not gain:
        return replace(made, notes=(f"the {method} norm of its loop is {found.hinf_norm:.6g}",))
    least = found.optimum if found.optimum > 0 else None
    notes = (found.limit, *(found.reasons if least is None else ()))
    return replace(
        made, promised=found.hinf_norm, optimum=least, notes=tuple(note for note in notes if note)
    )


def named_controller(K: Matrices, names: Channels, dt: float | None) -> LinearModel:
    """Return K with the names of the states it estimates, the measurements it reads and its
    commands.
    """
    states = tuple(Signal(f"{s}_estimate", s.unit) for s in names.states[: len(K[0])])
    return LinearModel(*K, states, names.measurements, names.controls, dt)


def named_loop(plant: Generalized, K: LinearModel, names: Channels) -> LinearModel:
    """Return the loop of u = K y from disturbances to performance."""
    closed = plant.closed(K.A, K.B, K.C, K.D)
    return LinearModel(
        *closed, (*names.states, *K.states), names.disturbances, names.performance, K.dt
    )


def checked(
    plant: Generalized, K: Matrices, names: Channels, dt: float | None
) -> PointDesign | None:
    """Return the controller with the H-infinity norm of its loop, recomputed; None where the loop
    is not well posed or not stable.
    """
    if not all(np.all(np.isfinite(M)) for M in K):
        return None
    controller = named_controller(K, names, dt)
    try:
        loop = named_loop(plant, controller, names)
    except InputError:
        return None
    gamma = norm(loop.A, loop.B, loop.C, loop.D, dt)[0]
    if not math.isfinite(gamma):
        return None
    return PointDesign(DesignStatus.SOLVED, controller, loop, gamma, math.nan)
