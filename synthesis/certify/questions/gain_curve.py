"""Gain of one loop against the permitted rate of its parameter, from frozen to arbitrarily fast:
upper bounds, lower bounds, and the gap.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from symheli.lazy import former_attribute
from symheli.values.html_table import as_table
from symheli.values.labelled import frame
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate import Certificate

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class GainCurve:
    """Gains of one loop over the rate bound of its scheduling parameter (0: frozen, inf: it may
    jump), as `gain_against_rate` finds them.

    Parameters
    ----------
    title : str
        Which loop.
    unit : str
        Of the gains.
    frozen : float
        Largest gain of the frozen models; inf: one is unstable.
    lower : mapping
        {rate: gain along a computed trajectory}, which no bound can undercut; inf: the state grows
        there.
    bounds : mapping
        {form of the proof: {rate: gain}}, the least conservative form first; inf: nothing proven.
    jumping : mapping
        {test: gain} of the proofs that let the parameter jump; inf: nothing proven.
    parameter, rate_unit : str
        Which parameter moves, and the unit of its rate.
    certificates : mapping
        {(form, rate): certificate} behind the numbers, where they are kept.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> curve = gain_against_rate(lag, [0.0, 0.5], search=None)
    >>> print(f"{curve.frozen:.3f} <= gain <= {curve.best[0.5]:.3f}")
    1.000 <= gain <= 1.000
    """

    title: str
    unit: str
    frozen: float
    lower: Mapping[float, float]
    bounds: Mapping[str, Mapping[float, float]]
    jumping: Mapping[str, float]
    parameter: str = "airspeed"
    rate_unit: str = "m/s^2"
    certificates: Mapping[tuple[str, float], Certificate] = field(default_factory=dict)

    proven = former_attribute("proven", "bounds")

    __repr__ = summarized
    _repr_html_ = as_table

    @classmethod
    def of(
        cls,
        found: Iterable[tuple[str, float, Certificate]],
        title: str = "",
        unit: str = "1",
        parameter: str = "airspeed",
        rate_unit: str = "m/s^2",
    ) -> GainCurve:
        """Return the curve of (form of the proof, permitted rate, certificate of the gain), at
        least one, the least conservative form first.
        """
        found = list(found)
        lower: dict[float, float] = {}
        proven: dict[str, dict[float, float]] = {}
        jumping: dict[str, float] = {}
        for form, rate, certificate in found:
            lower[rate] = max(certificate.lower, lower.get(rate, 0.0))
            gain = certificate.gamma if certificate.verified else math.inf
            if math.isinf(rate):
                jumping[form] = gain
            else:
                proven.setdefault(form, {})[rate] = gain
        certificates = {(form, rate): certificate for form, rate, certificate in found}
        frozen = found[0][2].frozen
        return cls(title, unit, frozen, lower, proven, jumping, parameter, rate_unit, certificates)

    @property
    def held(self) -> str:
        """The parameter held constant, in words: "an airspeed held"."""
        article = "an" if self.parameter[:1] in "aeiou" else "a"
        return f"{article} {self.parameter} held"

    @property
    def growing(self) -> float:
        """Least rate at which an unstable trajectory was found, inf without one."""
        return min(
            (rate for rate, gain in self.lower.items() if math.isinf(gain)), default=math.inf
        )

    @property
    def best(self) -> dict[float, float]:
        """Least gain proven at each rate, {rate: gain}: a proof for a larger rate holds for a
        smaller one.
        """
        every = [(rate, gain) for gains in self.bounds.values() for rate, gain in gains.items()]
        least = {
            rate: min(gain for r, gain in every if r >= rate)
            for rate in sorted({rate for rate, _ in every})
        }
        return {rate: gain for rate, gain in least.items() if math.isfinite(gain)}

    @property
    def fastest(self) -> tuple[float, float]:
        """Largest rate at which a gain is proven, and that gain; (nan, inf) without one."""
        return max(self.best.items(), default=(math.nan, math.inf))

    def verdict(self) -> str:
        """Summary of the curve, in one or two sentences."""
        if math.isinf(self.frozen):
            return f"the loop is unstable at {self.held}, so no gain can be proven."
        it = self.held.removesuffix(" held")
        proven = {test: gain for test, gain in self.jumping.items() if math.isfinite(gain)}
        if not proven:
            words = f"No test that lets the {self.parameter} jump proves anything"
            words += (
                f", and none can: {it} that jumps makes the state grow"
                if math.isinf(self.lower.get(math.inf, 0.0))
                else ""
            )
        else:
            test = min(proven, key=lambda name: proven[name])
            more = 100 * (proven[test] / self.frozen - 1)
            words = (
                f"{test} proves {proven[test]:.3g} for {it} that jumps, {more:.2g} % above"
                " the frozen gain"
            )
        rate, gain = self.fastest
        if math.isfinite(gain):
            words += (
                f". With a bounded rate the gain is proven up to {rate:g} {self.rate_unit}, there"
                f" {gain:.3g}"
            )
            words += (
                f" (attained {self.lower[rate]:.3g}, frozen {self.frozen:.3g})"
                if rate in self.lower
                else f" (frozen {self.frozen:.3g})"
            )
        if math.isfinite(self.growing):
            words += (
                f"; at {self.growing:g} {self.rate_unit} a computed history of {self.parameter}"
                " makes the state grow"
            )
        return words + "."

    def plot(
        self,
        ax: Axes | None = None,
        *,
        legend: Literal["upper left", "upper right"] = "upper left",
    ) -> Axes:
        """Gain against rate on logarithmic axes: frozen at the left edge, a parameter that jumps at
        the right; returns the axes.

        Shaded: orange between what is reached and what is proven, grey where neither a proof nor
        growth is known, red where the state grows along a computed trajectory.
        """
        from synthesis.certify.questions.gain_curve_plot import plot_gain_curve

        return plot_gain_curve(self, ax, legend=legend)

    def to_frame(self) -> pandas.DataFrame:
        """Over the rate: `lower`, `proven` (the least proven there or for a larger rate) and a
        column a form; units in attrs["units"], the frozen gain in attrs["frozen"]. Raises
        `InputError` without pandas.
        """
        forms = {**self.bounds, **{test: {math.inf: g} for test, g in self.jumping.items()}}
        rates = sorted({r for gains in (self.lower, *forms.values()) for r in gains})
        columns = {"lower": self.lower, "proven": self.best, **forms}
        made = frame(
            [(Signal("rate", self.rate_unit), np.array(rates))],
            [
                (Signal(name, self.unit), np.array([gains.get(r, math.nan) for r in rates]))
                for name, gains in columns.items()
            ],
        )
        made.attrs["frozen"] = self.frozen
        return made
