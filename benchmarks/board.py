"""Exported C on a bare Cortex-M4 and M7, in an emulator: instructions and stack of a step, code and
data.

An instruction is counted, not timed: an emulator knows no caches, pipelines or wait states.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

import identification as idn  # noqa: E402
from benchmarks.controller_step import controller  # noqa: E402
from benchmarks.race import present, table  # noqa: E402
from benchmarks.timing import arguments  # noqa: E402
from evidence import on_board  # noqa: E402
from identification.export import (  # noqa: E402
    write_estimator,
    write_kinematic_estimator,
    write_kinematic_model,
    write_kinematic_observer,
    write_model,
)
from identification.model.kinematic_observer import KinematicObserver  # noqa: E402
from identification.structure.kinematic_arx import INCREMENTS  # noqa: E402
from symheli.errors import InputError  # noqa: E402
from symheli.export import write_board, write_controller, write_monitor  # noqa: E402
from symheli.export.board import TARGETS  # noqa: E402
from symheli.flight import HypothesisMonitor  # noqa: E402
from symheli.values import Signal  # noqa: E402
from symheli.values.kinematics import INPUTS, RIGID_BODY  # noqa: E402
from symheli.values.signal import signals  # noqa: E402

DT = 0.02
BASIS = idn.Polynomial(2, 0.0, 13.0)
CONTROLS = tuple(map(str, INPUTS))
UNITS = {str(s): s.unit for s in (*RIGID_BODY, *INCREMENTS, *INPUTS, Signal("airspeed", "m/s"))}
ARX = idn.LPVARX(
    ("theta", "w", "u"), ("d_lon", "d_col"), "airspeed", na=2, nb=2, delay=1, basis=BASIS
)
KINEMATIC = idn.KinematicARX(CONTROLS, "airspeed", basis=idn.Polynomial(1, 0.0, 13.0))
HEAD = (
    "artefact",
    "core",
    "instructions a step, mean",
    "most",
    "stack, bytes",
    "code and constants, bytes",
    "data, bytes",
    "equal to Python",
)
Writer = Callable[[Path], object]


def model(structure: idn.LPVARX) -> idn.model.LPVARXModel:
    """Random small coefficients: what a step takes does not depend on them."""
    rng = np.random.default_rng(0)
    return idn.model.LPVARXModel(
        structure=structure,
        theta=rng.uniform(-0.01, 0.01, (structure.n_regressors, structure.ny)),
        dt=DT,
        outputs=signals(structure.outputs, UNITS),
        inputs=signals(structure.inputs, UNITS),
        scheduling=signals(structure.parameters, UNITS),
        residual_covariance=np.eye(structure.ny),
        rows_used=100,
    )


def kinematic_model() -> idn.model.KinematicModel:
    """The same around known kinematics."""
    trim = np.zeros((KINEMATIC.basis.size, 8))
    inner = model(KINEMATIC.aerodynamics)
    return idn.model.KinematicModel(structure=KINEMATIC, aerodynamics=inner, trim=trim)


def observer() -> KinematicObserver:
    """The filter around it."""
    return kinematic_model().observer(dict.fromkeys(KINEMATIC.outputs, 0.05), process=0.02)


def artefacts() -> dict[str, Writer]:
    """What is exported, by what it is."""
    own, found = controller(), {}
    watched = HypothesisMonitor.of(own)
    found["controller, 10 states, 33 airspeeds"] = lambda folder: write_controller(own, folder)
    found["monitor, 10 samples"] = lambda folder: write_monitor(watched, folder)
    for precision in ("single", "double"):
        rls, known = (idn.RecursiveLeastSquares(s, precision=precision) for s in (ARX, KINEMATIC))
        size = f"{ARX.ny} outputs of {ARX.n_regressors} regressors, {precision}"
        inner = KINEMATIC.aerodynamics.n_regressors
        found |= {
            f"estimator, {size}": lambda folder, rls=rls: write_estimator(rls, UNITS, folder),
            f"kinematic estimator, 6 of {inner}, {precision}": lambda folder, rls=known: (
                write_kinematic_estimator(rls, UNITS, DT, folder)
            ),
            f"model, {size}": lambda folder, kind=precision: write_model(
                model(ARX), folder, precision=kind
            ),
            f"kinematic model, 6 of {inner}, {precision}": lambda folder, kind=precision: (
                write_kinematic_model(kinematic_model(), folder, precision=kind)
            ),
            f"kinematic observer, 8 states, {precision}": lambda folder, kind=precision: (
                write_kinematic_observer(observer(), folder, precision=kind)
            ),
        }
    return found


def measured(name: str, write: Writer, target: str) -> tuple[str, ...]:
    """A row of the table; raises `InputError` where a check program fails."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        write(folder)
        write_board(folder, target)
        runs = on_board.checked(folder, target)
        text, data = on_board.size(folder, target)
    if failed := [run.text for run in runs.values() if not run.passed]:
        raise InputError(f"{name} on {target}: {failed[0]}")
    (run,) = (run for key, run in runs.items() if not key.endswith("_aero_check"))
    mean, most = run.instructions
    return name, target, *(f"{n:,}" for n in (mean, most, run.stack, text, data)), _equal(run.text)


def _equal(text: str) -> str:
    """How far the numbers are those of Python, as the check program says."""
    if "largest difference 0.00e+00" in text:
        return "every bit"
    if "statuses equal" in text:
        return "every status"
    return f"to {text.split('largest difference ')[1].split()[0].rstrip(',')}"


def main() -> None:
    """Measure, print, keep."""
    options = arguments(__doc__, write=True, timed=False)
    if why := on_board.missing():
        raise SystemExit(
            f"{why}: apt install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm make"
        )
    chosen = artefacts()
    if options.quick:
        chosen = dict(list(chosen.items())[:2])
    rows = [measured(name, write, target) for name, write in chosen.items() for target in TARGETS]
    notes = [
        f"{on_board.versions()}; -O2 -ffp-contract=off",
        "instructions: executed by the emulator (`-icount shift=6`, read from the board's timer),"
        " over the samples of the check program; no cycles, no time",
        "stack: painted before each step; code, constants and data: `arm-none-eabi-size`, without"
        " the check program and the C library; the state of controller, monitor and model is the"
        " caller's",
        "double precision is software on the M4, hardware on the M7; in single precision sin, cos"
        " and tan are those of double precision",
    ]
    shown = table("### A step on a bare core", rows, HEAD)
    present("board", options, [shown], [], notes)


if __name__ == "__main__":
    main()
