"""Invariant tubes of the nonlinear helicopter about steady flight."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_are

from symheli import Helicopter, trim
from symheli.airframe.vehicle import load_vehicle
from symheli.airframe.written import as_toml
from symheli.errors import InputError
from symheli.values.summary import summarized
from symheli.values.whole_files import write_text
from synthesis.program.cone_program import Solver
from synthesis.tubes.deviations import Deviations
from synthesis.tubes.inequality import Multipliers
from synthesis.tubes.proof import holds
from synthesis.tubes.search import multipliers, smallest

Array = np.ndarray

SCHEMA, VERSION = "symheli tube", 1
STATE_SIZES = (1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.2, 0.2, 0.1, 0.1)
"""Deviations of equal weight in the default feedback: m/s, rad/s, rad."""
CONTROL_SIZE = 0.1
"""Control of the weight of these, rad."""
TUBE_SIZES = (0.4, 0.5, 0.8, 0.1, 0.1, 0.3, 0.08, 0.06, 0.02, 0.02)
"""Half widths of equal weight in the size of a tube: m/s, rad/s, rad."""
DECAYS = (0.5, 1.0, 2.0, 3.0)
"""Rates alpha that are tried on the linear loop, 1/s."""
FIRST_GROWTH, GROWTH = 1.5, 1.05
"""Factors on the half widths from one round of the search to the next."""
ROUNDS = 15
SPARE = 0.02
"""Spare of the inequality in the search, 1/s."""
INSIDE = 1 - 1e-6
"""Share of the enclosed deviations that the tube may fill, for rounding of the search."""


@dataclass(frozen=True, eq=False)
class Tube:
    """The deviations e = x - x0 with e'P e <= 1, which the nonlinear helicopter does not leave.

    Made by `tube`; `verify` proves it again from these fields alone.

    Attributes
    ----------
    deviations : Deviations
        The closed loop: helicopter, steady flight x and u, gain, gust amplitude.
    airspeed : float
        Of the steady flight, m/s.
    P : array (n, n)
        In SI units; the search's last one where nothing was proven.
    factor : array (n, n)
        The deviations e = factor z, |z| <= 1, over which the equations are enclosed.
    multipliers : Multipliers or None
        Of the matrix inequality.
    proven : bool
        The inequality holds in exact arithmetic for every enclosed matrix.
    why : str
        Why there is no proof; empty where there is one.

    Raises
    ------
    InputError
        `save` of a tube without a proof, `load` of a file that is damaged or another.

    Examples
    --------
    >>> import symheli
    >>> found = tube(symheli.Helicopter.load("xcell60", governor="ideal"), 3.0, gust=0.1)
    >>> found.save("tube.json").name, Tube.load("tube.json").proven
    ('tube.json', True)
    """

    deviations: Deviations
    airspeed: float
    P: Array
    factor: Array
    multipliers: Multipliers | None
    proven: bool
    why: str

    __repr__ = summarized

    @property
    def half_widths(self) -> Array:
        """Largest deviation of each state, (n,), SI."""
        return np.sqrt(np.diag(np.linalg.inv(self.P)))

    @property
    def control_half_widths(self) -> Array:
        """Largest deviation of each control from that of steady flight, (4,), rad."""
        K = self.deviations.gain
        return np.sqrt(np.einsum("ui,ij,uj->u", K, np.linalg.inv(self.P), K))

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """What the statement rests on, in sentences."""
        d = self.deviations
        return (
            f"the equations of {d.heli.vehicle.name} with an ideal governor; u = u0 + K e in"
            " continuous time with all ten states known; no servos, no delay",
            "controls within their travel: they differ from those of steady flight by no more than"
            " the control deviations",
            f"the commanded airspeed is {self.airspeed:g} m/s; gusts have at most {d.gust:g} m/s,"
            " any direction in body axes and any history",
            "the deviation lies in the tube at the start",
        )

    def __str__(self) -> str:
        named = zip(self.deviations.heli.states, self.half_widths, strict=True)
        sizes = ", ".join(f"{name} {width:.3g}" for name, width in named)
        inputs = zip(self.deviations.heli.inputs, self.control_half_widths, strict=True)
        controls = ", ".join(f"{name} {width:.3g}" for name, width in inputs)
        if not self.proven:
            return f"no tube: {self.why}"
        return "\n".join(
            [
                "invariant tube of the nonlinear equations, proven",
                f"largest deviations (SI): {sizes}",
                f"of the controls (rad): {controls}",
                *(f"- {line}" for line in self.hypotheses),
            ]
        )

    def contains(self, deviation: Any) -> bool:
        """Whether a deviation (n,), SI, lies in the tube."""
        e = np.asarray(deviation, float)
        return bool(e @ self.P @ e <= 1)

    def verify(self) -> bool:
        """Enclose the equations again and check the inequality in exact arithmetic."""
        over = self.deviations.enclosed(self.factor)
        return (
            over is not None
            and self.multipliers is not None
            and self.multipliers.terms.shape == (len(over.left),) * 2
            and holds(self.P, over, self.factor, self.multipliers)
        )

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the tube as JSON: equations (the vehicle file), feedback and proof."""
        if not self.proven or self.multipliers is None:
            raise InputError(f"only a proven tube is saved; here {self.why}")
        d, heli = self.deviations, self.deviations.heli
        proof = {name: np.asarray(m).tolist() for name, m in self.multipliers._asdict().items()}
        content = {
            "schema": SCHEMA,
            "version": VERSION,
            "name": heli.vehicle.name,
            "vehicle": as_toml(heli.vehicle),
            "density": heli.density,
            "smoothing": heli.smoothing,
            "printed": sorted(heli.printed),
            "airspeed": self.airspeed,
            "gust": d.gust,
            "x": d.x.tolist(),
            "u": d.u.tolist(),
            "gain": d.gain.tolist(),
            "P": self.P.tolist(),
            "factor": self.factor.tolist(),
            "multipliers": proof,
        }
        return write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Tube:
        """Read a tube and prove it again; `proven` says whether that succeeded."""
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            if not isinstance(content, dict) or content.get("schema") != SCHEMA:
                raise InputError(f"{path}: expected the schema {SCHEMA!r}, written by Tube.save")
            if content["version"] != VERSION:
                raise InputError(
                    f"{path}: expected version {VERSION} of the schema, got"
                    f" {content['version']!r:.60}; read it with the version that wrote it"
                )
            found = _read(content)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: damaged, a value is invalid or missing ({error})") from None
        proven = found.verify()
        why = "" if proven else "the inequality does not hold in exact arithmetic"
        return replace(found, proven=proven, why=why)


