"""Blocks in words, made from their numbers."""

from __future__ import annotations

from synthesis.robust.multipliers.boxes import BoxMultipliers
from synthesis.robust.multipliers.classes import (
    DynamicMultipliers,
    Multipliers,
    ParameterMultipliers,
)
from synthesis.robust.multipliers.delays import DelayMultipliers
from synthesis.robust.multipliers.loop import Wired
from synthesis.robust.multipliers.static import StaticMultipliers


def sentence(block: Wired, finite: bool) -> str:
    """Return what a block may be; `finite`: integrals are those over every finite time."""
    into = ", ".join(f"d{i + 1}" for i in block.inputs)
    out = ", ".join(f"v{i + 1}" for i in block.outputs)
    return f"{into} of {out}: {_said(block.kind, finite)}"


def _said(kind: Multipliers, finite: bool) -> str:
    match kind:
        case StaticMultipliers():
            shape = "odd " * kind.odd + "function"
            zero = ", zero at zero," if kind.sloped else ""
            bound = "slopes" if kind.sloped else "a sector"
            time = "" if kind.constant else ", which may depend on time"
            return f"one static {shape}{zero} of {bound} from {kind.low!r} to {kind.high!r}{time}"
        case ParameterMultipliers():
            moves = "moving in any way" if kind.moves else "constant"
            return f"a real number from {kind.low!r} to {kind.high!r}, {moves}"
        case BoxMultipliers():
            ends = zip(kind.lows, kind.highs, kind.copies, strict=True)
            each = (f"{a!r} to {b!r}" + f" ({n} times)" * (n > 1) for a, b, n in ends)
            return f"real numbers, moving in any way: {', '.join(each)}"
        case DynamicMultipliers():
            return f"stable linear time-invariant dynamics of gain <= {kind.bound!r}"
        case DelayMultipliers():
            what = {
                "difference": "v(t - T) - v(t)",
                "delay": "v(t - T)",
                "window": "minus the integral of v from t - T to t",
            }[kind.shape]
            return f"{what}, T constant, from 0 to {kind.longest!r} s"
    own = "a causal block of bounded gain with the integral inequalities of the filter and forms in"
    how = "over every finite time from rest" if finite else "which every smaller multiple has too"
    return f"{own} the file, {how}"
