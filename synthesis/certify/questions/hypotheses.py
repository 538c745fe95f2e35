"""The hypotheses of a certificate, as sentences: the misfit of the model and the code that is
trusted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.trim_drift import PREFIX
from synthesis.certify.statement.kind import Kind
from synthesis.certify.statement.opened import open_block
from synthesis.certify.statement.sentences import motion

NEGLIGIBLE_ENTRY = 1e-12
"""Entries below this fraction of the largest of their row of [A B] or [C D] are rounding, and so is
their misfit.
"""

VERIFIED = (
    "verified in floating point: {what}; verify(rigorous=True) proves it in exact arithmetic, and"
    " looks at some p once more through the model's own matrices: {shared} are shared by the search"
    " for P and the proof"
)


def hypotheses(
    kind: Kind,
    parameters: Sequence[Scheduling],
    rates: Sequence[float],
    model: object,
    found: Sequence[str],
) -> tuple[str, ...]:
    """Return sentences on how p may move, the misfit of the model, how the proof was `found`, and
    the meaning of the bound.
    """
    moving = tuple(motion(s, rate) for s, rate in zip(parameters, rates, strict=True))
    meaning = (kind.facets.meaning,) if kind.facets.sense else ()
    return (*moving, *perturbed(model), *fitted(model), *drifting(model), *found, *meaning)


def perturbed(model: object) -> tuple[str, ...]:
    """Return for which perturbations a statement on a set of models holds, and what its bound
    means.
    """
    if not isinstance(model, UncertainStateSpace):
        return ()
    _, block = open_block(model, channels=False)
    promise = (
        "the bound on Delta holds"
        if model.probability == 1.0
        else f"the bound on Delta holds with probability {model.probability:g}"
    )
    return (block.sentence, f"{promise}: {model.source}")


def drifting(model: object) -> tuple[str, ...]:
    """Return the neglected terms of a model about a moving trim, as a sentence."""
    model = model.model if isinstance(model, UncertainStateSpace) else model
    if not isinstance(model, LPVStateSpace):
        return ()
    if declared := [str(u) for u in model.inputs if u.startswith(PREFIX)]:
        return (f"the drift of the moving trim is a declared disturbance: {', '.join(declared)}",)
    if model.trim is None:
        return ()
    return (
        "the drift of a moving trim, -x0'(p) dp/dt, is left out: it acts as a further disturbance",
    )


def fitted(model: object) -> tuple[str, ...]:
    """Return the misfit of an interpolated or sampled model as a hypothesis; nothing for a model
    without one.
    """
    model = model.model if isinstance(model, UncertainStateSpace) else model
    if not isinstance(model, LPVStateSpace) or model.residuals is None:
        return ()
    count = {1: 41, 2: 13}.get(len(model.parameters), 5)
    axes = [np.linspace(s.low, s.high, count) for s in model.parameters]
    matrices = model.matrices(axes[0] if len(axes) == 1 else tensor_grid(axes))
    misfits = model.residuals.matrices
    own, off = (
        np.abs(np.block([[A, B], [C, D]])).max(axis=0) for A, B, C, D in (matrices, misfits)
    )
    size = np.maximum(own, off)
    real = size > NEGLIGIBLE_ENTRY * size.max(axis=1, keepdims=True, initial=0.0)
    ratio = np.where(real, off / np.where(real, size, 1.0), 0.0)
    worst, place = float(ratio.max(initial=0.0)), ""
    if worst:
        i, j = np.unravel_index(int(ratio.argmax()), ratio.shape)
        rows, of = (*model.states, *model.outputs), (*model.states, *model.inputs)
        part = 100 * off[i, j] / size[i].max()
        place = (
            f", {size[i, j]:.2g}, from {of[j]} to {rows[i]}, which is {part:.2g} % of the largest"
            " entry of its row"
        )
    what = (
        "the interpolated model"
        if model.dt is None
        else f"the sampled model (p held over each {model.dt:g} s, entries fitted in p)"
    )
    return (
        (
            f"of {what}: an entry differs from what it was fitted to by at most {100 * worst:.2g} %"
            f" of its largest value{place}"
        ),
    )
