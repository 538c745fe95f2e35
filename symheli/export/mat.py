"""The linear family as a MATLAB file, with the functions that rebuild it there."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np

from symheli import LinearFamily
from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.steady.airspeed_sweep import sweep
from symheli.values import Signal
from symheli.values.whole_files import write_bytes, write_text

HERE = Path(__file__).parent
FUNCTIONS = ("load_symheli.m", "symheli_at.m")
"""MATLAB functions that rebuild the family; they lie here."""

README = (
    "dx/dt = A(:,:,k) dx + B(:,:,k) du, dy = C(:,:,k) dx + D(:,:,k) du about x0(:,k), u0(:,k),"
    " y0(:,k) at airspeeds(k) m/s; load_symheli.m makes ss and lpvss models of it; SI units and"
    " radians, body axes x forward y right z down; states, inputs, outputs name the rows and"
    " columns, units beside them"
)


def write_mat(
    heli: Helicopter,
    path: str | os.PathLike[str],
    low: float = 0.0,
    high: float = 13.0,
    points: int = 14,
) -> tuple[Path, ...]:
    """Write the linear models along airspeed as a MATLAB file, with the functions that load it.

    The file (version 5: MATLAB, Octave, `scipy.io.loadmat`) holds A (nx, nx, K), B, C, D, the trims
    x0 (nx, K), u0, y0, the airspeeds, the airspeeds at which the models jump, and the names and
    units of states, inputs and outputs. `load_symheli` makes an array of ss models of it, and an
    lpvss model.

    Parameters
    ----------
    heli : Helicopter
        The model to trim and linearize.
    path : path
        Of the MATLAB file; load_symheli.m and symheli_at.m are written beside it.
    low, high : float
        Ends of the airspeed range, m/s; 0 <= low < high.
    points : int
        Airspeeds in the range, evenly spaced, at least two.

    Returns
    -------
    tuple of Path
        The files written.

    Raises
    ------
    InputError
        For an empty range or fewer than two points.
    TrimError
        Where the helicopter cannot be trimmed at one of the airspeeds.

    Examples
    --------
    >>> import symheli, tempfile
    >>> from symheli.export import write_mat
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> folder = tempfile.TemporaryDirectory()
    >>> files = write_mat(heli, f"{folder.name}/family.mat", low=2.0, high=8.0, points=3)
    >>> [file.name for file in files]
    ['family.mat', 'load_symheli.m', 'symheli_at.m']
    >>> folder.cleanup()
    """
    if not (0 <= low < high and points >= 2):
        raise InputError(
            f"expected 0 <= LOW < HIGH and at least two points, got {low:g} to {high:g} m/s in"
            f" {points}"
        )
    family = sweep(heli, np.linspace(low, high, points))  # type: ignore[arg-type]
    title = f"{heli.vehicle.title}, {heli.governor} governor; {heli.vehicle.source}"
    return write_family_mat(family, path, title)


def write_family_mat(
    family: LinearFamily, path: str | os.PathLike[str], title: str
) -> tuple[Path, ...]:
    """Write a family as `write_mat` does, under a `title` of one line.

    Parameters
    ----------
    family : LinearFamily
        Models over airspeed with their trims.
    path : path
        Of the MATLAB file; load_symheli.m and symheli_at.m are written beside it.
    title : str
        What the models are.

    Returns
    -------
    tuple of Path
        The files written.

    Raises
    ------
    InputError
        For a family without trims.

    Examples
    --------
    >>> import symheli, tempfile
    >>> from symheli.export import write_family_mat
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> folder = tempfile.TemporaryDirectory()
    >>> family = symheli.sweep(heli, [4.0, 8.0])
    >>> files = write_family_mat(family, f"{folder.name}/two.mat", "two models")
    >>> [file.name for file in files]
    ['two.mat', 'load_symheli.m', 'symheli_at.m']
    >>> folder.cleanup()
    """
    path = Path(path)
    functions = (
        write_text(path.with_name(name), (HERE / name).read_text(encoding="utf-8"))
        for name in FUNCTIONS
    )
    return (write_bytes(path, content(family, title)), *functions)


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
    speeds = family.over_airspeed("a MAT file of trimmed models")
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
            "airspeeds": speeds,
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