def _read(content: dict[str, Any]) -> Tube:
    with tempfile.TemporaryDirectory(prefix="symheli-") as folder:
        file = Path(folder) / f"{Path(str(content['name'])).name}.toml"
        file.write_text(content["vehicle"], encoding="utf-8")
        vehicle = load_vehicle(file)
    heli = Helicopter(
        vehicle,
        "ideal",
        float(content["density"]),
        frozenset(content["printed"]),
        float(content["smoothing"]),
    )
    n = len(heli.states)

    def array(values: Any, *shape: int) -> Array:
        read = np.asarray(values, float)
        if read.shape != shape or not np.all(np.isfinite(read)):
            raise ValueError(f"expected finite numbers of shape {shape}, got {read.shape}")
        return read

    proof = content["multipliers"]
    terms = np.asarray(proof["terms"], float)
    return Tube(
        Deviations(
            heli,
            array(content["x"], n),
            array(content["u"], 4),
            array(content["gain"], 4, n),
            float(array(content["gust"])),
        ),
        float(array(content["airspeed"])),
        array(content["P"], n, n),
        array(content["factor"], n, n),
        Multipliers(
            array(proof["tube"], n, n),
            array(proof["gust"], n, n),
            array(terms, *terms.shape),
            array(proof["wind"], 1, 1),
            float(array(proof["decay"])),
        ),
        False,
        "not verified",
    )


