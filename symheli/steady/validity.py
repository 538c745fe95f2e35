"""Validity range of the equations of the helicopter, and the warning outside it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cached_property

import numpy as np

from symheli.errors import ValidityWarning
from symheli.helicopter import DENSITY, Helicopter
from symheli.physics.inflow import vortex_ring
from symheli.values.arrays import Array
from symheli.values.caller import level_of_caller
from symheli.values.kinematics import GRAVITY
from symheli.values.signal import indices

ADVANCE_RATIO = 0.155
"""Largest speed in the plane of the disc by tip speed, V/(Om R). G15 states 0.15 and "about 20
m/s", which is 0.1546 at the 129.4 m/s of its rotor.
"""
REYNOLDS = 1e5
"""Least Reynolds number of the blade section at 3/4 radius in hover. Lift slope and drag are
constants here, those of a rotor of some size; the lower the number the more they change with it,
and below 1e5 conventional sections are worse than cambered plates: Winslow, Otsuka, Govindarajan
and Chopra (2018), Basic understanding of airfoil characteristics at low Reynolds numbers, Journal
of Aircraft, doi 10.2514/1.C034415.
"""
MACH = 0.73
"""Largest Mach number of the advancing tip. The sections are incompressible here; this is the
critical one of NACA 0012 without lift, by von Karman and Tsien from its largest velocity, 1.188 of
the stream: Abbott and von Doenhoff (1959), Theory of Wing Sections, ch. 5 and appendix I.
"""
DENSITIES = (0.3, 1.6)
"""kg/m^3: from that at 12.4 km, the height of the highest flight of a helicopter (1972), to that at
-50 degC at sea level.
"""
VISCOSITY, SOUND = 1.79e-5, 340.3
"""Viscosity and sound of air at 15 degC: Pa s, m/s."""

HEAD = "beyond what the equations of the helicopter are known to hold for:"
RING = (
    "momentum theory has no answer where a rotor moves into its own wake (Leishman 2006,"
    " section 2.13)"
)


class Validity:
    """Validity range of the equations of a helicopter, with parameters p (N or 1, n) as in
    `Helicopter.parameters`.
    """

    def __init__(self, heli: Helicopter, p: Array):
        self.heli, self.p = heli, p
        parts = heli.vehicle.components.items()
        self.rotors = [section for section, part in parts if part.kind == "main_rotor"]

    @classmethod
    def of(cls, heli: Helicopter) -> Validity:
        """Return the validity range for the helicopter's own parameters, cached with it."""
        if "_validity" not in heli.__dict__:
            heli.__dict__["_validity"] = cls(heli, heli.parameters.array[None])
        return heli.__dict__["_validity"]

    def value(self, section: str, entry: str) -> Array:
        """A parameter (N or 1,), SI."""
        return self._parameter(
            self.heli.vehicle.sections[section][entry].ref or f"{section}.{entry}"
        )

    def _parameter(self, name: str) -> Array:
        return self.p[:, indices([name], self.heli.parameters.signals, "parameter")[0]]

    @cached_property
    def density(self) -> Array:
        """Density of the air (N or 1,), kg/m^3."""
        return self._parameter(DENSITY)

    @cached_property
    def tip_speeds(self) -> Array:
        """Tip speeds of each main rotor (rotors, N or 1), m/s."""
        speed = self.value("drivetrain", "nominal_speed")
        return np.stack([speed * self.value(rotor, "radius") for rotor in self.rotors])

    @cached_property
    def _tip_speeds(self) -> tuple[Array, Array]:
        """Least and largest tip speeds of the main rotors (N or 1,), m/s."""
        return self.tip_speeds.min(axis=0), self.tip_speeds.max(axis=0)

    @cached_property
    def reynolds(self) -> Array:
        """Least of the main rotors (N or 1,), at 3/4 radius in hover."""
        chords = np.stack([self.value(rotor, "chord") for rotor in self.rotors])
        return (0.75 * self.density * self.tip_speeds * chords / VISCOSITY).min(axis=0)

    def in_vortex_ring(self, velocity: Array) -> Array:
        """Whether a main rotor that carries its share of the weight is in one (N, n), at these
        velocities through the air (N, n, 3), body axes, m/s.
        """
        inside = np.zeros(velocity.shape[:2], bool)
        for k in range(len(self.rotors)):
            u, v, w = np.moveaxis(velocity, 2, 0) / self.tip_speeds[k][:, None]
            inside |= vortex_ring(self._hover_inflow[k][:, None], u**2 + v**2, w) > 0
        return inside

    @cached_property
    def _hover_inflow(self) -> list[Array]:
        """Inflow ratio of each main rotor (N or 1,) that carries its share of the weight."""
        lift, out = self.value("body", "mass") * GRAVITY / len(self.rotors), []
        for rotor, tip_speed in zip(self.rotors, self.tip_speeds, strict=True):
            disc = np.pi * self.value(rotor, "radius") ** 2
            ct = lift / (self.density * tip_speed**2 * disc)
            out.append(np.sqrt(ct / (2 * self.value(rotor, "inflow_efficiency"))))
        return out

    @cached_property
    def harmless(self) -> tuple[float, float]:
        """Speed of any direction, and velocity downwards, m/s, below which no velocity through the
        air is too much.
        """
        if not self.rotors:
            return np.inf, np.inf
        slowest, fastest = self._tip_speeds
        inflow = zip(self._hover_inflow, self.tip_speeds, strict=True)
        return (
            float(min((ADVANCE_RATIO * slowest).min(), MACH * SOUND - fastest.max())),
            float(min((0.5 * hover * tip_speed).min() for hover, tip_speed in inflow)),
        )

    def beyond(self, where: Callable[[int], str], velocity: Array) -> list[str]:
        """Return a sentence for each limit that N points at these velocities through the air (N,
        3), body axes, m/s, exceed, each with the worst of them, `where(k)`.
        """
        return [*self._wherever_it_flies, *self._as_fast(where, velocity)]

    def in_hover(self) -> list[str]:
        """Return the limits exceeded at any speed: the helicopter is too small, too large, or the
        air too thin.
        """
        return self.beyond(lambda _: "in hover", np.zeros((1, 3)))

    @cached_property
    def _wherever_it_flies(self) -> list[str]:
        """Limits exceeded by its size and its air."""
        found, (least, most) = [], DENSITIES
        outside = (self.density < least) | (self.density > most)
        if outside.any():
            found.append(
                f"air of {self.density[outside.argmax()]:.3g} kg/m^3: helicopters have flown in"
                f" {least:g} to {most:g} kg/m^3 (1.225 at sea level)"
            )
        if self.rotors and (reynolds := self.reynolds.min()) < REYNOLDS:
            found.append(
                f"a Reynolds number of {reynolds:.2g} at 3/4 radius of the main rotor: lift slope"
                " and drag of the blade sections are constants here, and change with it below"
                f" {REYNOLDS:.0e} (Winslow et al. 2018)"
            )
        return found

    def _as_fast(self, where: Callable[[int], str], velocity: Array) -> list[str]:
        """Return the limits that these speeds exceed."""
        if not (self.rotors and len(velocity)):
            return []
        found, level = [], np.hypot(velocity[:, 0], velocity[:, 1])
        slowest, fastest = self._tip_speeds
        if (mu := level / slowest).max() > ADVANCE_RATIO:
            k = int(mu.argmax())
            tip_speed = slowest[k if len(slowest) > 1 else 0]
            found.append(
                f"an advance ratio of {mu[k]:.3g} {where(k)}{_many(mu > ADVANCE_RATIO)}: the model"
                f" is stated to hold to 0.15 (Gavrilets 2015), about"
                f" {ADVANCE_RATIO * tip_speed:.2g} m/s with this rotor"
            )
        if (mach := (fastest + level) / SOUND).max() > MACH:
            k = int(mach.argmax())
            found.append(
                f"a Mach number of {mach[k]:.3g} at the advancing tip {where(k)}"
                f"{_many(mach > MACH)}: the blade sections know no compressibility, which counts"
                f" from about {MACH:g} on (Abbott and von Doenhoff 1959)"
            )
        return found


def in_a_ring(where: Callable[[int], str], ring: Array) -> list[str]:
    """Return a sentence on the first of N points in a vortex ring, `where(k)`, as in
    `Validity.beyond`; `ring` (N,) marks them.
    """
    if not ring.any():
        return []
    return [f"a rotor in a vortex ring {where(int(ring.argmax()))}{_many(ring)}: {RING}"]


def warn(beyond: list[str]) -> None:
    """One `ValidityWarning` of everything that was found, where there is anything."""
    if beyond:
        warnings.warn("\n  ".join([HEAD, *beyond]), ValidityWarning, level_of_caller())


def _many(beyond: Array) -> str:
    """Return the number of points as text, where there are several."""
    return f" ({np.count_nonzero(beyond)} of {len(beyond)})" if len(beyond) > 1 else ""
