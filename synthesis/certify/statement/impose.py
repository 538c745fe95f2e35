"""The relaxations with which a user can impose an inequality for every p of a range;
docs/relaxations.md describes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from symheli.errors import InputError

MARGINS = (1e-6, 1e-4)
"""Margins tried in turn: state blocks are held below -margin I in scaled coordinates."""
FLOOR = 1e-6
"""P is held above floor I in scaled coordinates."""


@dataclass(frozen=True, kw_only=True)
class _Strictly:
    """Margins of the inequalities: see `Bernstein`."""

    margins: tuple[float, ...] | None = None
    floor: float | None = None

    found_by: ClassVar[str]

    def __post_init__(self) -> None:
        if self.margins is not None and not (self.margins and min(self.margins) >= 0):
            raise InputError(f"margins must be numbers >= 0, got {self.margins!r}")
        if self.floor is not None and not self.floor >= 0:
            raise InputError(f"floor must be >= 0, got {self.floor!r}")

    @property
    def tried(self) -> tuple[float, ...]:
        """The margins, or their defaults."""
        return MARGINS if self.margins is None else self.margins

    @property
    def least(self) -> float:
        """The floor, or its default."""
        return FLOOR if self.floor is None else self.floor


MAX_ELEVATION, MAX_SUBDIVISION, MAX_POINTS = 64, 10, 1024
"""Upper limits: with larger values there are too many inequalities for any solver (2^subdivision
parts of each parameter).
"""


def _counted(**counts: tuple[int, int, int]) -> None:
    for name, (value, least, most) in counts.items():
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise InputError(
                f"{name} must be an integer from {least} to {most} (a larger program is not solved"
                f" in reasonable time), got {value!r}"
            )


@dataclass(frozen=True, kw_only=True)
class Bernstein(_Strictly):
    """One LMI per Bernstein coefficient: sufficient, and exact in the limit.

    Parameters
    ----------
    elevation : int
        Raises the degree of the Bernstein form, which brings its coefficients closer to the values.
    subdivision : int
        Halves every range that often before the coefficients are taken.
    margins : tuple of float, optional
        State blocks are held below -margin I in scaled coordinates, tried in turn: (1e-6, 1e-4).
        For gains alone.
    floor : float, optional
        P is held above floor I in scaled coordinates: 1e-6. For gains alone.

    Raises
    ------
    InputError
        For a number out of range.

    Examples
    --------
    >>> Bernstein(elevation=1).tried
    (1e-06, 0.0001)
    """

    elevation: int = 0
    subdivision: int = 0

    found_by = "one LMI per Bernstein coefficient"

    def __post_init__(self) -> None:
        super().__post_init__()
        _counted(
            elevation=(self.elevation, 0, MAX_ELEVATION),
            subdivision=(self.subdivision, 0, MAX_SUBDIVISION),
        )


@dataclass(frozen=True, kw_only=True)
class SumOfSquares(_Strictly):
    """Matrix sums of squares: sufficient; for one parameter exact. Never worse than `Bernstein`.

    Parameters
    ----------
    elevation : int
        Raises the degree of the sums of squares.
    margins, floor
        As in `Bernstein`.

    Raises
    ------
    InputError
        For a number out of range.

    References
    ----------
    Scherer and Hol, "Matrix sum-of-squares relaxations for robust semi-definite programs",
    Mathematical Programming 107 (2006).

    Examples
    --------
    >>> SumOfSquares().found_by
    'matrix sums of squares'
    """

    elevation: int = 0

    found_by = "matrix sums of squares"

    def __post_init__(self) -> None:
        super().__post_init__()
        _counted(elevation=(self.elevation, 0, MAX_ELEVATION))


@dataclass(frozen=True, kw_only=True)
class Vertices(_Strictly):
    """At the corners, with convexity along every axis: sufficient; exact for multi-affine LMIs.

    Where no P meets that, the coefficients of `Bernstein` are tried, which ask for no convexity.

    Parameters
    ----------
    margins, floor
        As in `Bernstein`.

    References
    ----------
    Gahinet, Apkarian and Chilali, "Affine parameter-dependent Lyapunov functions and real
    parametric uncertainty", IEEE Trans. Automatic Control 41 (1996).

    Examples
    --------
    >>> Vertices().found_by
    'LMIs at the vertices with convexity along every axis'
    """

    found_by = "LMIs at the vertices with convexity along every axis"


@dataclass(frozen=True)
class Grid(_Strictly):
    """Inequalities on a grid only: this proves nothing; the certificate is `UNPROVEN` and gives an
    `indicative` bound.

    Parameters
    ----------
    points : int
        Of each parameter in every region.
    margins, floor
        As in `Bernstein`.

    Raises
    ------
    InputError
        For fewer than two points.

    Examples
    --------
    >>> Grid(21).points
    21
    """

    points: int = 11

    found_by = "LMIs on a grid"

    def __post_init__(self) -> None:
        super().__post_init__()
        _counted(points=(self.points, 2, MAX_POINTS))


Imposed = Bernstein | SumOfSquares | Vertices | Grid
"""Type of `impose`."""
