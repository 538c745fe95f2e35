"""Point designs that take turns over a parameter, with hysteresis and without a step of the
command.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symheli import LinearModel, LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.named_vector import NamedVector
from symheli.values.numbers import positive
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from synthesis.design.loops.controller import Controller
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.switching.dwell_time import DwellTime, dwell_time


class SwitchedState(NamedTuple):
    """State between samples: which design flies (-1: none yet), and its own state."""

    design: int
    own: Any


@dataclass(frozen=True, eq=False, kw_only=True)
class SwitchedController:
    """u = C_i x + D_i y + o, x' = A_i x + B_i y: the design of the region that the parameter is in.

    Regions overlap: design i is left for the next one at the upper end of its region, for the one
    before at the lower end. At a switch the states go on, and the offset o takes what the commands
    of the two designs differ by, so that the command does not step; o then fades.

    Attributes
    ----------
    plant : Plant
        Over one parameter; its measurements do not depend on it.
    designs : tuple of LinearModel
        From its measurements to its controls, of as many states each; see `switched`.
    regions : tuple of (float, float)
        Of each, in the unit of the parameter.
    fade : float
        Time constant of the offset, s.

    Examples
    --------
    >>> low, high = (synthesis.lqg(plant).at(p) for p in (0.2, 0.8))
    >>> made = synthesis.switching.switched(plant, [low, high], edges=[0.5], hysteresis=0.2)
    >>> made.regions
    ((0.0, 0.6), (0.4, 1.0))
    >>> made.certify(rate=0.05).verified
    True
    """

    plant: Plant
    designs: tuple[LinearModel, ...]
    regions: tuple[tuple[float, float], ...]
    fade: float = 1.0

    __repr__ = summarized

    @property
    def dt(self) -> float | None:
        """Sample period, s; None in continuous time."""
        return self.designs[0].dt

    @property
    def travel(self) -> float:
        """The least that the parameter moves between two switches."""
        up = [high for _, high in self.regions[:-1]]
        down = [low for low, _ in self.regions[1:]]
        ways = [b - a for a, b in zip(down, up, strict=True)]
        return min([*ways, *(b - a for a, b in [*pairwise(up), *pairwise(down)])])

    def discretize(self, dt: float) -> SwitchedController:
        """Sample the designs by Tustin's rule."""
        return replace(self, designs=tuple(K.discretize(dt, "tustin") for K in self.designs))

    def certify(self, rate: float | None = None, **options: Any) -> DwellTime:
        """Prove the loop stable for every motion of the parameter up to a rate: between two
        switches pass at least `travel` over rate (sampled: a sample less), and a dwell time as long
        is proven, with the offsets of the commands and the parameter anywhere in each region.

        Parameters
        ----------
        rate : float, optional
            Largest |dp/dt|, in the unit of the parameter per second; default the plant's own.
        **options
            Of `synthesis.switching.dwell_time`.

        Raises
        ------
        InputError
            A rate at which the parameter crosses a region in a sample.
        """
        (parameter,) = self.plant.parameters
        given = parameter.rate if rate is None else rate
        rate = positive(given, "rate")
        step = 0.0 if self.dt is None else rate * self.dt
        seconds = (self.travel - step) / rate
        if not seconds > (self.dt or 0.0):
            raise InputError(
                f"rate: at {rate:g} per second a switch may follow the other after {seconds:.3g} s;"
                " widen the hysteresis or give a lower rate"
            )
        loops = [
            self._loop(K, max(low - step, parameter.low), min(high + step, parameter.high))
            for K, (low, high) in zip(self.designs, self.regions, strict=True)
        ]
        count = range(len(loops))
        jumps = {(i, j): self._jump(i, j) for i in count for j in count if abs(i - j) == 1}
        return dwell_time(loops, jumps, within=seconds, **options)

    def _loop(self, K: LinearModel, low: float, high: float) -> LPVStateSpace:
        """Return the loop of a design with its offsets, over a range."""
        n, nu = len(K.states), len(K.outputs)
        left = -1 / self.fade if K.dt is None else math.exp(-K.dt / self.fade)
        A = np.block([[K.A, np.zeros((n, nu))], [np.zeros((nu, n)), left * np.eye(nu)]])
        B, C = np.vstack([K.B, np.zeros((nu, len(K.inputs)))]), np.hstack([K.C, np.eye(nu)])
        offsets = tuple(Signal(f"{u}_offset", u.unit) for u in K.outputs)
        whole = LinearModel(A, B, C, K.D, (*K.states, *offsets), K.inputs, K.outputs, K.dt)
        loop = Controller.of(self.plant, whole).closed()
        (parameter,) = loop.parameters
        return loop.with_scheduling(replace(parameter, low=low, high=high))

    def _jump(self, i: int, j: int) -> Array:
        """Return the states of the loop after a switch per those before."""
        old, new = self.designs[i], self.designs[j]
        n, nk, nu = len(self.plant.states), len(old.states), len(old.outputs)
        rows = [self.plant.measurements.index(y) for y in old.inputs]
        y = self.plant.at(self.regions[i][0]).C2[rows]
        J = np.eye(n + nk + nu)
        J[n + nk :, :n] = (old.D - new.D) @ y
        J[n + nk :, n : n + nk] = old.C - new.C
        return J

    # --- how it flies ----------------------------------------------------------------------------

    def init(self, command: ArrayLike | None = None) -> SwitchedState:
        """Return the state before a flight; with `command` (nu,), rad, those in force, which the
        first step answers.
        """
        return SwitchedState(-1, self._flown[0].init(command, fade=self.fade))

    def step(
        self, state: SwitchedState, measured: NamedVector, reference: NamedVector, p: NamedVector
    ) -> tuple[Array, SwitchedState]:
        """Return the commands (4,), rad, and the state at the next sample; see
        `symheli.flight.PureController`.
        """
        (parameter,) = self.plant.parameters
        design, own = self._design_at(float(p[parameter.name]), state.design), state.own
        if design != state.design and state.design >= 0:  # begin at what the other commands
            before, _ = self._flown[state.design].step(own, measured, reference, p)
            begun = self._flown[design].init(before[self._flown[design].rows], fade=self.fade)
            own = begun._replace(x=getattr(own, "x", own))
        u, own = self._flown[design].step(own, measured, reference, p)
        return u, SwitchedState(design, own)

    def _design_at(self, p: float, before: int = -1) -> int:
        """Return which design flies at p after `before`; after none the one whose region p is
        farthest inside.
        """
        if before < 0:
            return int(np.argmax([min(p - low, high - p) for low, high in self._open]))
        while p >= self._open[before][1]:
            before += 1
        while p <= self._open[before][0]:
            before -= 1
        return before

    @property
    def _open(self) -> list[tuple[float, float]]:
        """The regions, the outer ones without an end."""
        ends = [list(region) for region in self.regions]
        ends[0][0], ends[-1][1] = -math.inf, math.inf
        return [(low, high) for low, high in ends]

    @cached_property
    def _flown(self) -> list[Any]:
        return [Controller.of(self.plant, K).scheduled_controller for K in self.designs]


