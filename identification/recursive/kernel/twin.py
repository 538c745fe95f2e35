"""The kernel in NumPy: the operations of rls.c in the same order on the same memory, for where no
compiled one is installed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.design.determined import MIN_INFORMATION_RATIO, PRIOR, determined
from identification.recursive.kernel import configuration as at
from identification.recursive.kernel.configuration import (
    LANES,
    Factor,
    GroupLayout,
    KernelConfiguration,
)
from symheli.values.arrays import Array

LEARNT, DETERMINED, SATURATED, REFUSED = 1, 2, 4, 8
CONSTANT, VARIABLE, DIRECTIONAL = 0, 1, 2
ALONG, TRUSTED = 128, 512 * 512


@dataclass(frozen=True)
class Limits:
    """Numbers that depend on the precision, as in rls.c."""

    epsilon: Any
    prior: Any
    largest: Any
    tiny: Any

    @classmethod
    def of(cls, real: Any) -> Limits:
        """`real` is float or np.float32."""
        epsilon = real(np.finfo(real).eps)
        single = real is np.float32
        return cls(
            epsilon,
            real(PRIOR) * epsilon,
            real(1e15 if single else 1e145),
            real(1e-36 if single else 1e-290),
        )


class View:
    """The parts of one group in a state and its scratch, by the names they have in rls.c."""

    def __init__(self, layout: GroupLayout, state: Array, work: Array):
        self.n, self.m, self.wide, self.tall = (
            layout.n,
            layout.m,
            layout.triangle.wide,
            at.padded(layout.n),
        )
        self.outputs = slice(self.tall, self.tall + self.m)
        for memory, parts in ((state, layout.in_state), (work, layout.in_work)):
            for name, part in parts.items():
                setattr(self, name, memory[part])
        self.theta = self.theta.reshape(self.m, self.tall)
        self.blocks = [self.triangle[block].reshape(LANES, -1) for block in layout.triangle.blocks]
        self.rows = [row for block in self.blocks for row in block]

    header: Array
    triangle: Array
    d: Array
    theta: Array
    peak: Array
    energy: Array
    fed: Array
    recent: Array
    usual: Array
    power: Array
    drift: Array
    phi: Array
    x: Array
    s: Array
    gain: Array
    innovation: Array

    def fill_empty_rows(self) -> None:
        """They weigh 1, so that nothing divides by 0."""
        self.d[self.n : self.tall] = 1
        self.d[self.outputs.stop :] = 1


class Kernel:
    """NumPy twin of the compiled `Kernel`, made from a `KernelConfiguration`."""

    def __init__(self, configuration: KernelConfiguration):
        self._c = configuration
        self._real: Any = float if configuration.dtype is np.float64 else configuration.dtype
        real, (kind, *values) = self._real, configuration.arguments[-1]
        self._limits, self._kind = Limits.of(real), kind
        self._factor, self._lowest, self._recent, self._usual, self._quiet, self._floor = map(
            real, values
        )
        self._columns = [
            configuration.structure.regressors(layout.group) for layout in configuration.groups
        ]

    def sizes(self) -> tuple[int, int]:
        """Numbers in the state, numbers of scratch."""
        return self._c.sizes

    def start(self, state: Array, work: Array) -> None:
        """Nothing is known."""
        state[:] = 0
        work[:] = 0
        for layout in self._c.groups:
            view = View(layout, state, work)
            for i, row in enumerate(view.rows):
                row[i % LANES] = 1
            view.fill_empty_rows()

    def update(
        self, state: Array, work: Array, y: Array, u: Array, p: Any, f: Array | None = None
    ) -> int:
        """Take in one sample, with the functions f(p) where the configuration has no factors;
        returns the status bits.
        """
        if (f is None) != bool(self._c.factors) or not all(
            isinstance(v, np.ndarray) and v.dtype == np.float64 for v in (y, u)
        ):
            raise TypeError(
                "expected float64 arrays, and the functions only where the kernel does not know"
                " them"
            )
        if y.shape != (self._c.structure.ny,) or u.shape != (self._c.structure.nu,):
            raise ValueError("wrong number of outputs or inputs")
        parts = (y, u, np.atleast_1d(p)) if f is None else (y, u, np.atleast_1d(p), f)
        with np.errstate(all="ignore"):
            return self._update(state, work, np.concatenate(parts).astype(self._c.dtype))

    def absorb(self, state: Array, work: Array, phi: Array, y: Array) -> int:
        """Take in one regressor and the outputs it must explain; returns the status bits."""
        sizes = (phi, self._c.structure.n_regressors), (y, self._c.structure.ny)
        if not all(
            isinstance(v, np.ndarray) and v.dtype == np.float64 and v.shape == (n,)
            for v, n in sizes
        ):
            raise TypeError("expected float64 arrays, a number for each regressor and each output")
        with np.errstate(all="ignore"):
            return self._absorb(state, work, phi.astype(self._c.dtype), y.astype(self._c.dtype))

    def run(
        self,
        state: Array,
        work: Array,
        samples: Array,
        statuses: Array,
        innovations: Array | None,
        coefficients: Array | None,
    ) -> None:
        """Take in rows [y, u, p], or [y, u, p, f]; fills a row of each array for each."""
        ny, after = self._c.structure.ny, at.padded(self._c.structure.n_regressors)
        for k, sample in enumerate(samples):
            with np.errstate(all="ignore"):
                statuses[k] = self._update(state, work, sample.astype(self._c.dtype))
            if innovations is not None and statuses[k] & LEARNT:
                innovations[k] = work[after : after + ny]
            if coefficients is not None:
                coefficients[k] = theta(self._c, state)

    def _update(self, state: Array, work: Array, sample: Array) -> int:
        c, arx = self._c, self._c.structure
        p = sample[arx.ny + arx.nu :][: len(arx.parameters)]
        refused = bool((np.abs(sample) > self._limits.largest).any())
        refused = refused or any(
            is_outside(x, factor) for x, factor in zip(p, c.factors, strict=False)
        )
        if refused or np.isnan(sample).any():
            state[at.FILLED] = 0
            return self._status(state) | (REFUSED if refused else 0)
        past = state[c.past].reshape(-1, c.width)
        past[1:] = past[:-1].copy()
        past[0, : len(sample)] = sample
        if c.factors:
            past[0, len(sample) :] = self._functions(p)
        state[at.FILLED] = min(state[at.FILLED] + 1, len(past))
        if state[at.FILLED] < len(past):
            return self._status(state)
        return self._absorb(state, work, self._regressor(past), sample[: arx.ny])

    def _functions(self, p: Array) -> Array:
        out = np.ones(self._c.structure.basis.size, p.dtype)
        for x, factor, index in zip(p, self._c.factors, self._c.index.T, strict=True):
            out *= evaluate(factor, x)[index]
        return out

    def _regressor(self, past: Array) -> Array:
        arx = self._c.structure
        size, p = arx.basis.size, arx.ny + arx.nu
        out = np.empty((len(self._c.entries), size), past.dtype)
        for row, (kind, channel, lag, p_lag) in zip(out, self._c.entries.tolist(), strict=True):
            match at.KINDS[kind]:
                case "output":
                    signal = -past[lag, channel]
                case "input":
                    signal = past[lag, arx.ny + channel]
                case "offset":
                    signal = past.dtype.type(1)
                case "increment":
                    signal = past[0, p + channel] - past[lag, p + channel]
            row[:] = signal * past[p_lag, p + len(arx.parameters) :]
        return out.reshape(-1)

    def _absorb(self, state: Array, work: Array, phi: Array, y: Array) -> int:
        after = at.padded(self._c.structure.n_regressors)
        work[: len(phi)] = phi
        for layout, columns in zip(self._c.groups, self._columns, strict=True):
            view, outputs = View(layout, state, work), list(layout.group.outputs)
            view.phi[: layout.n] = phi[columns]
            self._learn(view, y[outputs])
            work[after : after + len(y)][outputs] = view.innovation[: layout.m]
        state[at.COUNT] += 1
        if state[at.COUNT] >= at.MILLION:
            state[at.COUNT] = 0
            state[at.MILLIONS] += 1
        return LEARNT | self._status(state)

    def _status(self, state: Array) -> int:
        bits = DETERMINED
        for layout in self._c.groups:
            header = state[layout.in_state["header"]]
            if header[at.DETERMINED] == 0:
                bits &= ~DETERMINED
            if is_full(header):
                bits |= SATURATED
        return bits

    def _learn(self, a: View, y: Array) -> None:
        n, real = a.n, self._real
        samples = self._wakefulness(n)
        turn, kept_awake = int(a.header[at.TURN]), bool(samples > self._limits.prior)
        self._replenish(a, samples, turn, kept_awake)
        self._new_peaks(a, samples, kept_awake)
        a.innovation[: a.m] = y - times(a.theta, a.phi)
        factor = self._forgetting_factor(a)
        kept = real(1) if self._kind == DIRECTIONAL else factor
        if factor < kept:
            self._forget_direction(a, factor)
            a.d[a.outputs] *= factor
        a.x[: a.tall], a.x[a.outputs], a.x[a.outputs.stop :] = a.phi, y, 0
        power = factor * a.power[: a.m] + y * y
        a.power[: a.m] = np.where(power < self._limits.tiny, real(0), power)
        self._sweep(a, 0, a.outputs.stop, kept, real(1))
        a.fill_empty_rows()
        a.energy[:] = a.energy * kept + a.phi * a.phi
        a.fed *= kept
        find_gain(a)
        self._correct(a)
        a.header[at.DETERMINED] = self._is_determined(a, kept_awake)
        a.header[at.WEIGHT] = factor * real(a.header[at.WEIGHT]) + real(1)
        a.header[at.FACTOR] = factor
        a.header[at.TURN] = (turn + 1) % n
        for i in range(turn, a.wide, n):
            self._drop_underflow(a, i)

    def _correct(self, a: View) -> None:
        lanes = (a.energy * (a.gain * a.gain)).reshape(-1, LANES).sum(axis=0)
        error = np.add.accumulate(lanes)[-1]
        a.header[at.SINCE] += 1
        innovation = a.innovation[: a.m]
        a.theta += innovation[:, None] * a.gain
        a.drift[: a.m] += error * (innovation * innovation)
        trusted = (a.header[at.SINCE] * a.drift[: a.m] <= TRUSTED * a.power[: a.m]).all()
        if not trusted or a.header[at.SINCE] >= ALONG:
            solve_anew(a)

    def _is_determined(self, a: View, kept_awake: bool) -> bool:
        beyond = (
            (0.0 if a.header[at.DETERMINED] != 0 else 2.0) if kept_awake else MIN_INFORMATION_RATIO
        )
        return bool(determined(a.d[: a.n], a.energy[: a.n], a.fed[: a.n], beyond).all())

    def _new_peaks(self, a: View, samples: Any, kept_awake: bool) -> None:
        largest = self._c.largest
        shape = -1, len(largest)
        phi, peak = np.abs(a.phi[: a.n]).reshape(shape), a.peak[: a.n].reshape(shape)
        signal = np.zeros(len(phi), phi.dtype)
        for k, size in enumerate(largest):
            signal = np.where(phi[:, k] > signal * size, phi[:, k] / size, signal)
        if not (phi > peak).any():
            return
        absent = ~(a.peak.dtype.type(samples) * (signal * signal) > self._limits.tiny)
        a.phi[: a.n].reshape(shape)[absent] = 0
        larger = ~absent & (signal * largest[0] > peak[:, 0])
        louder, fed = self._real(100 if kept_awake else 4), False
        for i in np.flatnonzero(larger).tolist():
            fresh, where = peak[i, 0] == 0, slice(i * len(largest), (i + 1) * len(largest))
            peak[i] = signal[i] * largest
            target = a.peak.dtype.type(samples) * (peak[i] * peak[i])
            if fresh:
                a.d[where] = a.energy[where] = a.fed[where] = target
                continue
            for k in np.flatnonzero(target > louder * a.fed[where]).tolist():
                self._feed(a, where.start + k, self._real(target[k]), a.outputs.stop)
                fed = True
        if fed:
            solve_anew(a)

    def _loudness(self, a: View) -> Any:
        known = a.peak > 0
        return self._real((np.abs(a.phi[known]) / a.peak[known]).max(initial=0))

    def _forgetting_factor(self, a: View) -> Any:
        real, one = self._real, self._real(1)
        if self._kind == DIRECTIONAL:
            return one if self._loudness(a) < self._quiet else self._factor
        if self._kind == CONSTANT or not self._is_settled(a):
            return self._factor
        steps = real(a.header[at.STEPS]) + one
        if steps * self._usual <= 2:
            a.header[at.STEPS] = steps
        recent = self._recent if steps * self._recent > 1 else one / steps
        usual = self._usual if steps * self._usual > 1 else one / steps
        ratio = real(0)
        for j in range(a.m):
            power = a.innovation[j] * a.innovation[j]
            a.recent[j] += recent * (power - a.recent[j])
            if a.usual[j] == 0:
                a.usual[j] = power
            a.usual[j] += usual * (min(power, 10 * a.usual[j]) - a.usual[j])
            a.usual[j] = min(a.usual[j], 4 * a.recent[j])
            ratio += real(a.recent[j] / a.usual[j]) if a.usual[j] > 0 else one
        factor = one - (one - self._factor) * (ratio / real(a.m))
        return min(max(factor, self._lowest), self._factor)

    def _is_settled(self, a: View) -> bool:
        weight = a.header[at.WEIGHT]
        many = weight >= 2 * a.n or 2 * weight * (1 - self._factor) >= 1
        return bool(a.header[at.STEPS] > 0 or (a.header[at.DETERMINED] != 0 and many))

    @property
    def _fastest(self) -> Any:
        """The fastest a coefficient forgets that nothing excites."""
        return {CONSTANT: self._factor, VARIABLE: self._lowest, DIRECTIONAL: self._real(1)}[
            self._kind
        ]

    def _wakefulness(self, n: int) -> Any:
        real = self._real
        if self._fastest == 1:
            return self._limits.prior
        return max(
            self._limits.prior, real(2) * self._floor / max(power(self._fastest, n), real(1e-12))
        )

    def _replenish(self, a: View, samples: Any, j: int, kept_awake: bool) -> None:
        real = self._real
        target = samples * real(a.peak[j] * a.peak[j])
        if real(2) * real(a.fed[j]) >= target:
            return
        if kept_awake:
            self._feed(a, j, target, a.n)
            for i in range(j, a.n):
                a.rows[i][a.outputs.start - i // LANES * LANES :][: a.m] -= a.s[i] * a.x[a.outputs]
        else:
            self._feed(a, j, target, a.outputs.stop)
            solve_anew(a)

    def _feed(self, a: View, j: int, target: Any, last: int) -> None:
        more = target - self._real(a.fed[j])
        a.x[:] = 0
        a.x[j] = 1
        self._sweep(a, j, last, self._real(1), more)
        a.energy[j] += more
        a.fed[j] = target

    def _sweep(self, a: View, first: int, last: int, kept: Any, value: Any) -> None:
        inverse = self._real(1) / value
        for start in range(first // LANES * LANES, last, LANES):
            block, x, here = a.blocks[start // LANES], a.x[start:], slice(start, start + LANES)
            rows = min(last - start, LANES)
            lead = np.zeros_like(x[:LANES])
            remaining = x[:LANES].copy()
            for i in range(rows):
                lead[i] = remaining[i]
                remaining -= lead[i] * block[i, :LANES]
            old = a.d[here] * kept
            ratio = lead / old
            total = running_sums(lead * ratio) + inverse
            if total[-1] <= 4 * inverse and (old > self._limits.tiny).all():
                over = self._real(1) / total
                a.s[here] = ratio * over
                a.d[here] = old + lead * (lead * np.append(value, over[:-1]))
                inverse, value = self._real(total[-1]), self._real(over[-1])
                for i in range(LANES):
                    x -= lead[i] * block[i]
                    block[i] += a.s[start + i] * x
            else:
                inverse, value = self._renew_rows(a, start, rows, kept, inverse, value)

    def _renew_rows(
        self, a: View, start: int, rows: int, kept: Any, inverse: Any, value: Any
    ) -> tuple[Any, Any]:
        real, tiny, one, x = self._real, self._limits.tiny, self._real(1), a.x[start:]
        for i, row in enumerate(a.blocks[start // LANES][:rows]):
            f, d, gain = real(x[i]), kept * real(a.d[start + i]), real(0)
            known = d > tiny
            ratio = f / d if known else real(0)
            total = inverse + f * ratio
            if f == 0 or (not known and abs(f) < tiny):
                a.d[start + i] = d
            elif known and total <= 4 * inverse:
                gain = ratio * (one / total)
                x -= f * row
                row += gain * x
                a.d[start + i], inverse = d + f * (f * value), total
            elif known:
                gain, keep = ratio * (one / total), inverse * (one / total)
                r, t = row.copy(), x.copy()
                x[:] = t - f * r
                row[:] = keep * r + gain * t
                row[i] = 1
                a.d[start + i], inverse = d + f * (f * value), total
            else:
                gain = one / f
                row[:] = gain * x
                x[:] = 0
                row[i] = 1
                a.d[start + i] = f * (f * value)
            value = one / inverse
            a.s[start + i] = gain
        return inverse, value

    def _forget_direction(self, a: View, factor: Any) -> None:
        real, n = self._real, a.n
        length2, one = real(0), real(1)
        for start, block in zip(range(0, a.tall, LANES), a.blocks, strict=False):
            a.s[start : start + LANES] = times(block[:, : a.tall - start], a.phi[start:])
        for d, v in zip(a.d[:n], a.s[:n], strict=True):
            length2 += real(d) * (real(v) * real(v))
        if not length2 > self._limits.tiny:
            return
        share, left = (one - factor) / length2, factor
        a.x[:] = 0
        for i in reversed(range(n)):
            row, x = a.rows[i], a.x[i // LANES * LANES :]
            v, d = real(a.s[i]), real(a.d[i])
            more = left + share * (d * (v * v))
            r, t = row.copy(), x.copy()
            row[:] = r - (share * v / left) * t
            x[:] = t + (d * v) * r
            a.d[i] = d * (left / more)
            left = more
        a.energy[:n] -= a.x.dtype.type(share) * (a.x[:n] * a.x[:n])

    def _drop_underflow(self, a: View, j: int) -> None:
        tiny = self._limits.tiny
        row = a.rows[j]
        row[np.abs(row) < tiny] = 0
        for part in (a.d, a.energy[: a.n], a.fed[: a.n]):
            if j < len(part) and part[j] < tiny:
                part[j] = 0


def is_outside(p: Any, factor: Factor) -> bool:
    """Whether p leaves the range of a factor by more than rounding."""
    slack = p.dtype.type(factor.slack)
    return bool(p < factor.knots[0] - slack or p > factor.knots[-1] + slack)


def evaluate(factor: Factor, p: Any) -> Array:
    """Return all functions of a factor at p, by Bernstein's form of the piece p lies in."""
    knots, coefficients = factor.knots, factor.bernstein
    piece = int(np.searchsorted(knots[1:-1], p, side="right"))
    x = (p - knots[piece]) / (knots[piece + 1] - knots[piece])
    degree, real = coefficients.shape[2] - 1, knots.dtype.type
    out, up = coefficients[piece, :, 0].copy(), real(1)
    for i in range(1, degree + 1):
        up = up * (x * (real(degree - i + 1) / real(i)))
        out = out * (real(1) - x) + up * coefficients[piece, :, i]
    return out


