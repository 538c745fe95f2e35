"""Blocks of a loop: static functions, delays, parameters, and multipliers of one's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv.linear_model import as_model
from symheli.values.arrays import Array
from synthesis.robust.multipliers.classes import (
    DynamicMultipliers,
    Filter,
    Lags,
    Multipliers,
    OwnMultipliers,
    ParameterMultipliers,
)
from synthesis.robust.multipliers.delays import SHAPES, DelayMultipliers
from synthesis.robust.multipliers.static import StaticMultipliers
from synthesis.robust.structure import DynamicBlock

RATES = 0.0, math.inf


@dataclass(frozen=True)
class StaticBlock:
    """d_i = phi(v_i), the same static function at each of the channels, phi(0) = 0.

    Parameters
    ----------
    inputs, outputs : sequence of str
        d and v, in pairs.
    sector : (float, float), optional
        (d - low v)(high v - d) >= 0.
    slope : (float, float), optional
        Slopes of phi between low and high; phi is constant in time then. One of both is given.
    odd : bool
        Whether phi(-v) = -phi(v), which allows more multipliers to slopes.
    constant : bool
        Whether phi is the same at all times.

    Raises
    ------
    InputError
        Neither or both of sector and slope, low >= high, or channels not in pairs.

    Examples
    --------
    >>> StaticBlock(["d"], ["v"], slope=(0.0, 1.0), odd=True).high
    1.0
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    sector: tuple[float, float] | None = None
    slope: tuple[float, float] | None = None
    odd: bool = False
    constant: bool = True

    def __post_init__(self) -> None:
        """Check the numbers."""
        _pairs(self)
        if (self.sector is None) == (self.slope is None):
            raise InputError("expected either sector=(low, high) or slope=(low, high)")
        _ascending(self._range, "the sector or slope")
        if self.slope is not None and not self.constant:
            raise InputError(
                "the multipliers of slopes are for a function that is constant in time: use"
                " sector= for one that is not"
            )

    @property
    def _range(self) -> tuple[float, float]:
        return self.slope or self.sector or (math.nan, math.nan)

    @property
    def low(self) -> float:
        """Least slope."""
        return float(self._range[0])

    @property
    def high(self) -> float:
        """Largest slope."""
        return float(self._range[1])

    def multipliers(self, lags: Lags, moving: bool) -> Multipliers:
        """Return the class; `moving`: v has a derivative, for Popov's term."""
        sloped = self.slope is not None
        own = lags if sloped else Lags((), 0)
        popov = moving and self.constant
        odd = self.odd and sloped
        return StaticMultipliers(
            len(self.inputs), self.low, self.high, sloped, odd, self.constant, popov, own
        )


@dataclass(frozen=True)
class DelayBlock:
    """A constant delay T of 0 to `longest` (s) acts on v, the same T in all channels.

    Parameters
    ----------
    inputs, outputs : sequence of str
        d and v, in pairs; no v may depend on d at the same instant.
    longest : float
        Longest delay, s.
    form : str
        d = v(t - T) - v(t), "difference"; v(t - T), "delay"; minus the integral of v over the last
        T, "window", (exp(-s T) - 1)/s.

    Raises
    ------
    InputError
        Another form, a delay that is not > 0, or channels not in pairs.

    Examples
    --------
    >>> DelayBlock(["d"], ["v"], 0.5, form="window").longest
    0.5
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    longest: float
    form: str = "difference"

    def __post_init__(self) -> None:
        """Check the numbers."""
        _pairs(self)
        if self.form not in SHAPES:
            raise InputError(f"form: expected one of {', '.join(SHAPES)}, got {self.form!r:.40}")
        if not 0 < self.longest < math.inf:
            raise InputError(f"longest: expected a delay > 0 s, got {self.longest!r:.40}")

    def multipliers(self, lags: Lags, moving: bool) -> Multipliers:
        """Return the class, of one pole."""
        return DelayMultipliers(len(self.inputs), float(self.longest), self.form, lags)


@dataclass(frozen=True)
class ParameterBlock:
    """d = delta v, a real number times each channel, from `low` to `high`.

    Parameters
    ----------
    inputs, outputs : sequence of str
        d and v, in pairs: copies of one parameter.
    low, high : float
        Its range.
    rate : float
        0 of a constant one, inf of one that moves in any way.

    Raises
    ------
    InputError
        low >= high, another rate, or channels not in pairs.

    Examples
    --------
    >>> ParameterBlock(["d"], ["v"], -1.0, 1.0).rate
    0.0
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    low: float
    high: float
    rate: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _pairs(self)
        _ascending((self.low, self.high), "low, high")
        if self.rate not in RATES:
            raise InputError(
                f"rate: expected 0 (constant) or inf (any motion), got {self.rate!r:.40}; of a"
                " bounded rate use l2_gain with rate="
            )

    def multipliers(self, lags: Lags, moving: bool) -> Multipliers:
        """Return the class."""
        own = Lags((), 0) if self.rate else lags
        return ParameterMultipliers(
            len(self.inputs), float(self.low), float(self.high), bool(self.rate), own
        )