def switched(
    plant: Plant,
    designs: Collection[Any],
    edges: Sequence[float],
    hysteresis: float,
    *,
    fade: float = 1.0,
) -> SwitchedController:
    """Switch between designs where the one parameter of a plant passes edges.

    Parameters
    ----------
    plant : Plant
        What they are for, over one parameter.
    designs : sequence of LinearModel
        In order of the parameter, one more than edges; frozen controllers of `lqr`, `lqg`, `hinf`,
        or what else `Plant.close` takes for one model. All have as many states, of one meaning.
    edges : sequence of float
        Between the regions, increasing.
    hysteresis : float
        By how much two regions overlap, the edge in the middle.
    fade : float
        Time constant, s, of what a switch would step the command by.

    Returns
    -------
    SwitchedController
        `certify` proves the switched loop.

    Raises
    ------
    InputError
        Another number of designs, regions that leave the range or hold no value that is theirs
        alone, designs of different states, measurements that depend on the parameter or a control.

    References
    ----------
    Gavrilets et al., AIAA 2002-4834, for gains that are switched over airspeed without a bump.

    Examples
    --------
    >>> gains = [{("u", "y"): -k} for k in (5.0, 8.0)]
    >>> made = synthesis.switching.switched(plant, gains, edges=[0.5], hysteresis=0.2)
    >>> print(made.regions, f"{made.travel:g}")
    ((0.0, 0.6), (0.4, 1.0)) 0.2
    """
    require_plant(plant)
    if len(plant.parameters) != 1 or isinstance(plant.model, UncertainStateSpace):
        raise InputError("switched: expected a plant over one parameter, without uncertainty")
    own = tuple(_frozen(Controller.of(plant, one)) for one in designs)
    (parameter,) = plant.parameters
    width, at = positive(hysteresis, "hysteresis"), frozen(edges, "edges", (None,))
    if len(own) != len(at) + 1 or len(own) < 2:
        raise InputError(f"expected one design more than edges, got {len(own)} and {len(at)}")
    first = own[0]
    if any((len(K.states), K.dt, K.inputs, K.outputs) != (
        len(first.states), first.dt, first.inputs, first.outputs) for K in own):  # fmt: skip
        raise InputError(
            "designs: expected the same signals, sample period and number of states of all; take"
            " the frozen controllers of one kind of design, as synthesis.lqg(plant).at(p)"
        )
    low, high = [parameter.low, *(at - width / 2)], [*(at + width / 2), parameter.high]
    apart = [parameter.low, *(x for edge in at for x in (edge - width / 2, edge + width / 2))]
    if not all(a < b for a, b in pairwise([*apart, parameter.high])):
        raise InputError(
            f"edges: regions about {list(map(float, at))} with a hysteresis of {width:g} overlap"
            f" beyond their neighbours or leave {parameter.low:g} to {parameter.high:g}"
        )
    if np.ptp(plant.matrices(np.linspace(parameter.low, parameter.high, 9)).C2, axis=0).any():
        raise InputError("the measurements (C2) depend on the parameter: measure states themselves")
    if np.any(plant.at(parameter.low).D22):
        raise InputError("a control acts on a measurement at once: put a servo or delay between")
    return SwitchedController(
        plant=plant,
        designs=own,
        regions=tuple((float(a), float(b)) for a, b in zip(low, high, strict=True)),
        fade=positive(fade, "fade"),
    )


def _frozen(made: Controller) -> LinearModel:
    """Return a controller that does not move with the parameter."""
    if made.model.basis.size > 1:
        raise InputError("designs: expected controllers of one model each; freeze it, .at(p)")
    return made.at(*(0.5 * (s.low + s.high) for s in made.plant.parameters))