def running_sums(v: Array) -> Array:
    """Sums of LANES numbers, summed as in rls.c: neighbours first, then pairs, then fours."""
    for step in (1, 2, 4):
        v = v + np.append(np.zeros_like(v[:step]), v[:-step])
    return v


def times(rows: Array, b: Array) -> Array:
    """rows (k, n) times b (n,), summed as in rls.c: LANES partial sums from the last column on,
    then these in pairs.
    """
    s = (rows * b).reshape(len(rows), -1, LANES)[:, ::-1].sum(axis=1)
    s = s[:, :4] + s[:, 4:]
    s = s[:, :2] + s[:, 2:]
    return s[:, 0] + s[:, 1]


def find_gain(a: View) -> None:
    """gain <- triangle^-1 s"""
    for start in range(a.tall - LANES, -1, -LANES):
        block = a.blocks[start // LANES]
        g = a.gain[start : start + LANES]
        g[:] = a.s[start : start + LANES] - times(
            block[:, LANES : a.tall - start], a.gain[start + LANES :]
        )
        for i in range(LANES - 1, 0, -1):
            g[:i] -= block[:i, i] * g[i]


def is_full(header: Array) -> bool:
    """Whether an ordinary sample is lost to rounding."""
    return bool(header[at.WEIGHT] * np.finfo(header.dtype).eps >= 1)


def solve_anew(a: View) -> None:
    """theta <- R^-1 Z, unless the factor is full."""
    if is_full(a.header):
        return
    solution = np.array(
        [
            row[a.outputs.start - i // LANES * LANES :][: a.m]
            for i, row in enumerate(a.rows[: a.tall])
        ]
    )
    for k in range(a.tall - 1, 0, -1):
        for start in range(0, k, LANES):
            rows = min(k - start, LANES)
            solution[start : start + rows] -= (
                a.blocks[start // LANES][:rows, k - start, None] * solution[k]
            )
    a.theta[:] = solution.T
    a.drift[:] = 0
    a.header[at.SINCE] = 0


def power(base: Any, exponent: int) -> Any:
    """By repeated squaring."""
    result = type(base)(1)
    while exponent:
        if exponent % 2:
            result *= base
        base *= base
        exponent //= 2
    return result


def theta(c: KernelConfiguration, state: Array) -> Array:
    """Coefficients (n_regressors, ny) in a state, in its precision."""
    out = np.zeros((c.structure.n_regressors, c.structure.ny), state.dtype)
    for layout in c.groups:
        own = state[layout.in_state["theta"]].reshape(layout.m, -1)[:, : layout.n]
        out[c.structure.regressors(layout.group)[:, None], layout.group.outputs] = own.T
    return out
