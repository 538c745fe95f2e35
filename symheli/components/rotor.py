"""What main and tail rotor share: disc geometry and profile power."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any


@dataclass(frozen=True)
class Disc:
    """A rotor disc: radius and chord (m), number of blades, speed Om (rad/s) in air of density rho (kg/m^3)."""

    radius: Any
    chord: Any
    blades: int
    Om: Any
    rho: Any

    @property
    def tip_speed(self) -> Any:
        """Om R, m/s."""
        return self.Om * self.radius

    @property
    def solidity(self) -> Any:
        """sigma = blades c/(pi R), dimensionless."""
        return self.blades * self.chord / (pi * self.radius)

    @property
    def force_scale(self) -> Any:
        """rho (Om R)^2 pi R^2, N: thrust = C_T times this."""
        return self.rho * self.tip_speed**2 * pi * self.radius**2


def profile_torque_coefficient(mu2: Any, profile_drag: Any, solidity: Any) -> Any:
    """(C_D0 sigma/8)(1 + 7/3 mu^2), dimensionless. Source: G15, main rotor torque."""
    return profile_drag * solidity / 8 * (1 + 7 / 3 * mu2)