@dataclass(frozen=True, eq=False)
class OwnMultiplier:
    """A block that is known by integral inequalities: for z = Psi (v, d), z(0) of a filter at rest,
    the sum over time of z' M z is >= 0 for each M, of all v and d of finite energy. The block is
    causal, of bounded gain, and its multiples from 0 to 1 have these inequalities too; for gains to
    a peak they hold over every finite time.

    Parameters
    ----------
    inputs, outputs : sequence of str
        d and v.
    filter : LinearModel
        Psi, stable, from (v, d) in the order of `outputs` and `inputs`, sampled as the model is.
    forms : sequence of array (nz, nz)
        The matrices M, symmetric; multipliers are their sums with weights >= 0.

    Raises
    ------
    InputError
        A filter that is not stable or of other sizes, or a form that is not symmetric.

    Examples
    --------
    |d| <= |v|, as a multiplier without a filter:

    >>> import numpy as np
    >>> from symheli import LinearModel
    >>> none = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), np.eye(2)
    >>> psi = LinearModel(*none, [], ["v", "d"], ["a", "b"])
    >>> len(OwnMultiplier(["d"], ["v"], psi, [np.diag([1.0, -1.0])]).forms)
    1
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    filter: LinearModel
    forms: Sequence[Array]

    def __post_init__(self) -> None:
        """Check shapes and stability."""
        own = as_model(self.filter)
        object.__setattr__(self, "filter", own)
        object.__setattr__(self, "inputs", _names(self.inputs))
        object.__setattr__(self, "outputs", _names(self.outputs))
        forms = tuple(np.array(M, float) for M in self.forms)
        object.__setattr__(self, "forms", forms)
        channels, nz = len(self.inputs) + len(self.outputs), len(own.C)
        if own.B.shape[1] != channels:
            raise InputError(
                f"filter: expected {channels} inputs, one for each of the channels v and d, got"
                f" {own.B.shape[1]}"
            )
        if not forms or any(M.shape != (nz, nz) or np.any(M != M.T) for M in forms):
            raise InputError(f"forms: expected symmetric matrices ({nz}, {nz}), at least one")

    def multipliers(self, lags: Lags, moving: bool) -> Multipliers:
        """Return the class."""
        own = self.filter
        return OwnMultipliers(
            len(self.inputs), Filter(own.A, own.B, own.C, own.D), tuple(self.forms), Lags((), 0)
        )


Block = StaticBlock | DelayBlock | ParameterBlock | OwnMultiplier | DynamicBlock


def multipliers_of(block: Block, lags: Lags, moving: bool) -> Multipliers:
    """Return the class of multipliers of a block."""
    if isinstance(block, DynamicBlock):
        if block.weight is not None:
            raise InputError(
                "the block has a weight: put the weight into the model, behind the block's outputs,"
                " and leave weight out"
            )
        if not isinstance(block.bound, Real) or not 0 <= block.bound < math.inf:
            raise InputError(f"bound: expected a finite number >= 0, got {block.bound!r:.40}")
        sizes = len(_names(block.inputs)), len(_names(block.outputs))
        return DynamicMultipliers(*sizes, float(block.bound), lags)
    return block.multipliers(lags, moving)


def _names(given: Sequence[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)


def _pairs(block: Any) -> None:
    """Keep names as tuples; raise `InputError` unless there is an output for each input."""
    for group in ("inputs", "outputs"):
        object.__setattr__(block, group, _names(getattr(block, group)))
    if not block.inputs or len(block.inputs) != len(block.outputs):
        raise InputError(
            f"expected an output for each input, at least one, got {len(block.inputs)} inputs and"
            f" {len(block.outputs)} outputs"
        )


def _ascending(pair: Any, name: str) -> None:
    try:
        low, high = map(float, pair)
    except (TypeError, ValueError):
        low = high = math.nan
    if not -math.inf < low < high < math.inf:
        raise InputError(f"{name}: expected two finite numbers low < high, got {pair!r:.60}")
