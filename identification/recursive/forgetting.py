"""Forgetting rules of a recursive estimator: it follows changes, without wind-up when excitation is
missing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError

MIN_INFORMATION = 1e-3
"""Least information kept on each coefficient, in samples with its regressor at its largest."""


@dataclass(frozen=True)
class Constant:
    """Exponential forgetting: a sample k steps old has the weight factor^k.

    Parameters
    ----------
    factor : float
        In (0, 1]; 1 forgets nothing.
    floor : float
        Keeps the filter awake when excitation stops: the information on a coefficient never falls
        below that of `floor` samples with its regressor at its largest. It is fed in coefficient by
        coefficient, as a measurement saying "as it is now", which moves no coefficient, and from
        the first sample on, so that a cold start makes none wild; 0 turns it off. With factor 1
        there is nothing to make up for, and the floor is that of rounding, 32 eps samples. At the
        floor the gain is large: noise of a fraction r of the largest regressors moves the
        coefficients within floor / r^2 samples.

    Raises
    ------
    InputError
        A number out of range.

    Examples
    --------
    >>> rls = idn.RecursiveLeastSquares(arx, idn.forgetting.Constant(0.99, floor=0.01))
    >>> print(rls.run(record).model.coefficients.at(0.0).A.round(1))
    [[[-0.5]]]
    """

    factor: float = 1.0
    floor: float = MIN_INFORMATION

    def __post_init__(self) -> None:
        if not 0 < self.factor <= 1:
            raise InputError(
                f"forgetting: expected a factor in (0, 1], got {self.factor!r}; 0.99 forgets within"
                " 100 samples"
            )
        check_floor(self.floor)


@dataclass(frozen=True)
class Variable:
    """Variable forgetting: the memory length lies between two limits, and shortens when the
    innovations exceed their usual size.

    The factor is 1 - q / longest, q the power of the innovations over the last `recent` samples
    against that over the last `usual` (mean over the outputs of a group), held between the two
    memories: what came before a jump of the plant that multiplies the power by q is forgotten
    within longest / q samples, and no faster than `shortest`. In steady noise it is as steady as
    the longest memory (7 % worse at most over 21 plants and noises); a jump hardly seen above the
    noise is followed hardly faster than by it. Louder noise and outliers shorten the memory as a
    jump does.

    Parameters
    ----------
    longest, shortest : float
        The memories, samples.
    recent, usual : float
        The windows over which innovations are compared, samples.
    floor : float
        As for `Constant`.

    Raises
    ------
    InputError
        A number out of range.

    References
    ----------
    Fortescue, Kershenbaum and Ydstie (1981), Implementation of self-tuning regulators with variable
    forgetting factors, Automatica 17; powers estimated from the innovations as in Paleologu,
    Benesty and Ciochina (2008), A robust variable forgetting factor recursive least-squares
    algorithm for system identification, IEEE Signal Processing Letters 15.

    Examples
    --------
    >>> rls = idn.RecursiveLeastSquares(arx, idn.forgetting.Variable(longest=500, shortest=50))
    >>> print(rls.run(record).model.coefficients.at(0.0).A.round(1))
    [[[-0.5]]]
    """

    longest: float = 1000.0
    shortest: float = 50.0
    recent: float = 20.0
    usual: float = 1000.0
    floor: float = MIN_INFORMATION

    def __post_init__(self) -> None:
        for name in ("longest", "shortest", "recent", "usual"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 1):
                raise InputError(f"{name}: expected a number of samples > 1, got {value!r}")
        if self.shortest > self.longest or self.recent > self.usual:
            raise InputError(
                f"expected shortest <= longest and recent <= usual, got {self.shortest} and"
                f" {self.longest}, {self.recent} and {self.usual}"
            )
        check_floor(self.floor)


@dataclass(frozen=True)
class Directional:
    """Directional forgetting: the information along each new regressor is multiplied by a factor
    before it is added; all other directions keep theirs.

    What is not excited is not forgotten, so that nothing winds up. With n regressors about n / (1 -
    factor) samples are remembered in directions that are excited alike, more in weaker ones: a jump
    of the plant is followed more slowly there.

    Parameters
    ----------
    factor : float
        In (0, 1].
    quiet : float
        In [0, 1): a sample whose regressors all stay below this fraction of their largest so far
        forgets nothing: noise does not wash out what flight has taught (a constant regressor, such
        as an offset, is never quiet).

    Raises
    ------
    InputError
        A number out of range.

    References
    ----------
    Cao and Schwartz (2000), A directional forgetting algorithm based on the decomposition of the
    information matrix, Automatica 36; the threshold as in Lai and Bernstein (2024), SIFt-RLS:
    subspace of information forgetting recursive least squares.

    Examples
    --------
    >>> rls = idn.RecursiveLeastSquares(arx, idn.forgetting.Directional(0.98))
    >>> print(rls.run(record).model.coefficients.at(0.0).A.round(1))
    [[[-0.5]]]
    """

    factor: float = 0.95
    quiet: float = 0.01

    def __post_init__(self) -> None:
        if not 0 < self.factor <= 1:
            raise InputError(f"forgetting: expected a factor in (0, 1], got {self.factor!r}")
        if not 0 <= self.quiet < 1:
            raise InputError(f"quiet: expected a fraction in [0, 1), got {self.quiet!r}")


Forgetting = Constant | Variable | Directional


def forgetting_of(value: float | Forgetting, floor: float | None = None) -> Forgetting:
    """A way of forgetting, or the `Constant` of a factor and a floor (None: the usual one).

    Raises `InputError` for anything else, and for a floor beside a way of forgetting.
    """
    if isinstance(value, Constant | Variable | Directional):
        if floor is not None:
            raise InputError(
                f"floor: belongs to a forgetting factor; give it to {type(value).__name__} instead"
            )
        return value
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating):
        raise InputError(
            f"forgetting: expected a factor, Constant, Variable or Directional, got {value!r}"
        )
    return Constant(float(value), MIN_INFORMATION if floor is None else floor)


def check_floor(floor: float) -> None:
    """Raises `InputError` unless finite and >= 0."""
    if not (math.isfinite(floor) and floor >= 0):
        raise InputError(f"floor: expected a number of samples >= 0, got {floor!r}")


def numbers(forgetting: Forgetting) -> tuple[int, float, float, float, float, float, float]:
    """(kind, factor, lowest, recent, usual, quiet, floor) as the kernel takes them; see rls.h."""
    match forgetting:
        case Constant(factor, floor):
            return 0, factor, factor, 0.0, 0.0, 0.0, floor
        case Variable(longest, shortest, recent, usual, floor):
            return 1, 1 - 1 / longest, 1 - 1 / shortest, 1 / recent, 1 / usual, 0.0, floor
        case Directional(factor, quiet):
            return 2, factor, factor, 0.0, 0.0, quiet, 0.0
