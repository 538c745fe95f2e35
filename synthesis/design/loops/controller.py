"""A controller that was synthesized, with the plant it was made for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from symheli import LFT, LinearModel, LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.named_vector import NamedVector
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.statement.forms import Spline
from synthesis.certify.statement.impose import Bernstein
from synthesis.certify.statement.outcome import Attempt
from synthesis.certify.statement.rates import limits
from synthesis.design.plant.as_controller import as_controller
from synthesis.design.plant.diagnosis import decided
from synthesis.design.plant.refusals import conditions
from synthesis.numerics.program.cone_program import LYAPUNOV, Solver
from synthesis.numerics.program.effort import Effort

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symheli.flight import ScheduledController
    from synthesis.design.plant.plant import Plant


SAMPLED = (
    "proven of the sampled loop: the plant with its inputs, disturbances too, held over each"
    " {dt:g} s; the statement does not include the time between the samples"
)


GAIN_TOLERANCE = 1.05
"""Ratio of a proven gain to the promised one, or to its lower bound where none is promised, up to
which no richer P is tried.
"""
AS_PROMISED = 1.002
"""Ratio of a proven gain to the promised one up to which the other of loop and adjoint is not
tried.
"""
RICHER_SEARCH: dict[str, Any] = {
    "form": Spline(degree=4, segments=4, grading=1.0),
    "impose": Bernstein(floor=1e-2),
    "solver": Solver(LYAPUNOV, tolerance=1e-3),
}
"""Search used where the usual P proves far more than was promised. A coarse tolerance and a larger
margin leave such a P enough digits for its verification.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Controller:
    """A controller computes the controls of a plant from its measurements: x' = A(p) x + B(p) y, u
    = C(p) x + D(p) y.

    Attributes
    ----------
    model : LPVStateSpace
        The controller itself; what flies and what is certified.
    plant : Plant
        What it was made for; see `loop_plant`.
    promised : float
        What its synthesis promised, in units of performance per unit of disturbance: a number to
        compare with, no proof. `certify` proves. NaN where nothing is promised, as of fewer states.
    method : str
        By which it was made, in some words.
    optimum : float or None
        The least gamma of its inequalities; None where it is not known.
    misfit : float
        Of the functions of p in the model to the gains that were computed, relative.
    attempts : tuple of Attempt
        Every program that was solved.
    by_adjoint : bool
        Whether `certify` uses the adjoint of the loop.
    notes : tuple of str
        Reasons why the synthesis reached no lower gamma, or the controller no requested limit.

    See Also
    --------
    synthesis.output_feedback : a controller of the order of the plant
    synthesis.certify_sampled : the sampled loop as implemented
    symheli.TableController : a controller to fly and to write in C

    Examples
    --------
    >>> made = synthesis.output_feedback(plant)
    >>> print(made.order, made.dt, made.discretize(0.02).dt)
    1 None 0.02
    >>> print(made.at(0.5).inputs, made.at(0.5).outputs)
    ('y',) ('u',)
    >>> proof = made.certify(search=None)
    >>> proof.verified, bool(proof.gamma < made.promised * (1 + 1e-6))
    (True, True)
    >>> made.discretize(0.02).certify(search=None).verified
    True
    """

    model: LPVStateSpace
    plant: Plant
    promised: float
    method: str
    optimum: float | None = None
    misfit: float = 0.0
    attempts: tuple[Attempt, ...] = ()
    by_adjoint: bool = False
    notes: tuple[str, ...] = ()

    __repr__ = summarized
    _repr_html_ = as_table

    @classmethod
    def of(cls, plant: Plant, given: Any, method: str = "given") -> Controller:
        """Return a controller of a plant that was made in another way: gains set by hand, the
        result of a point design, a `TunableController` with its gains; whatever `Plant.close`
        takes.

        Raises `InputError` for anything else, `UnknownNameError` for signals of another plant,
        `SynthesisError` with the reasons for a design that found none.

        Examples
        --------
        >>> high = synthesis.Controller.of(plant, {("u", "y"): -10.0}, "by hand")
        >>> high.certify(search=None).verified
        True
        """
        K = as_controller(given, plant.controls, plant.measurements)
        if isinstance(K, LinearModel):
            K = LPVStateSpace.constant(K, plant.parameters)
        return Controller(model=K, plant=plant, promised=math.nan, method=method)

    def at(self, *p: float) -> LinearModel:
        """Return the controller frozen at p, one value a parameter."""
        return self.model.at(*p)

    def plot(self, input: str | None = None, output: str | None = None) -> tuple[Axes, Axes]:
        """Draw the frequency response from a measurement to a control (default: the first of each)
        at values of the parameters; (magnitude, phase). Raises `UnknownNameError`.
        """
        from symheli.lpv.frozen_plots import bode

        return bode(self.model, input or self.model.inputs[0], output or self.model.outputs[0])

    @property
    def dt(self) -> float | None:
        """Sample period, s; None in continuous time."""
        return self.model.dt

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.model.states)

    @cached_property
    def loop_plant(self) -> Plant:
        """The plant that `closed` closes: the design plant; for a sampled controller, the plant
        with its inputs held between the samples, see `synthesis.design.plant.sampling.held`.

        Raises `InputError` for an uncertain plant that is not sampled as the controller is.
        """
        from synthesis.design.plant.sampling import held

        if self.dt is None or self.plant.dt is not None:
            return self.plant
        return held(self.plant, self.dt)

    def closed(self) -> Any:
        """Return the plant under this controller, from disturbances to performance; sampled if the
        controller is.
        """
        return self.loop_plant.close(self.model)

    def certify(self, rate: Any = None, **options: Any) -> Certificate:
        """Certify the gain with `synthesis.l2_gain` of the closed loop, or of its adjoint; the
        certificate does not use how the controller was made.

        Where Y(p) moved in the synthesis the inverse of P(p) is a polynomial as simple as Y, and
        not P: then the adjoint, which has the same gain, is analysed first. Where one of the two
        proves more than `gamma` the other is tried too, then a richer P where that is far more, and
        the lowest gain is returned; of a parameter whose rate is another one only the loop is,
        since backwards that is not so. Work ends at the usual `effort` once the promised gain is
        proven, not before; an effort that is given ends it with whatever is proven.

        Of a controller that was sampled it is the gain of the sampled loop, and the hypotheses say
        so, with the misfit of the sampled plant. `synthesis.certify_sampled` proves that of a plant
        with servos and delay as they are. Of an LFT it is that of `synthesis.lft_gain`, where p may
        jump.
        """
        from synthesis.certify.questions.adjoint import ADJOINT, adjoint_options
        from synthesis.certify.questions.questions import l2_gain

        loop = self.closed()
        if isinstance(loop, LFT):
            return _of_lft(loop, rate, options)
        rests = [SAMPLED.format(dt=self.dt)] if self.loop_plant is not self.plant else []
        moving = limits(loop.parameters, rate)
        tied = any(isinstance(s.rate, str) for s in moving)
        usual = not {"form", "impose", "solver"} & set(options)

        def proof(adjoint: bool, richer: bool = False) -> Certificate:
            usually: dict[str, Any] = {"form": Spline()} if usual else {}
            if richer:
                usually = dict(RICHER_SEARCH)
            elif adjoint and usual:
                usually |= adjoint_options(len(moving))
            usually["effort"] = until_promised(self.promised)
            if not adjoint:
                return l2_gain(loop, rate, **usually | options).resting_on(rests)
            proven = l2_gain(loop.adjoint(), rate, **usually | options)
            return proven.resting_on([*rests, ADJOINT])

        if tied or isinstance(loop, UncertainStateSpace):
            return proof(False)
        found = proof(self.by_adjoint)
        enough = GAIN_TOLERANCE * found.lower if math.isnan(self.promised) else self.promised
        others = [lambda: proof(not self.by_adjoint)] if usual and moving else []
        if usual and len(moving) == 1 and loop.dt is None:
            # at once where the usual P proves nothing
            others.insert(found.verified, lambda: proof(self.by_adjoint, richer=True))
        for k, other in enumerate(others):
            if found.gamma <= (GAIN_TOLERANCE if k else AS_PROMISED) * enough:
                break
            found = min(found, other(), key=attrgetter("gamma"))
        return found

    def discretize(self, dt: float) -> Controller:
        """Sample the controller by Tustin's rule at every frozen p and fit functions of the same
        degree; `closed` and `certify` then hold the inputs of the plant between the samples.

        The promise stays where the sampled loop keeps it at frozen p, to a tenth; else `promised`
        is NaN, and the `notes` say why. Raises `InputError` for a controller that is sampled, or a
        period that is not positive, `SynthesisError` where the sampled loop is not stable.
        """
        from synthesis.design.loops.sampled_promise import sampled

        return sampled(self, dt)

    def reduce(
        self, order: int | None = None, *, by: str = "loop", loss: float | None = None
    ) -> Controller:
        """Reduce to at most `order` states, or to the fewest with which the largest gain of the
        frozen loops is at most the fraction `loss` above that of all states; give one of the two.

        By "loop" one projection keeps what the closed loop sees of the controller; see
        `synthesis.design.loops.reduction`. By "minimal", "coprime" and "balanced" the controller is
        reduced as a model without its loop, with their orders and losses; see
        `LPVStateSpace.reduce`. What was promised of all states is not promised of fewer:
        `promised` is NaN then, and the `notes` tell both frozen gains. By "minimal" the response is
        the same, and the promise too.

        Raises `InputError` for both or none, an order below 0 or a loss that is no number >= 0,
        `UnknownNameError` for another method, `SynthesisError` where the loop is not stable at some
        frozen p, before or after.

        Examples
        --------
        >>> made = synthesis.output_feedback(plant)
        >>> made.reduce(loss=0.0).order <= made.order
        True
        """
        from synthesis.design.loops.reduction import by_itself, reduced, within

        if by != "loop":
            return by_itself(self, order, by, loss)
        if order is not None and loss is None:
            return reduced(self, order)
        if loss is not None and order is None:
            return within(self, loss)
        raise InputError(
            'reduce: give an order, or a loss such as 0.03, and not both; by="minimal" needs none'
        )

    @cached_property
    def reasons(self) -> tuple[str, ...]:
        """The `notes`, and why `optimum` limits gamma: at some frozen p, a part of the gain that no
        controller can lower. Empty if gamma depends on the controller.
        """
        if self.optimum is None:
            return self.notes
        p, said = conditions(self.plant)
        about = decided(
            self.plant.matrices(p),
            self.plant.channels,
            self.promised,
            self.optimum,
            said,
            self.plant.dt,
        )
        return (*self.notes, *about)

    @cached_property
    def scheduled_controller(self) -> ScheduledController:
        """The controller for `symheli.fly`, where measurements and controls are signals of
        the helicopter.

        Raises `InputError` for a continuous controller and for other signals and parameters.
        """
        from symheli.flight import ScheduledController

        return ScheduledController(self.model)

    def init(self, command: ArrayLike | None = None, *, fade: float = 1.0) -> Any:
        """Return the states (n,) before a flight: zero; with `command` (nu,), rad, the state from
        which the first step answers just that, see `ScheduledController.init`.
        """
        return self.scheduled_controller.init(command, fade=fade)

    def step(
        self, state: Any, measured: NamedVector, reference: NamedVector, p: NamedVector
    ) -> tuple[Array, Any]:
        """Return the commands (4,), rad, at one sample and the state at the next; see
        `symheli.flight.PureController`.
        """
        return self.scheduled_controller.step(state, measured, reference, p)

    def __str__(self) -> str:
        rates = {
            s.name: s.rate if isinstance(s.rate, str) else f"{s.rate:g}"
            for s in self.plant.parameters
        }
        jumps = "constant" if isinstance(self.plant.model, LFT) else "that may jump"
        names = ", ".join(
            f"{name} {jumps if rate == 'inf' else f'(rate {rate})'}" for name, rate in rates.items()
        )
        time = "continuous" if self.dt is None else f"sampled every {self.dt:g} s"
        least = "" if self.optimum is None else f", least {self.optimum:.6g}"
        promised = (
            "  no gain is promised; .certify() proves one"
            if math.isnan(self.promised)
            else f"  promised gain {self.promised:.6g}{least}; not proven, see .certify()"
        )
        lines = [
            f"{self.method}: {self.order} states, {time}, {', '.join(self.model.inputs)} ->"
            f" {', '.join(self.model.outputs)} over {names}",
            promised,
        ]
        return "\n".join([*lines, *(f"  {reason}" for reason in self.reasons)])


def until_promised(promised: float) -> Effort:
    """Return the usual effort of a gain, which no bound above the promised gain ends; NaN: any
    bound ends it.
    """
    from synthesis.certify.questions.questions import EFFORT

    return Effort(EFFORT, enough=math.inf if math.isnan(promised) else AS_PROMISED * promised)


def _of_lft(loop: LFT, rate: Any, options: Mapping[str, Any]) -> Certificate:
    """Return the certificate of a loop that is an LFT, for parameters that jump."""
    from synthesis.certify.questions.lft_gain import lft_gain

    if rate is not None and not np.all(np.isinf(np.asarray(rate, float))):
        raise InputError(
            "rate: the loop is an LFT, certified where p may jump; made.closed() is the loop:"
            " synthesis.robust.worst_case_gain(loop, cells=32) proves its gain where p is constant,"
            " and in continuous time synthesis.robust.rational_gain(loop, rate) at limited rates"
        )
    return lft_gain(loop.reduce(), **options)
