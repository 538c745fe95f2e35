"""The numbers that prove a gain to the peak of the outputs, and their exact check.

With V = x'P x, forms s'M s of multipliers that are nonnegative at every instant, or summed over
every finite time, a decay r and numbers a, b: for all (x, w) other than zero

    dV/dt + r V + s'M1 s - a |f|^2 < 0,    |y|^2 - V + s'M2 s - b |f|^2 < 0

(sampled: V(k+1) - V(k)). Peak to peak V <= a/r |f|^2 at most, so that the gain squared is a/r + b;
energy to peak r = 0 and it is the larger of a and b, where forms that are summed over time have an
M1 - M2 of their class, too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.numerics.polynomial.exact import positive_definite
from synthesis.robust.multipliers import inequality
from synthesis.robust.multipliers.loop import Extended, Plant, Wired, extended, fractions
from synthesis.robust.multipliers.proof import fault_of_channels, read, written

ENERGY, PEAK = "energy to peak", "peak to peak"
KIND = "multiplier peak gain"


class PeakProof(NamedTuple):
    """A model with its blocks, P, coefficients of the multipliers of both inequalities, the decay r
    (1/s; sampled: the part of V that is lost in a period), a and b, for one gain.
    """

    plant: Plant
    dt: float | None
    blocks: tuple[Wired, ...]
    P: Array
    coefficients: tuple[Array, ...]
    at_peak: tuple[Array, ...]
    kind: str
    decay: float
    shares: tuple[float, float]
    gain: float

    def fault(self) -> str:
        """Return why nothing is proven; empty where the gain is, in exact arithmetic."""
        return self.fault_of_blocks() or self._fault_of_numbers() or self._fault_of_inequalities()

    def fault_of_blocks(self) -> str:
        """Return why the blocks, this loop and this kind of gain do not fit; empty where they
        do.
        """
        plant = self.plant
        if any(not (b.kind.pointwise or b.kind.summed) for b in self.blocks):
            return "a multiplier says nothing of finite times: of delays and slopes ask an L2 gain"
        wrong = fault_of_channels(plant, self.blocks)
        if wrong:
            return wrong
        if not plant.sampled and any(not b.kind.pointwise for b in self.blocks):
            return (
                "in continuous time a peak takes parameters and functions in a sector: what is"
                " known of energies alone says nothing of an instant"
            )
        if self.kind == PEAK and any(not b.kind.pointwise for b in self.blocks):
            return (
                "peak to peak takes parameters and functions in a sector: what is known of energies"
                " alone says nothing of peaks"
            )
        if self.kind == ENERGY and not plant.sampled:
            rows = [*plant.out, *(j for b in self.blocks for j in b.outputs)]
            if np.any(plant.D[np.ix_(rows, list(plant.into))]):
                return (
                    "in continuous time a peak has no bound where an input reaches an output at"
                    " the same instant: put a lag between"
                )
        return ""

    def _fault_of_numbers(self) -> str:
        a, b = self.shares
        numbers = (*self.shares, self.decay, self.gain)
        if not all(math.isfinite(v) and v >= 0 for v in numbers) or np.any(self.P != self.P.T):
            return "P is not symmetric, or a number below zero"
        most = Fraction(self.gain) ** 2
        if self.kind == ENERGY:
            good = self.decay == 0 and max(Fraction(a), Fraction(b)) <= most
        else:
            good = self.decay > 0 and not (self.plant.sampled and self.decay > 1)
            good = good and Fraction(a) / Fraction(self.decay) + Fraction(b) <= most
        return "" if good else "the numbers of both inequalities do not give this gain"

    def _fault_of_inequalities(self) -> str:
        first, second = ([fractions(c) for c in own] for own in (self.coefficients, self.at_peak))
        for (kind, _, _), c, at in zip(self.blocks, first, second, strict=True):
            each = [c, at] if kind.pointwise else [c, at, c - at]
            wrong = next((w for w in map(kind.fault_of, each) if w), "")
            if wrong:
                return wrong
        loop = extended(self.plant.exact(), self.blocks, Fraction)
        for F, name in zip(
            self.sides(loop, first, second, Fraction), ("V", "the peak"), strict=True
        ):
            if not positive_definite(-F):
                return f"the inequality of {name} does not hold"
        return ""

    def sides(self, loop: Extended, first: Any, second: Any, number: Any) -> tuple[Array, Array]:
        """Return the matrices of both inequalities, in doubles or rationals."""
        n = len(loop.A)
        P = np.asarray(self.P) if number is float else fractions(self.P)
        forms = [
            [k.form(c, number) for (k, _, _), c in zip(self.blocks, own, strict=True)]
            for own in (first, second)
        ]
        out, enters = inequality.energy(loop, self.plant.into)
        a, b = map(number, self.shares)
        V = inequality.motion(loop, P, self.plant.sampled)
        V[:n, :n] = V[:n, :n] + number(self.decay) * P
        V = V + inequality.supplied(loop, forms[0]) - a * enters
        top = out + inequality.supplied(loop, forms[1]) - b * enters
        top[:n, :n] = top[:n, :n] - P
        if self.kind == ENERGY and not self.plant.sampled:
            kept = [i for i in range(len(top)) if i - n not in set(self.plant.into)]
            top = top[np.ix_(kept, kept)]
        return V, top

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file."""
        return {
            **written(self),
            "measure": self.kind,
            "decay": self.decay,
            "shares": list(map(float, self.shares)),
            "at_peak": [encoded(np.asarray(c, float)) for c in self.at_peak],
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> PeakProof:
        """Return the proof of a file; raise `InputError` for shapes that do not fit."""
        plant, dt, blocks, P, coefficients, gain = read(content)
        sizes = [b.kind.count for b in blocks]
        at = tuple(
            frozen(decoded(c), "coefficients", (n,))
            for c, n in zip(content["at_peak"], sizes, strict=True)
        )
        if content["measure"] not in (ENERGY, PEAK):
            raise InputError(f"measure: expected a peak gain, got {content['measure']!r:.40}")
        a, b = (float(v) for v in content["shares"])
        own = content["measure"], float(content["decay"]), (a, b), gain
        return cls(plant, dt, blocks, P, coefficients, at, *own)
