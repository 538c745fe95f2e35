"""First analysis of a helicopter: hover, trims, open-loop stability, and the margins of a simple
loop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from studies.loops.lateral import HOLD
from studies.loops.margins import ACTUATION, AtAirspeed, over_airspeed
from studies.setup.axes import LATERAL, LONGITUDINAL
from studies.setup.axis_models import RATES, rotor_mode
from symheli import LinearFamily
from symheli.errors import InputError
from symheli.steady import TrimPoint

POINTS = 5
"""Airspeeds that are shown, evenly over the range."""
STILL = 1e-6
"""1/s: a mode that grows less is an integration."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AtSpeed:
    """One airspeed: the trim, the least stable pole (rad/s), the rotor modes (rad/s) by name, and
    margins and bandwidths; None where the model has no such axis.
    """

    trim: TrimPoint
    least_stable: complex
    modes: dict[str, complex]
    margins: AtAirspeed | None


@dataclass(frozen=True, kw_only=True, eq=False)
class FirstLook:
    """The airspeeds that are shown, and of all linearized ones where a control is at its stop."""

    shown: tuple[AtSpeed, ...]
    stopped: dict[float, tuple[str, ...]]
    travel: dict[str, float]

    @property
    def hovers(self) -> bool:
        """Whether it trims at the lowest airspeed within the travel of its controls."""
        return self.shown[0].trim.attainable

    @property
    def answer(self) -> str:
        """Hover, trims and stability in a sentence."""
        low, high = (self.shown[k].trim.airspeed for k in (0, -1))
        first = "hovers" if low == 0 else f"trims at {low:g} m/s"
        if not self.hovers:
            first = f"cannot {'hover' if low == 0 else 'be trimmed'} within its controls"
        beyond = [speed for speed in self.stopped if speed > low]
        trims = (
            f"trims to {high:g} m/s within the travel of its controls"
            if not beyond
            else f"needs more than the travel of its controls at {_speeds(beyond)}"
        )
        growing = [one for one in self.shown if one.least_stable.real > STILL]
        alone = (
            "by itself it is unstable"
            f" {_where(len(growing), len(self.shown))} (doubling in"
            f" {math.log(2) / max(one.least_stable.real for one in growing):.2g} s at worst)"
            if growing
            else "by itself it is stable at the airspeeds looked at"
        )
        return f"It {first} and {trims}; {alone}."

    def sentences(self) -> Iterator[str]:
        """Controls in hover, the rotor, margins."""
        hover = self.shown[0]
        used = ", ".join(
            f"{u} {math.degrees(hover.trim.u[u]):.1f} of {math.degrees(self.travel[u]):.1f} deg"
            for u in ("d_col", "d_ped")
        )
        attitude = ", ".join(
            f"{word} {math.degrees(hover.trim.x[s]):.1f} deg"
            for word, s in (("bank", "phi"), ("pitch", "theta"))
        )
        yield f"In hover: {used}; {attitude}."
        yield (
            "Roll and pitch with the rotor: "
            + "; ".join(f"{name} {_mode(z)}" for name, z in reversed(hover.modes.items()))
            + "."
        )
        held = [one for one in self.shown if one.margins is not None]
        if not held:
            return
        loops = [one.margins.hold for one in held if one.margins is not None]
        late = f"{1000 * ACTUATION.delay:g} ms"
        loop = f"A simple roll hold, d_lat = {HOLD:g} phi behind servo and {late},"
        unstable = [
            one.trim.airspeed
            for one, margins in zip(held, loops, strict=True)
            if not margins.stable
        ]
        if unstable:
            yield f"{loop} is unstable at {_speeds(unstable)}."
        else:
            yield (
                f"{loop} stands a gain {min(m.gain[1] for m in loops):.2g} times as large,"
                f" {math.degrees(min(m.phase for m in loops)):.0f} deg of lag or"
                f" {1000 * min(m.delay for m in loops):.0f} ms more, each alone."
            )


def first_look(family: LinearFamily, travel: dict[str, float]) -> FirstLook:
    """Return the first analysis of linear models along airspeed with their trims, and the travel of
    each control, rad.
    """
    trims = family.known_trims("the first look")
    at = np.unique(np.linspace(0, len(family) - 1, POINTS).round().astype(int))
    shown = []
    for k in at:
        model = family[int(k)]
        poles = model.poles()
        slow = max(map(complex, poles), key=lambda z: z.real)
        shown.append(
            AtSpeed(
                trim=trims[k],  # type: ignore[arg-type]
                least_stable=complex(slow.real, abs(slow.imag)),
                modes={name: rotor_mode(model, name) for name in RATES},
                margins=_margins(family, int(k)),
            )
        )
    stopped = {
        float(t.airspeed): t.on_stops  # type: ignore[union-attr]
        for t in trims
        if not t.attainable  # type: ignore[union-attr]
    }
    return FirstLook(shown=tuple(shown), stopped=stopped, travel=travel)


def _margins(family: LinearFamily, k: int) -> AtAirspeed | None:
    speed = float(family.airspeeds[k])
    try:
        parts = [[family[k].select(one.states, one.inputs)] for one in (LATERAL, LONGITUDINAL)]
        (found,) = over_airspeed([speed], *parts)
    except (InputError, ValueError):
        return None
    return found


def _mode(z: complex) -> str:
    if z.imag:
        return f"{abs(z):.1f} rad/s, damping ratio {-z.real / abs(z):.2f}"
    return f"{-z.real:.1f} 1/s, without oscillation"


def _speeds(speeds: Sequence[float]) -> str:
    if len(speeds) == 1:
        return f"{speeds[0]:g} m/s"
    return f"{min(speeds):g} to {max(speeds):g} m/s"


def _where(some: int, every: int) -> str:
    return "at every airspeed looked at" if some == every else f"at {some} of {every} airspeeds"
