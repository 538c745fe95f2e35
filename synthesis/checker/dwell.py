"""Functions V = x' P_i(t) x of the modes of a switched model, t since mode i was entered.

P_i moves up to the dwell time T and is constant afterwards; x+ = J x as mode j follows mode i:

    P_i(T) > 0,  -(A'P + PA + dP/dt) > 0 up to T,  -(A'P + PA + 2 lambda P) > 0 afterwards,
    mu P_i(T) - J' P_j(0) J > 0

sampled P(k) - A'P(k+1)A > 0 and (1 - lambda) P - A'PA > 0. With mu = 1 every signal that stays at
least T in each mode is covered; with constant P every signal of an average dwell time above tau,
where exp(2 lambda tau) >= mu (sampled (1 - lambda)^(tau/dt) mu <= 1). A may move with p in any way.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from .demands import Claim, Demand, exponential
from .polynomials import Polynomial, bernstein_functions, combined, even, matrix, variable
from .reading import array, number, period, whole

DEGREE = 3
"""Degree of P on each segment of continuous time."""


class Switched(NamedTuple):
    """A of every mode on its pieces (polynomials of a unit box, with their numbers of variables),
    {(from, to): J}, the period; P of every mode by coefficients, lengths of the segments of time.
    """

    modes: Sequence[Sequence[tuple[Polynomial, int]]]
    jumps: Mapping[tuple[int, int], Polynomial]
    dt: Fraction | None
    P: Sequence[Sequence[Polynomial]]
    lengths: Sequence[Fraction]
    decay: Fraction
    growth: Fraction

    def demands(self) -> Iterator[Demand]:
        """Yield everything that must be positive definite."""
        for i, (pieces, P) in enumerate(zip(self.modes, self.P, strict=True)):
            yield Demand(f"V > 0 in mode {i + 1}", P[-1])
            for A, variables in pieces:
                for said, form, count in self._falling(A, variables, P):
                    yield Demand(f"V falls in mode {i + 1}{said}", form, variables=count)
        for (i, j), J in self.jumps.items():
            form = self.P[i][-1] * self.growth - J.T @ self.P[j][0] @ J
            yield Demand(f"V does not rise from mode {i + 1} to {j + 1}", form)

    def _falling(
        self, A: Polynomial, m: int, P: Sequence[Polynomial]
    ) -> Iterator[tuple[str, Polynomial, int]]:
        last = P[-1]
        if self.dt is not None:
            yield " afterwards", last * (1 - self.decay) - A.T @ last @ A, m
            for k in range(len(P) - 1):
                yield f" after {k} samples", P[k] - A.T @ P[k + 1] @ A, m
            return
        PA = last @ A
        yield " afterwards", -(PA + PA.T + last * (2 * self.decay)), m
        functions = bernstein_functions(DEGREE, variable(m))
        for k, length in enumerate(self.lengths):
            own = combined(functions, P[DEGREE * k : DEGREE * (k + 1) + 1])
            PA = own @ A
            yield f" in segment {k + 1}", -(PA + PA.T + own.derivative(m) * (1 / length)), m + 1

    @property
    def time(self) -> Fraction:
        """The dwell time that P takes, s."""
        return len(self.lengths) * self.dt if self.dt else sum(self.lengths, Fraction(0))

    def refused(self, seconds: Fraction, average: bool) -> str:
        """Say why a dwell time is not covered; nothing where it is."""
        segments, x = len(self.lengths), self.decay
        count = segments + 1 if self.dt else DEGREE * segments + 1
        if any(len(P) != count for P in self.P) or any(length <= 0 for length in self.lengths):
            return "the functions of the modes do not fit the segments of time"
        if not average:
            fits = seconds >= self.time and self.growth <= 1 and x >= 0
            return "" if fits else f"V rises at a switch, or takes {float(self.time)!r} s"
        # of x < 1, -ln(1 - x) is at least this part of its series
        series = sum((x**k / k for k in range(1, 40)), Fraction(0))
        rate = series / self.dt if self.dt else 2 * x
        fits = not segments and 0 <= x and (x < 1 or not self.dt)
        if not fits or exponential(rate * seconds)[0] < self.growth:
            return "V may rise more at a switch than it falls in the average dwell time"
        return ""


def _piece(value: Any) -> tuple[Polynomial, int]:
    """Return A(p) of a piece on the unit box, and the number of its parameters."""
    *own, n, _ = (whole(c, "a size", 1, 10**4) for c in value["coefficients"]["shape"])
    nested = array(value["coefficients"], "A", *own, n, n)

    def along(values: Any, axis: int) -> Polynomial:
        if axis == len(own):
            return matrix(values, n)
        functions = bernstein_functions(own[axis] - 1, variable(axis))
        return combined(functions, [along(each, axis + 1) for each in values])

    return along(nested, 0), len(own)


def claimed(content: Any) -> Claim:
    """Return what a file of a dwell time claims; the fields of the file are named here alone."""
    modes = [[_piece(each) for each in mode] for mode in content["modes"]]
    seconds, count, n = number(content["seconds"], "the time"), len(modes), modes[0][0][0].shape[0]
    jumps = {}
    for *pair, J in content["jumps"]:
        i, j = (whole(k, "a mode", 0, count - 1) for k in pair)
        jumps[i, j] = matrix(array(J, "a jump", n, n), n)
    P = [[even(M) for M in array(each, "P", None, n, n)] for each in content["P"]]
    lengths = array(content["lengths"], "the lengths", None)
    decay, growth = (number(content[name], name) for name in ("decay", "growth"))
    own = Switched(modes, jumps, period(content["dt"]), P, lengths, decay, growth)
    average, size = content["average"] is True, repr(math.nextafter(float(seconds), math.inf))
    every = f"average dwell time is above {size} s" if average else f"modes last at least {size} s"
    claim = f"the state tends to zero exponentially for every signal whose {every}"
    switches = ", ".join(f"{i + 1} to {j + 1}" for i, j in jumps)
    said = [f"a switched model of {count} modes, switches from mode {switches}"]
    return Claim(claim, said, own.demands(), refused=own.refused(seconds, average))
