"""The monitor of a certificate's hypotheses as C99 for an autopilot, with a check of what Python
computed.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from symheli.errors import InputError
from symheli.export.c_program import CProgram
from symheli.export.c_text import blocks, define, in_comment, index_macros, literals, rows, table
from symheli.flight.hypothesis_monitor import HypothesisMonitor
from symheli.values.arrays import Array

HERE = Path(__file__).parent
"""monitor.c, .h and _check.c lie here, with marked places for one monitor."""

SAMPLES = 400
"""Length of the flight in the check program, samples."""


def write_monitor(
    monitor: HypothesisMonitor, folder: str | os.PathLike[str], name: str = "monitor"
) -> tuple[Path, ...]:
    """Write the monitor of a certificate's hypotheses as C99 in 32-bit arithmetic: no allocation,
    no library.

    Compiled with -ffp-contract=off it says what the `HypothesisMonitor` says. NAME_check.c is a
    program that carries a flight and exits with 0 where the compiled monitor says the same.

    Parameters
    ----------
    monitor : HypothesisMonitor
        What is written.
    folder : path
        Where the files go; made as needed.
    name : str
        A C identifier: of the files and functions, in capitals of the macros.

    Returns
    -------
    tuple of Path
        NAME.h, NAME.c and NAME_check.c.

    Raises
    ------
    InputError
        For a name that is no C identifier, and a monitor of no command.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import symheli, tempfile
    >>> from symheli.export import write_monitor
    >>> speed = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0)
    >>> monitor = symheli.flight.HypothesisMonitor(speed, 0.02, {"d_lon": (-0.2, 0.2)})
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in write_monitor(monitor, folder.name)]
    ['monitor.h', 'monitor.c', 'monitor_check.c']
    >>> folder.cleanup()
    """
    if not monitor.outputs:
        raise InputError("outputs: name the commands that are watched, one at least")
    up = f"{name.upper()}_"
    return CProgram(
        template=HERE / "monitor",
        name=name,
        word="monitor",
        header=_header(monitor, up),
        source={"constants": _constants(monitor)},
        check={"cases": _cases(monitor)},
    ).write(folder)


def _header(monitor: HypothesisMonitor, up: str) -> dict[str, object]:
    """Sizes, the index of every command with its unit and limits, and the hypotheses in words."""
    s, limits = monitor.scheduling, monitor.limits
    notes = ["{:g} to {:g}".format(*limits[y]) if y in limits else "" for y in monitor.outputs]
    sizes = [
        define(f"{up}NY", len(monitor.outputs)),
        define(f"{up}WINDOW", monitor.samples, "samples"),
    ]
    return {
        "parameter": in_comment(s.name),
        "unit": in_comment(s.unit),
        "low": f"{s.low:g}",
        "high": f"{s.high:g}",
        "rate": f"{s.limit:g}",
        "noise": f"{float(monitor.numbers['noise']):.3g}",
        "samples": monitor.samples,
        "dt": f"{monitor.dt:.9g}",
        "shortest": f"{float(monitor.numbers['shortest']):.6g}",
        "longest": f"{float(monitor.numbers['longest']):.6g}",
        "sizes": blocks(sizes, index_macros(f"{up}Y_", monitor.outputs, notes)),
    }


def _constants(monitor: HypothesisMonitor) -> str:
    return "\n".join(
        [
            *(
                f"static const float {key} = {literals([float(value)], np.float32)[0]};"
                for key, value in monitor.numbers.items()
            ),
            rows("float", "limits", "2", monitor.ends, np.float32),
        ]
    )


def _cases(monitor: HypothesisMonitor) -> str:
    """A flight from a fixed seed as C tables: slow and fast, beyond the range, commands at their
    limits, readings that are missing, periods that are not kept.
    """
    given, valid = _flight(monitor)
    state, expected = monitor.init(), []
    for row, trusted in zip(given, valid, strict=True):
        events, state = monitor.update(state, row[0], row[1], row[2:], valid=bool(trusted))
        expected.append(int(events))
    return "\n".join(
        [
            define("SAMPLES", len(given)),
            table("int", "valid", valid.tolist()),
            table("int", "expected", expected),
            rows("float", "given", str(given.shape[1]), given, np.float32),
        ]
    )


def _flight(monitor: HypothesisMonitor) -> tuple[Array, Array]:
    """Parameter, seconds and commands (N, 2 + ny), and whether the parameter is trusted (N,)."""
    rng, s, n = np.random.default_rng(0), monitor.scheduling, monitor.numbers
    width = s.high - s.low
    pace = min(float(s.limit) * monitor.dt, 0.02 * width) + 0.5 * float(n["noise"])
    steps = rng.choice([0.3, 0.3, 0.9, 1.1, -0.5], SAMPLES) * pace
    p = s.low + np.abs(np.cumsum(steps) % (2.2 * width) - 1.1 * width)
    seconds = monitor.dt * (1 + 0.5 * monitor.jitter * rng.uniform(-1, 1, SAMPLES))
    ends = np.clip(monitor.ends.astype(float), -1.0, 1.0)
    commands = ends[:, 0] + rng.uniform(0, 1, (SAMPLES, len(ends))) * np.diff(ends).T
    quiet = 6 * monitor.samples
    for k in range(quiet, SAMPLES, quiet):
        commands[k, rng.integers(len(ends))] = rng.choice([1e3, np.nan, ends[0, 0]])
        seconds[(k + quiet // 3) % SAMPLES] *= rng.choice([0.2, 2.0, np.nan])
        p[(k + quiet // 2) % SAMPLES] = rng.choice([np.nan, 3e38, s.high + width])
    valid = (rng.random(SAMPLES) > 0.01).astype(int)
    return np.column_stack([p, seconds, commands]).astype(np.float32), valid
