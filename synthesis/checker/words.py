"""Claims and hypotheses in words, made from numbers."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from .reading import Model, Parameter


def gain(kind: str, bound: Fraction) -> str:
    """Return what a kind of certificate claims of a model."""
    size = repr(float(bound))
    return {
        "l2 gain": f"the energy gain is below {size}: |y|_2 < {size} |u|_2 from rest",
        "stability": "without inputs the state tends to zero from every start",
        "decay rate": f"without inputs |x(t)| <= c exp(-a t) |x(0)| for some c, a = {size} 1/s",
        "energy-to-peak gain": f"from rest |y(t)| < {size} |u|_2 at every t",
        "h2 gain": f"from rest, in white noise of unit intensity, E |y(t)|^2 < {size}^2 at every t",
    }[kind]


def sizes(states: int, inputs: int, outputs: int, dt: Fraction | None) -> str:
    """Return the sizes of a model."""
    time = "continuous time" if dt is None else f"samples of {float(dt)!r} s"
    return f"a model of {states} states x, {inputs} inputs u, {outputs} outputs y, in {time}"


def motion(parameters: Sequence[Parameter]) -> list[str]:
    """Return how parameters move, a sentence each."""
    said = []
    for i, p in enumerate(parameters):
        name, how = f"p{i + 1}", "moving arbitrarily fast"
        if p.tie is not None:
            how = f"d{name}/dt = p{p.tie + 1}"
        elif p.rate is not None:
            how = f"|d{name}/dt| <= {float(p.rate)!r} per second"
        said.append(f"{name} in [{float(p.low)!r}, {float(p.high)!r}], {how}")
    return said


def model(own: Model, moving: Sequence[Parameter]) -> list[str]:
    """Return of which model a claim is, and how its parameters move."""
    x, u, y = len(own.states), len(own.inputs), len(own.outputs)
    return [sizes(x, u, y, own.dt), *motion(moving)]