def tube(
    heli: Helicopter,
    airspeed: float,
    *,
    gust: float,
    gain: Any = None,
    solver: Solver | None = None,
) -> Tube:
    """A proven invariant tube of the nonlinear helicopter about level flight, in gusts.

    With u = u0 + K e, the deviation e = x - x0 from steady flight stays in e'P e <= 1 for every
    gust history of the amplitude. The difference of the nonlinear equations from those in steady
    flight is an average of their Jacobian times (e, w); the Jacobian is enclosed over the whole
    tube (`symheli.enclosure`), and a matrix inequality is checked for all enclosed matrices in
    rational arithmetic.

    Parameters
    ----------
    heli : Helicopter
        With governor "ideal": ten states.
    airspeed : float
        Of the steady flight, m/s.
    gust : float
        Largest size of the gust vector, m/s.
    gain : array (4, 10), optional
        K, rad per SI unit. Default: a linear-quadratic regulator on all states.
    solver : Solver, optional
        Of the semidefinite programs; by default Clarabel.

    Returns
    -------
    Tube
        `proven` says whether there is one, `why` why not; a larger tube than that found may exist.

    Raises
    ------
    InputError
        Another governor, a gust that is no number >= 0, a gain of another shape.
    TrimError
        No steady flight at this airspeed.

    References
    ----------
    Boyd et al. (1994), Linear Matrix Inequalities in System and Control Theory, section 6.1
    (invariant ellipsoids of unit-peak inputs); Petersen (1987), A stabilization algorithm for a
    class of uncertain linear systems.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> found = tube(heli, 3.0, gust=0.1)
    >>> found.proven, bool(found.half_widths[0] < 0.02)
    (True, True)
    """
    if heli.governor != "ideal" or len(heli.states) != 10:
        raise InputError(
            "a tube needs the ten states of an ideal governor: Helicopter.load(...,"
            " governor='ideal')"
        )
    if not (np.isfinite(gust) and gust >= 0):
        raise InputError(f"gust must be a number >= 0, m/s; got {gust!r:.60}")
    steady = trim(heli, airspeed=airspeed)
    x, u = np.array(steady.x), np.array(steady.u)
    K = _regulator(heli, x, u) if gain is None else np.asarray(gain, float)
    if K.shape != (4, 10) or not np.all(np.isfinite(K)):
        raise InputError(f"gain must be 4 by 10 finite numbers, rad per SI unit; got {K.shape}")
    return _found(Deviations(heli, x, u, K, float(gust)), float(airspeed), solver or Solver())


def _regulator(heli: Helicopter, x: Array, u: Array) -> Array:
    """K (4, 10) of the linear-quadratic regulator."""
    A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
    Q, R = np.diag(1 / np.array(STATE_SIZES) ** 2), np.eye(4) / CONTROL_SIZE**2
    return -np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))


def _found(loop: Deviations, airspeed: float, solver: Solver) -> Tube:
    """The search: the ellipsoid over which the equations are enclosed grows until the smallest one
    that satisfies the inequality lies inside.
    """
    sizes = np.array(TUBE_SIZES)
    factor = 0.3 * np.diag(sizes)

    def without(why: str, P: Array) -> Tube:
        return Tube(loop, airspeed, P, factor, None, False, why)

    over = loop.enclosed(1e-7 * factor)
    if over is None:
        return without("the equations have no bounds near steady flight", np.diag(sizes**-2))
    # its centre alone: the linear loop
    linear = over._replace(tube=0 * over.tube, gust=0 * over.gust, weights=0 * over.weights)
    tries = [(smallest(linear, factor, sizes, decay, SPARE, solver), decay) for decay in DECAYS]
    found = [(size, decay, P) for got, decay in tries if got is not None for P, size in [got]]
    if not found:
        return without("the linear loop has no invariant ellipsoid", np.diag(sizes**-2))
    _, decay, P = min(found, key=lambda f: f[0])
    P = P / FIRST_GROWTH**2
    for _ in range(ROUNDS):
        factor = np.linalg.inv(np.linalg.cholesky(P)).T
        over = loop.enclosed(factor)
        if over is None:
            return without("the equations have no bounds over a tube of the size needed", P)
        got = smallest(over, factor, sizes, decay, SPARE, solver)
        if got is None:
            return without("no ellipsoid satisfies the inequality: the gusts are too large", P)
        least = np.linalg.eigvalsh(factor.T @ got[0] @ factor)[0]
        P = got[0]
        if least * INSIDE > 1:
            by = multipliers(P, over, factor, decay, solver)
            if by is not None and holds(P, over, factor, by):
                return Tube(loop, airspeed, P, factor, by, True, "")
        P = P / GROWTH**2
    return without(f"the tube still grew after {ROUNDS} rounds", P)
