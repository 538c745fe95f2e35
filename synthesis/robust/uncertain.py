"""The set of all loops of a model around dynamics of bounded gain."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from symheli import LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv.uncertain_state_space import DeltaPart
from symheli.values.signal import Signal, signals
from synthesis.robust.structure import DynamicBlock, channels_of, stable_weight


def uncertain(
    model: LPVStateSpace | UncertainStateSpace,
    blocks: Sequence[DynamicBlock],
    source: str = "blocks of bounded gain",
) -> UncertainStateSpace:
    """Build the set of all loops of a model around several blocks of bounded gain.

    Each block is any causal dynamics within its bound (and weight), at rest at the start. Each
    bound becomes a unit of the outputs of its block, weights become states.

    Parameters
    ----------
    model : LPVStateSpace or UncertainStateSpace
        The model that the blocks are closed around; an uncertain one keeps its own block.
    blocks : sequence of DynamicBlock
        The blocks, each with its channels, its bound and its weight.
    source : str
        Where the bounds come from, in words; certificates quote it.

    Returns
    -------
    UncertainStateSpace
        The set, with a bound of 1; `perturbed` has constant matrices for the dynamics.

    Raises
    ------
    InputError
        For a model that is none, no block, or one that does not fit the model.

    See Also
    --------
    synthesis.robust.robust_margin : Largest multiple of all bounds that keeps a loop stable.
    synthesis.l2_gain : Gain that is proven for every loop of the set.

    Examples
    --------
    A lag that moves, behind dynamics of gain .4 and beside a pole known to .5:

    >>> import symheli, synthesis
    >>> from synthesis.robust import DynamicBlock
    >>> p = symheli.Scheduling("p", "1", low=1.0, high=2.0, rate=1.0)
    >>> lag = symheli.LPVStateSpace.polynomial(
    ...     [[[-1.0]], [[-1.0]]], [[[1.0, 1.0, 1.0]]], [[[1.0], [1.0], [0.0]]],
    ...     [[[0, 0, 0], [0, 0, 0], [1, 0, 0]]], p,
    ...     inputs=["u", "a", "b"], outputs=["y", "v", "w"])
    >>> loops = uncertain(lag, [DynamicBlock("a", "v", 0.5), DynamicBlock("b", "w", 0.4)])
    >>> cert = synthesis.l2_gain(loops, search=None)  # 1.4/(2 - .5)
    >>> print(f"{cert.lower:.3f} <= gain <= {cert.gamma:.3f}")
    0.933 <= gain <= 0.933
    """
    if isinstance(model, UncertainStateSpace):
        wide, d, v, parts = opened(model.model, blocks)
        sized = wide.scaled(outputs=dict.fromkeys(model.perturbation_outputs, 1 / model.bound))
        d, v = (*model.perturbation_inputs, *d), (*model.perturbation_outputs, *v)
        whole, source = (*model.every_part, *parts), f"{model.source}; {source}"
        return UncertainStateSpace(sized, d, v, 1.0, model.probability, source, whole)
    wide, d, v, parts = opened(model, blocks)
    return UncertainStateSpace(wide, signals(d), signals(v), 1.0, 1.0, source, parts)


def opened(
    model: LPVStateSpace, blocks: Sequence[DynamicBlock]
) -> tuple[LPVStateSpace, list[Signal], list[Signal], tuple[DeltaPart, ...]]:
    """Return the model with each block of gain 1 and no weight, the inputs and outputs of all, and
    the parts of Delta; raise as `loop_of`.
    """
    if not isinstance(model, LPVStateSpace):
        raise InputError(f"model: expected an LPVStateSpace, got {type(model).__name__}")
    if not blocks:
        raise InputError("blocks: expected one or more")
    columns, rows = channels_of(model, blocks)
    d = [model.inputs[i] for i in chain(*columns)]
    v = [model.outputs[i] for i in chain(*rows)]
    parts = tuple(DeltaPart(len(a), len(b), True) for a, b in zip(columns, rows, strict=True))
    for block, own in zip(blocks, rows, strict=True):
        names = [str(model.outputs[i]) for i in own]
        weight = stable_weight(block, model.dt)
        if weight is not None:
            model = model.filtered_by(dict.fromkeys(names, weight))
        model = model.scaled(outputs=dict.fromkeys(names, 1 / block.bound))
    return model, d, v, parts
