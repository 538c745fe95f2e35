"""Claims and hypotheses in words, made from numbers."""

from collections.abc import Sequence
from fractions import Fraction

from .reading import Parameter


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


def energy(bound: Fraction) -> str:
    """Return what a gain claims of energies."""
    return f"the energy of the outputs is at most {float(bound)!r}^2 times that of the inputs"


def model(x: int, u: int, y: int, dt: Fraction | None, moving: Sequence[Parameter]) -> list[str]:
    """Return of a model of which sizes a claim is, and how its parameters move."""
    time = "continuous time" if dt is None else f"samples of {float(dt)!r} s"
    said = [f"a model of {x} states x, {u} inputs u, {y} outputs y, in {time}"]
    for i, p in enumerate(moving):
        name, how = f"p{i + 1}", "moving arbitrarily fast"
        if p.tie is not None:
            how = f"d{name}/dt = p{p.tie + 1}"
        elif p.rate is not None:
            how = f"|d{name}/dt| <= {float(p.rate)!r} per second"
        said.append(f"{name} in [{float(p.low)!r}, {float(p.high)!r}], {how}")
    return said
