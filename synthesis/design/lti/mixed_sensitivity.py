"""Mixed sensitivity S/KS/T: disturbance rejection, control effort and roll-off, weighted
together.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv import append, series
from symheli.lpv.linear_model import as_model
from symheli.lpv.mixing import itself, mixed
from symheli.values.signal import Signal
from synthesis.design.lti.hinf import hinf
from synthesis.design.lti.point_design import PointDesign
from synthesis.design.lti.weights import Weight, as_weight


def mixed_sensitivity(
    G: LinearModel,
    W1: Weight,
    W2: Weight = None,
    W3: Weight = None,
    *,
    gamma: float | None = None,
    back_off: float = 1.01,
) -> PointDesign:
    """Design the controller that minimises the gain of [W1 S; W2 K S; W3 T].

    It takes the loop alone, since its weights stand for disturbances and performance. Of a `Plant`
    it is the design for `plant.nominal.at(p).select(inputs=plant.controls,
    outputs=plant.measurements)`, and `Controller.of(plant, design)` is its `Controller`.

    With a disturbance w at the outputs of the plant, y = G u + w and u = K y (positive feedback: to
    follow a reference, give the controller y - r): S from w to y, K S from w to u, T from w to G u.

    Parameters
    ----------
    G : LinearModel or system of python-control
        The plant, continuous or sampled.
    W1 : weight
        On the outputs: a number, a system of one input and output for all channels alike, a square
        system, or a sequence with one for each channel.
    W2 : weight, optional
        On the controls. Without it, W1 or W3 must see every control at high frequency.
    W3 : weight, optional
        On the outputs without the disturbance.
    gamma, back_off : float
        As in `hinf`.

    Returns
    -------
    PointDesign
        Controller from the outputs of G to its inputs, by their names; the weighted loop has the
        outputs S_y, KS_u and T_y.

    Raises
    ------
    InputError
        A weight with another number of channels or another sample period.

    References
    ----------
    Skogestad and Postlethwaite (2005), Multivariable Feedback Control, sections 2.8 and 9.3.

    Examples
    --------
    >>> from symheli import LinearModel
    >>> lag = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    >>> weight = LinearModel([[-0.001]], [[1.0]], [[1.0]], [[0.5]], ["e"], ["y"], ["S"])
    >>> design = mixed_sensitivity(lag, weight, 0.1)  # at least 0.5 of S at high frequency
    >>> print(f"{design.optimum:.4f}", design.controller.inputs, design.controller.outputs)
    0.5350 ('y',) ('u',)
    """
    G = as_model(G)
    if all(W is None for W in (W1, W2, W3)):
        raise InputError("mixed_sensitivity: expected a weight on the outputs or the controls")
    plant = _weighted(
        G,
        *(
            None if W is None else as_weight(W, name, channels, G.dt)
            for W, name, channels in (
                (W1, "W1", G.outputs),
                (W2, "W2", G.inputs),
                (W3, "W3", G.outputs),
            )
        ),
    )
    return hinf(plant, G.inputs, G.outputs, gamma=gamma, back_off=back_off)


def _weighted(G: LinearModel, *weights: LinearModel | None) -> LinearModel:
    """Return the system from (w, u) to (S, KS, T, y)."""
    disturbed = {y: Signal(f"{y}_disturbance", y.unit) for y in G.outputs}
    inputs = {**{w: {} for w in disturbed.values()}, **itself(G.inputs)}
    measured = {y: {w: 1.0} for y, w in disturbed.items()}
    outputs, across, behind = {}, dict(measured), []
    for label, W in zip(("S", "KS", "T"), weights, strict=True):
        if W is not None:
            names = tuple(Signal(f"{label}_{s}") for s in W.outputs)
            behind.append(replace(W, inputs=names, outputs=names, dt=G.dt))
            for name, s in zip(names, W.outputs, strict=True):
                outputs[name] = {} if label == "KS" else {s: 1.0}
                across[name] = {"S": measured.get(s, {}), "KS": {s: 1.0}, "T": {}}[label]
    outputs |= itself(G.outputs)
    own = mixed(LPVStateSpace.constant(G), inputs, outputs, across).at(0.5)
    straight = LinearModel.gain(np.eye(len(G.outputs)), G.outputs, G.outputs)
    return series(own, append(*behind, replace(straight, dt=G.dt)))
