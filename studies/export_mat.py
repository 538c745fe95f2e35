"""The linear family as a MATLAB file, with the functions that rebuild it there."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

import symheli
from studies.export_mat_loader import DATA_FUNCTION, LOADER
from studies.files import write_bytes, write_text
from symheli import Helicopter, LinearFamily, Signal
from symheli.errors import InputError

README = (
    "dx/dt = A(:,:,k) dx + B(:,:,k) du, dy = C(:,:,k) dx + D(:,:,k) du about x0(:,k), u0(:,k),"
    " y0(:,k) at airspeeds(k) m/s; load_symheli.m makes ss and lpvss models of it; SI units and"
    " radians, body axes x forward y right z down; states, inputs, outputs name the rows and"
    " columns, units beside them"
)


def write_mat(
    heli: Helicopter, low: float, high: float, points: int, path: Path
) -> tuple[Path, ...]:
    """Sweep `points` airspeeds from `low` to `high` m/s and write the family to `path`,
    load_symheli.m and symheli_at.m beside it.
    """
    if not (0 <= low < high and points >= 2):
        raise InputError(
            f"expected 0 <= LOW < HIGH and at least two points, got {low:g} to {high:g} m/s in"
            f" {points}"
        )
    family = symheli.sweep(heli, np.linspace(low, high, points))  # type: ignore[arg-type]
    return (
        write_bytes(
            path,
            content(
                family, f"{heli.vehicle.title}, {heli.governor} governor; {heli.vehicle.source}"
            ),
        ),
        write_text(path.with_name("load_symheli.m"), LOADER),
        write_text(path.with_name("symheli_at.m"), DATA_FUNCTION),
    )


def content(family: LinearFamily, title: str) -> bytes:
    """The bytes of a version 5 MAT file (MATLAB, Octave, scipy.io.loadmat)."""
    from scipy.io import savemat

    arrays = {name: np.moveaxis(getattr(family, name), 0, -1) for name in "ABCD"}
    labels = {
        key: cells
        for group in ("states", "inputs", "outputs")
        for key, cells in (
            (group, _cells(getattr(family, group))),
            (f"{group}_units", _cells([s.unit for s in getattr(family, group)])),
        )
    }
    points = family.known_trims("a MAT file of trimmed models")
    x0 = np.array([[t.x[s] for s in family.states] for t in points])
    u0 = np.array([[t.u[s] for s in family.inputs] for t in points])
    y0 = np.einsum("kij,kj->ki", family.C, x0) + np.einsum("kij,kj->ki", family.D, u0)
    trims = {"x0": x0.T, "u0": u0.T, "y0": y0.T}
    kinks = np.array(sorted(v for found in family.kinks.values() for v in found))
    buffer = io.BytesIO()
    savemat(
        buffer,
        {
            "airspeeds": family.airspeeds,
            "title": title,
            "readme": README,
            "kink_airspeeds": kinks,
            **arrays,
            **labels,
            **trims,
        },
    )
    return buffer.getvalue()


def _cells(names: list[str] | tuple[Signal, ...]) -> np.ndarray:
    return np.array([str(n) for n in names], dtype=object)
