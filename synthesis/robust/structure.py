"""The loop of a model and its uncertain blocks, each normalised to one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from symheli import LFT, LinearModel, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv.lft.reduction import reduce_exactly
from symheli.lpv.lft_matrices import parts as slices
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal, indices
from synthesis.design.lti.weights import as_weight
from synthesis.design.plant import parts
from synthesis.numerics.linear.balance import balance
from synthesis.numerics.linear.norm import stable, to_continuous
from synthesis.numerics.polynomial.transfer import rationals
from synthesis.robust import covers
from synthesis.robust.exact_loop import ExactLoop, Part


class DynamicBlock(NamedTuple):
    """Unknown stable linear time-invariant dynamics from `outputs` of a model to its `inputs`, of
    gain at most `bound` at every frequency, in units of the inputs per unit of the outputs; or at
    most `bound` |W(j omega)| with a stable `weight` W of one input and output: a `LinearModel` or a
    system of python-control, continuous (a sampled model takes it by Tustin's rule) or sampled.

    Examples
    --------
    >>> DynamicBlock(["d"], ["v"], 0.5).bound
    0.5
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    bound: float = 1.0
    weight: Any = None

    @staticmethod
    def around(
        model: LPVStateSpace | UncertainStateSpace, blocks: Sequence[DynamicBlock], source: str
    ) -> UncertainStateSpace:
        """Return `synthesis.robust.uncertain`, for `UncertainStateSpace.of_blocks`."""
        from synthesis.robust.uncertain import uncertain

        return uncertain(model, blocks, source)

    @classmethod
    def of_delay(
        cls, inputs: Sequence[str], outputs: Sequence[str], longest: float
    ) -> DynamicBlock:
        """Return the block that makes `outputs` v late by any constant time up to `longest` (s)
        where the model adds d to v: v + d = v(t - T), 0 <= T <= longest.

        The weight is above |exp(-j omega T) - 1| at every frequency, by 2.1 % at most; it covers T
        < 0 too, so that a delay within `longest` of a nominal one is meant by the same block. A
        block of several channels covers a delay of its own in each. In a sampled model T is a
        number of samples.

        Raises `InputError` for a delay that is not > 0 and for numbers of channels that differ.

        References
        ----------
        Skogestad and Postlethwaite, Multivariable Feedback Control (2005), eq. 7.27.

        Examples
        --------
        An integrator with a gain of 1 rad/s bears pi/2 s of delay; whatever the phase of what has
        the size of the error of a delay, 1.4 s:

        >>> k = symheli.Scheduling("k", "rad/s", 1.0, 1.0 + 1e-9)
        >>> loop = symheli.LPVStateSpace.constant(
        ...     symheli.LinearModel([[-1.0]], [[-1.0]], [[1.0]], [[0.0]], ["x"], ["d"], ["v"]), k)
        >>> late = [DynamicBlock.of_delay("d", "v", T) for T in (1.4, 1.57)]
        >>> [bool(synthesis.robust.robust_margin(loop, [block]).lower > 1) for block in late]
        [True, False]
        """
        return cls(*_paired(inputs, outputs), 1.0, covers.delay_weight(longest))

    @classmethod
    def of_servo(
        cls,
        inputs: Sequence[str],
        outputs: Sequence[str],
        bandwidth: tuple[float, float],
        damping: tuple[float, float] | None = None,
        *,
        nominal: tuple[float, float] | float | None = None,
    ) -> DynamicBlock:
        """Return the block that turns the nominal servo of a model into any constant one of these
        ranges, where the model adds d to its command (or to its position) v.

        Without `damping` a servo is the lag b/(s + b), with it w^2/(s^2 + 2 z w s + w^2);
        `bandwidth` b or w in rad/s. `nominal`: that of the model, (bandwidth, damping), or the
        bandwidth alone; by default the middle of each range. The weight is shown to be above the
        relative error at all frequencies. As parameters of an LFT the same numbers cost less than
        as a block, and time.

        Raises `InputError` for ranges that are not 0 < low < high, and for numbers of channels that
        differ.

        Examples
        --------
        >>> slow = DynamicBlock.of_servo("d", "v", (30.0, 42.0))  # about 36/(s + 36)
        >>> size = abs(slow.weight.frequency_response([30.0]).item())  # of 30/(s + 30)
        >>> bool(np.isclose(size, abs((1 + 1j * 30 / 36) / (1 + 1j) - 1)))
        True
        """
        given = nominal if isinstance(nominal, Sequence) else (nominal, None)
        if len(given) != 2:
            raise InputError(f"nominal: expected (bandwidth, damping), got {nominal!r:.60}")
        own = covers.PositiveRange.of(bandwidth, given[0], "bandwidth")
        if damping is None:
            weight = covers.lag_weight(own)
        else:
            weight = covers.servo_weight(own, covers.PositiveRange.of(damping, given[1], "damping"))
        return cls(*_paired(inputs, outputs), 1.0, weight)


class BlockLoop(NamedTuple):
    """x' = A x + B w, z = C x + D w, w = Delta z with one block of norm <= 1 a part; the last part
    may be the performance. Sampled models stand as continuous ones of the same norms. `sizes` (nz,)
    of the outputs of full blocks in units of the model, `weights` of the blocks; `middles` and
    `radii` of the parameters, 0 of those that the model does not depend on. `exact` is the loop
    that is proven, of which the doubles are the nearest; None: nothing is proven of this one.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    parts: tuple[Part, ...]
    dt: float | None
    sizes: Array
    middles: Array
    radii: Array
    weights: tuple[LinearModel | None, ...] = ()
    exact: ExactLoop | None = None

    @property
    def in_rationals(self) -> ExactLoop:
        """The loop that is proven."""
        assert self.exact is not None  # noqa: S101 - `loop_of` makes it
        return self.exact

    @property
    def reals(self) -> int:
        """Number of real parts; they come first."""
        return sum(part.real for part in self.parts)

    def physical(self, delta: Array) -> float | tuple[float, ...]:
        """Return the parameters of normalised ones; of one a number."""
        p = self.middles.copy()
        p[self.radii > 0] += self.radii[self.radii > 0] * delta
        found = tuple(map(float, p))
        return found[0] if len(found) == 1 else found

    def unscaled(self, delta: Array, omega: float) -> Array:
        """Return full blocks (nw, nz), with their weights, at a frequency of the continuous model
        in units of the model.
        """
        by = self.sizes.astype(complex)
        for part, weight in zip((p for p in self.parts if not p.real), self.weights, strict=False):
            if weight is not None:
                first = len(self.C) - len(by)
                rows = slice(part.rows.start - first, part.rows.stop - first)
                at = self.frequency(omega)
                value = weight.D if math.isinf(at) else weight.frequency_response([at])
                by[rows] *= value.item()
        return delta * by

    def response(self, omega: float) -> Array:
        """Return the matrix from w to z at a frequency of the continuous model; inf: D."""
        return self.responses(np.array([omega]))[0]

    def responses(self, omega: Array) -> Array:
        """Return the matrices (K, nz, nw) at frequencies (K,)."""
        finite = np.where(np.isinf(omega), 0.0, omega)
        pencil = 1j * finite[:, None, None] * np.eye(len(self.A)) - self.A
        passed = self.C @ np.linalg.solve(
            pencil, np.broadcast_to(self.B, (len(omega), *self.B.shape))
        )
        return self.D + np.where(np.isinf(omega)[:, None, None], 0.0, passed)

    def frequency(self, omega: float) -> float:
        """Return the frequency of the model itself, rad/s."""
        return omega if self.dt is None else 2 * math.atan(omega) / self.dt

    def closed(self, delta: Array) -> BlockLoop:
        """Return the loop with its real parts at these values: those parts are gone."""
        real = [p for p in self.parts if p.real]
        n = real[-1].rows.stop if real else 0
        values = np.concatenate(
            [np.full(p.rows.stop - p.rows.start, v) for p, v in zip(real, delta, strict=True)]
            or [np.zeros(0)]
        )
        gain = values[:, None] * np.linalg.inv(np.eye(n) - self.D[:n, :n] * values)
        B, C, D = self.B, self.C, self.D
        rest = tuple(
            Part(_shifted(p.rows, n), _shifted(p.columns, n), False)
            for p in self.parts
            if not p.real
        )
        return BlockLoop(
            self.A + B[:, :n] @ gain @ C[:n],
            B[:, n:] + B[:, :n] @ gain @ D[:n, n:],
            C[n:] + D[n:, :n] @ gain @ C[:n],
            D[n:, n:] + D[n:, :n] @ gain @ D[:n, n:],
            rest,
            *self[5:-1],
        )

    def units(self, level: float, performance: bool) -> tuple[Array, Array]:
        """Return units (nz,) of z and (nw,) of w, powers of two, in which the level is about one,
        that of the last part alone where that is the performance, and the parts are balanced at the
        middle of the frequencies.
        """
        rows, columns = np.ones(len(self.C)), np.ones(self.B.shape[1])
        for part in self.parts[-1:] if performance else self.parts:
            rows[part.rows] /= level
        paces = self.paces
        omega = math.exp(np.log(paces).mean()) if len(paces) else 0.0
        M = self.response(omega) * rows[:, None]
        size = np.array(
            [[np.linalg.norm(M[a.rows, b.columns]) for b in self.parts] for a in self.parts]
        )
        d = balance(size, np.zeros((len(size), 1)), np.zeros((1, len(size))))
        for part, own in zip(self.parts, np.exp2(np.round(np.log2(d))), strict=True):
            rows[part.rows] /= own
            columns[part.columns] *= own
        return rows, columns

    @property
    def stable(self) -> bool:
        """Whether it is stable without its blocks."""
        return bool(stable(np.linalg.eigvals(self.A), None))

    @property
    def paces(self) -> Array:
        """Frequencies of the poles, > 0."""
        poles = np.abs(np.linalg.eigvals(self.A))
        return np.unique(poles[poles > 0])


def loop_of(
    model: LFT | LPVStateSpace, blocks: Sequence[DynamicBlock], performance: bool = False
) -> BlockLoop:
    """Return the loop of a model whose parameters are constant and whose channels are closed by
    these blocks; with the other channels as the last part where `performance` is asked.

    Raises `InputError` for another model, an LFT with a parameter that has no copies, a bound that
    is no finite number > 0, a signal of two blocks, or nothing uncertain; `UnknownNameError` for a
    signal that the model does not have.
    """
    if isinstance(model, LPVStateSpace):
        model = model.to_lft()
    elif isinstance(model, LFT):
        _check_copies(model)
    if not isinstance(model, LFT):
        raise InputError(
            f"model: expected an LFT, or an LPVStateSpace that is polynomial, got"
            f" {type(model).__name__}"
        )
    columns, rows = channels_of(model, blocks)
    into, out = list(chain(*columns)), list(chain(*rows))
    sizes = [b.bound for b, own in zip(blocks, rows, strict=True) for _ in own]
    weights = tuple(stable_weight(block, model.dt) for block in blocks)
    if performance:
        columns.append([i for i in range(len(model.inputs)) if i not in into])
        rows.append([i for i in range(len(model.outputs)) if i not in out])
        into, out = [*into, *columns[-1]], [*out, *rows[-1]]
        sizes += [1.0] * len(rows[-1])
        if not (columns[-1] and rows[-1]):
            raise InputError("a gain needs an input and an output that belong to no block")
    copies = reduce_exactly(model)
    n, x = sum(copies.sizes), len(model.states)
    if not (n or blocks):
        raise InputError("nothing is uncertain: the model has no parameter and there is no block")
    units = rationals(sizes).reshape(-1, 1)
    number = dict(zip(model.parameters, copies.sizes, strict=True))
    reach = rationals([_reach(s) for s, size in number.items() for _ in range(size)]).reshape(n, 1)
    M11, M12, M21, M22 = reach * copies.M11, reach * copies.M12, copies.M21, rationals(model.M22)
    B = np.hstack([M21[:x], M22[:x, x:][:, into]])
    C = np.vstack([M12[:, :x], units * M22[x:, :x][out]])
    D = np.block(
        [[M11, M12[:, x:][:, into]], [units * M21[x:][out], units * M22[x:, x:][np.ix_(out, into)]]]
    )
    real = [Part(part, part, True) for part in slices(copies.sizes) if part.stop > part.start]
    full = [
        Part(slice(n + a.start, n + a.stop), slice(n + b.start, n + b.stop), False)
        for a, b in zip(slices([*map(len, rows)]), slices([*map(len, columns)]), strict=True)
    ]
    every = [*([None] * n), *(w for w, own in zip(weights, rows, strict=False) for _ in own)]
    exact = ExactLoop(*behind(M22[:x, :x], B, C, D, every, model.dt), sampled=model.dt is not None)
    A, B, C, D = exact.rounded()
    if model.dt is not None:
        A, B, C, D = to_continuous(A, B, C, D)
    middles = np.array([s.middle for s, _ in model.blocks])
    radii = np.array([s.radius * (size > 0) for s, size in number.items()])
    whole, own = (*real, *full), units[:, 0].astype(float)
    return BlockLoop(A, B, C, D, whole, model.dt, own, middles, radii, weights, exact)


def _reach(s: Scheduling) -> Fraction:
    """Return the largest distance of the range from its middle as rounded, in radii as rounded."""
    low, high, middle = Fraction(s.low), Fraction(s.high), Fraction(s.middle)
    return max(high - middle, middle - low) / Fraction(s.radius)


def _check_copies(model: LFT) -> None:
    """Raise `InputError` for a parameter without copies: the LFT no longer says whether the model
    depends on it.
    """
    if none := [s.name for s, size in model.blocks if not size]:
        raise InputError(
            f"this LFT has no copies of {', '.join(none)}: nothing depends on it, or reduce() took"
            " what does for rounding, and the margin would be that of another model; give the LFT"
            " as it was before reduce() (or the LPVStateSpace), or make it without this parameter"
        )


def loop_at(unc: UncertainStateSpace, p: float) -> BlockLoop:
    """Return the loop of the parts of Delta around the model frozen at p."""
    block = unc.model.select(inputs=unc.perturbation_inputs, outputs=unc.perturbation_outputs)
    one = block.at(p)
    A, B, C, D = one.A, one.B, unc.bound * one.C, unc.bound * one.D
    if unc.dt is not None:
        A, B, C, D = to_continuous(A, B, C, D)
    full = tuple(Part(rows, columns, False) for columns, rows in unc.places)
    return BlockLoop(
        A, B, C, D, full, unc.dt, np.full(len(C), unc.bound), np.array([p]), np.zeros(1)
    )


def channels_of(
    model: LFT | LPVStateSpace, blocks: Sequence[DynamicBlock]
) -> tuple[list[list[int]], list[list[int]]]:
    """Return the positions of the inputs and of the outputs of each block in the model; raise as
    `loop_of` for those that are none.
    """
    columns, rows = [], []
    for each in blocks:
        if not isinstance(each, DynamicBlock) or not 0 < float(each.bound) < math.inf:
            raise InputError(
                "blocks: expected DynamicBlock(inputs, outputs, bound) with a finite bound > 0, got"
                f" {each!r:.80}"
            )
        columns.append(indices(names_of(each.inputs), model.inputs, "input"))
        rows.append(indices(names_of(each.outputs), model.outputs, "output"))
    for group in (columns, rows):
        if len({*chain(*group)}) < len(list(chain(*group))):
            raise InputError("blocks: an input or an output belongs to one block only")
    return columns, rows


def stable_weight(block: DynamicBlock, dt: float | None) -> LinearModel | None:
    """Return the weight of a block as a model of this sample period; None where it has none.

    Raises `InputError` for one that is not stable, or not of one input and output.
    """
    if block.weight is None:
        return None
    found = parts.weight(block.weight, ", ".join(names_of(block.outputs)), dt)
    if not isinstance(found, LinearModel) or (len(found.inputs), len(found.outputs)) != (1, 1):
        raise InputError("weight of a block: expected a LinearModel of one input and one output")
    if not (same_period(found.dt, dt) or not found.states) or not found.is_stable():
        raise InputError(
            "weight of a block: expected a stable one, continuous or sampled as the model is"
        )
    return found


def behind(
    A: Array, B: Array, C: Array, D: Array, weights: Sequence[LinearModel | None], dt: float | None
) -> tuple[Array, Array, Array, Array]:
    """Return a model whose first outputs pass these weights; of rationals without rounding."""
    every = [1.0 if w is None else w for w in [*weights, *[None] * (len(C) - len(weights))]]
    W = as_weight(every, "weight", [Signal(f"v{i}") for i in range(len(C))], dt)
    own = W.A, W.B, W.C, W.D
    if C.dtype == object:
        own = tuple(map(rationals, own))
    a, b, c, d = own
    return (
        np.block([[A, np.zeros((len(A), len(a)), dtype=C.dtype)], [b @ C, a]]),
        np.vstack([B, b @ D]),
        np.hstack([d @ C, c]),
        d @ D,
    )


def _paired(
    inputs: Sequence[str], outputs: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return as many inputs as outputs; raise `InputError` for other numbers."""
    d, v = tuple(names_of(inputs)), tuple(names_of(outputs))
    if len(d) != len(v):
        raise InputError(
            f"expected an output for each input, got {len(d)} inputs and {len(v)} outputs"
        )
    return d, v


def _shifted(part: slice, by: int) -> slice:
    return slice(part.start - by, part.stop - by)


def names_of(given: str | Sequence[str]) -> Sequence[str]:
    """Return the names of one signal or of several."""
    return (given,) if isinstance(given, str) else given
