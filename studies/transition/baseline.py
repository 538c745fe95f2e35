"""The baseline: exact linearizations along the transition, interpolated element by element, as an
LFT.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import symheli
from studies.setup.bounds import COPIES
from studies.setup.flights import TOP
from studies.transition.first_look import FirstLook, first_look
from symheli import LFT, Helicopter, LinearFamily, LPVStateSpace

DEGREES = (2, 3, 4, 5, 6)
UNFIT = 0.10
"""An entry whose error exceeds this share of its range at every degree is said not to be fitted by
any.
"""

_FORCE = {"u": "X", "v": "Y", "w": "Z", "p": "L", "q": "M", "r": "N"}


def derivative_name(row: str, column: str) -> str:
    """Stability or control derivative in the field's nomenclature: M_u, N_dped; other rows as
    state'_column.
    """
    return f"{_FORCE.get(row, row + chr(39))}_{column.replace('d_', 'd')}"


@dataclass(frozen=True)
class EntryError:
    """One entry of A or B: its range over the transition and the largest error between the nodes by
    kind of interpolation, in percent of that range.
    """

    name: str
    span: float
    percent: dict[str, float]

    @property
    def best_polynomial(self) -> float:
        """Smallest error among the polynomials, percent of the range."""
        return min(v for k, v in self.percent.items() if k.startswith("polynomial"))


@dataclass(frozen=True)
class Baseline:
    """The family at `nodes`, the one to check against between them, the interpolations and their
    errors, the LFT, and what the helicopter is like by itself.
    """

    nodes: LinearFamily
    between: LinearFamily
    lpv: dict[str, LPVStateSpace]
    entries: tuple[EntryError, ...]
    lft: LFT
    reduced: LFT
    lft_error: float
    """Largest difference of any entry of the LFT, whole and reduced, to the polynomial family,
    relative to the largest entry.
    """
    look: FirstLook

    @property
    def unfit(self) -> list[EntryError]:
        """Entries that no polynomial degree fits, worst first."""
        return sorted(
            (e for e in self.entries if e.best_polynomial > 100 * UNFIT),
            key=lambda e: -e.best_polynomial,
        )


def build_baseline(heli: Helicopter, points: int = 27, degree: int = 3) -> Baseline:
    """Sweep 0 to 13 m/s at `points` nodes and at the three quarter points of each interval between
    them.
    """
    nodes = np.linspace(0.0, TOP, points)
    fine = np.unique(
        np.concatenate([nodes[:-1] + share * np.diff(nodes) for share in (0.25, 0.5, 0.75)])
    )
    inputs = [*heli.inputs, "v_w"]
    family = symheli.sweep(heli, nodes, inputs=inputs)  # type: ignore[arg-type]
    between = symheli.sweep(heli, fine, inputs=inputs)  # type: ignore[arg-type]
    lpv = {f"polynomial {d}": family.interpolate("polynomial", d) for d in DEGREES}
    lpv |= {"spline": family.interpolate("spline"), "linear": family.interpolate("linear")}
    lft = lpv[f"polynomial {degree}"].to_lft()
    reduced = lft.reduce(COPIES)
    return Baseline(
        family,
        between,
        lpv,
        _entry_errors(between, lpv),
        lft,
        reduced,
        _lft_error(lpv[f"polynomial {degree}"], lft, reduced, between),
        first_look(family, dict(zip(map(str, heli.inputs), map(float, heli.travel), strict=True))),
    )


def _entry_errors(between: LinearFamily, lpv: dict[str, LPVStateSpace]) -> tuple[EntryError, ...]:
    exact = np.concatenate([between.A, between.B], axis=2)
    fitted = {
        kind: np.concatenate(model.matrices(between.airspeeds)[:2], axis=2)
        for kind, model in lpv.items()
    }
    span = np.ptp(exact, axis=0)
    columns = (*between.states, *between.inputs)
    errors = []
    for i, row in enumerate(between.states):
        for j, column in enumerate(columns):
            # rounding of the linearization is about 1e-13 of the largest entry: a smaller range is
            # a constant
            if span[i, j] > 1e-9 * np.abs(exact).max():
                percent = {
                    kind: float(100 * np.abs(M[:, i, j] - exact[:, i, j]).max() / span[i, j])
                    for kind, M in fitted.items()
                }
                errors.append(EntryError(derivative_name(row, column), float(span[i, j]), percent))
    return tuple(errors)


def _lft_error(lpv: LPVStateSpace, lft: LFT, reduced: LFT, between: LinearFamily) -> float:
    worst, size = 0.0, 0.0
    for p in between.airspeeds:
        exact = lpv.at(float(p))
        for model in (lft.at(float(p)), reduced.at(float(p))):
            worst = max(
                worst,
                *(
                    float(np.abs(getattr(model, name) - getattr(exact, name)).max())
                    for name in "ABCD"
                ),
            )
        size = max(size, float(np.abs(exact.A).max()), float(np.abs(exact.B).max()))
    return worst / size
