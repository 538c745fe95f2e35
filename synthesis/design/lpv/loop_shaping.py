"""Loop shaping over p: weights shape the loop at every p, the controller makes it robust."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv import series
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal
from synthesis.certify.statement.impose import Grid
from synthesis.certify.statement.rates import Rate
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.output_feedback import output_feedback
from synthesis.design.lpv.search import BACK_OFF
from synthesis.design.lti.loop_shaping import four_block
from synthesis.design.lti.weights import Weight, as_weight
from synthesis.numerics.program.bases import Dependence


class LoopShaping(NamedTuple):
    """`controller`, W1 K W2, of the plant itself: u = W1 K W2 y, positive feedback; `shaped`, K of
    W2 G W1.

    `shaped.promised` is the gain from noise at the outputs and a disturbance at the inputs of the
    shaped plant to its inputs and outputs; at frozen p the inverse of the coprime stability margin.
    `shaped.certify()` proves it.
    """

    controller: LPVStateSpace
    shaped: Controller


def loop_shaping(
    G: LPVStateSpace,
    W1: Weight | LPVStateSpace = 1.0,
    W2: Weight | LPVStateSpace = 1.0,
    rate: Rate = None,
    *,
    X: Dependence | None = None,
    Y: Dependence | None = None,
    back_off: float | Sequence[float] = BACK_OFF,
    impose: Grid | None = None,
) -> LoopShaping:
    """Design the scheduled controller of the least gain [K; I] (I - W2 G W1 K)^-1 [I, W2 G W1] of a
    plant shaped by weights: `output_feedback` of the problem that `ncfsyn` solves at one p.

    It takes the loop alone, since its weights stand for disturbances and performance. Of a `Plant`
    it is the design for `plant.nominal.select(inputs=plant.controls, outputs=plant.measurements)`,
    and `Controller.of(plant, made)` is its `Controller`.

    Parameters
    ----------
    G : LPVStateSpace
        The plant, continuous or sampled.
    W1, W2 : weight or LPVStateSpace
        Before and behind it, as for `ncfsyn`; also over the same parameters.
    rate, X, Y, back_off, impose
        As for `output_feedback`.

    Returns
    -------
    LoopShaping
        The controller of the plant, and that of the shaped plant with what it promises.

    Raises
    ------
    InputError
        Another kind of model; weights as for `ncfsyn`; otherwise as `output_feedback`.
    SynthesisError
        As `output_feedback`.

    References
    ----------
    McFarlane and Glover, IEEE Trans. Automatic Control 37 (1992), with a gain over p(t) in place of
    the H-infinity norm; `lpvncfsyn` of LPVTools.

    Examples
    --------
    An integrator, whose optimum is sqrt(2) while its gain p is at rest:

    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 1.0, 2.0, rate=0.1)
    >>> G = LPVStateSpace.polynomial([[[0.0]]], [[[0.0]], [[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> made = synthesis.designs.loop_shaping(G, W1=0.5)
    >>> bool(1.414 < made.shaped.optimum < 1.5), made.controller.inputs == G.outputs
    (True, True)
    """
    if not isinstance(G, LPVStateSpace):
        raise InputError(
            f"G: expected an LPVStateSpace, got {type(G).__name__}; ncfsyn takes one linear model"
        )
    before = _weight(W1, "W1", G.inputs, G.dt)
    behind = _weight(W2, "W2", G.outputs, G.dt)
    shaped = series(series(before, G), behind)
    made = output_feedback(four_block(shaped), rate, X=X, Y=Y, back_off=back_off, impose=impose)
    made = replace(made, method=f"loop shaping, {made.method}")
    return LoopShaping(series(series(behind, made.model), before), made)


def _weight(
    given: Any, name: str, channels: Sequence[Signal], dt: float | None
) -> LinearModel | LPVStateSpace:
    """Return the weight on these channels, from and to signals of their names."""
    if isinstance(given, int | float) and given == 0:
        raise InputError(f"{name}: expected a weight that is not 0, which opens the loop")
    if not isinstance(given, LPVStateSpace):
        return as_weight(given, name, channels, dt)
    if len(given.inputs) != len(channels) or len(given.outputs) != len(channels):
        raise InputError(
            f"{name}: expected a weight of {len(channels)} channels ({', '.join(channels)}), got"
            f" one from {len(given.inputs)} to {len(given.outputs)}"
        )
    if not same_period(given.dt, dt):
        raise InputError(
            f"{name}: its sample period is {given.dt} s, the model's {dt} s; make them equal"
        )
    states = tuple(Signal(f"{name}_{s}", s.unit) for s in given.states)
    return replace(given, states=states, inputs=tuple(channels), outputs=tuple(channels))
