"""A sample of a controller of 10 states, 8 inputs and 4 outputs in a table of 33 airspeeds: the
exported C, the same bits in Python, 64-bit matrices in Python, and what one would write in NumPy.

The C code runs in a loop of its own, with limits reached and an airspeed that moves; a call from
Python adds what that costs and is listed too.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

import symheli  # noqa: E402
from benchmarks.race import Ratio, present, readable, table  # noqa: E402
from benchmarks.timing import arguments, medians  # noqa: E402
from symheli.codegen.compile import library  # noqa: E402
from symheli.export import write_controller  # noqa: E402
from symheli.flight.controller import MEASURED, SCHEDULING  # noqa: E402
from symheli.values import NamedVector, Signal, signals  # noqa: E402
from symheli.values.kinematics import INPUTS  # noqa: E402

ORDER, KNOTS, DT = 10, 33, 0.02
LOW, HIGH = 0.0, 13.0
SAMPLES = 1000
GOAL = 10e-6
"""Seconds of one sample in C."""
LOOP = """
void run(int count, const float *errors, const float *airspeeds, float *out)
{
    static const float zeros[CONTROLLER_NU], trim[CONTROLLER_NY];
    controller_state s;
    controller_init(&s);
    for (int k = 0; k < count; k++)
        controller_update(&s, errors + k * CONTROLLER_NU, zeros, trim, 0, airspeeds[k], 1,
                          out + k * CONTROLLER_NY);
}
"""


def controller() -> symheli.TableController:
    """Random, stable at every airspeed, its commands often at their limits."""
    rng = np.random.default_rng(0)
    basis = symheli.lpv.Polynomial(2, LOW, HIGH)
    shares = np.array([1.0, 0.2, 0.05])[:, None, None]
    nu, ny = len(MEASURED), len(INPUTS)
    A = 0.6 * shares * np.linalg.qr(rng.standard_normal((ORDER, ORDER)))[0]
    B, C, D = (
        0.1 * shares * rng.standard_normal((3, *shape))
        for shape in ((ORDER, nu), (ny, ORDER), (ny, nu))
    )
    model = symheli.LPVStateSpace(
        basis,
        A,
        B,
        C,
        D,
        (symheli.Scheduling("airspeed", "m/s", LOW, HIGH, 3.0),),
        signals(f"x{i}" for i in range(ORDER)),
        MEASURED,
        INPUTS,
        DT,
    )
    limits = dict.fromkeys(map(str, INPUTS), (-0.2, 0.2))
    return symheli.TableController.of(model, KNOTS, limits=limits)


class ByHand:
    """What one would write: rows of a table between its neighbours, and two products."""

    def __init__(self, table: symheli.TableController):
        n, own = table.order, table.order + len(table.inputs)
        self._n, self._knots = n, table.knots.astype(float)
        self._table, self._x = table.matrices[:, :, :own].astype(float), np.zeros(n)

    def step(self, error: np.ndarray, airspeed: float) -> np.ndarray:
        """Commands within their limits."""
        i = min(int(np.searchsorted(self._knots, airspeed, "right")) - 1, len(self._knots) - 2)
        w = (airspeed - self._knots[i]) / (self._knots[i + 1] - self._knots[i])
        M = (1 - w) * self._table[i] + w * self._table[i + 1]
        answer = M @ np.concatenate([self._x, error])
        self._x = answer[: self._n]
        return np.clip(answer[self._n :], -0.2, 0.2)


def updated(
    own: symheli.TableController, errors: np.ndarray, airspeeds: np.ndarray
) -> list[np.ndarray]:
    """Commands along errors, from the ground."""
    zeros, trim = np.zeros(len(MEASURED)), np.zeros(len(INPUTS))
    state, out = own.init(), []
    for e, V in zip(errors, airspeeds, strict=True):
        u, state = own.update(state, e, zeros, trim, V)
        out.append(u)
    return out


def stepped(
    own: symheli.flight.PureController,
    told: Sequence[NamedVector],
    reference: NamedVector,
    p: Sequence[NamedVector],
) -> None:
    """Every sample in turn, as in a flight."""
    state = own.init()
    for measured, at in zip(told, p, strict=True):
        _, state = own.step(state, measured, reference, at)


def in_c(own: symheli.TableController) -> ctypes.CDLL | None:
    """The exported code with a loop around it; None without a C compiler."""
    with TemporaryDirectory() as folder:
        header, source, _ = (file.read_text() for file in write_controller(own, folder))
    path = library(source.replace('#include "controller.h"', header) + LOOP, "controller")
    return None if path is None else ctypes.CDLL(str(path))


def main() -> None:
    """Measure, print, keep."""
    options = arguments(__doc__, write=True)
    own, rng = controller(), np.random.default_rng(1)
    errors = rng.standard_normal((SAMPLES, len(MEASURED))).astype(np.float32)
    airspeeds = (6.5 + 6.0 * np.sin(0.008 * np.arange(SAMPLES))).astype(np.float32)
    double, by_hand = own.in_double_precision, ByHand(own)
    told = [NamedVector((*MEASURED, Signal("airspeed")), np.append(e, 5.0)) for e in errors[:50]]
    reference = NamedVector((*MEASURED, *INPUTS), np.zeros(12))
    p = [NamedVector(SCHEDULING, np.array([V, 0.0])) for V in airspeeds[:50]]
    code, out = in_c(own), np.zeros((SAMPLES, len(INPUTS)), np.float32)
    at = [ctypes.c_void_p(a.ctypes.data) for a in (errors, airspeeds, out)]
    short = range(50)
    calls = {
        "the table in Python, 32 bits": (
            lambda: updated(own, errors[:50], airspeeds[:50]),
            50,
        ),
        "the table in Python, step of a flight": (
            lambda: stepped(own, told, reference, p),
            50,
        ),
        "ScheduledController.step": (
            lambda: stepped(double, told, reference, p),
            50,
        ),
        "by hand in NumPy, 64 bits": (
            lambda: [by_hand.step(errors[k], float(airspeeds[k])) for k in short],
            50,
        ),
    }
    if code is not None:
        calls["exported C"] = (lambda: code.run(SAMPLES, *at), SAMPLES)
        calls["exported C, each sample called from Python"] = (
            lambda: [code.run(1, *at) for _ in short],
            50,
        )
    spent = medians({name: call for name, (call, _) in calls.items()}, 1.0 if options.quick else 8)
    times = {name: spent[name] / count for name, (_, count) in calls.items()}
    ratios, notes = [], []
    if code is not None:
        c = times["exported C"]
        same = np.array(updated(own, errors, airspeeds))
        code.run(SAMPLES, *at)
        saturated = float((np.abs(out) == np.abs(out).max()).mean())
        notes.append(
            f"commands of the C code equal to the last bit: {(same == out).sum()} of {out.size};"
            f" {saturated:.0%} of them at a limit"
        )
        ratios = [
            Ratio("exported C / 10 us", c / GOAL, 1.0, at_most=True),
            Ratio("the table in Python / exported C", times["the table in Python, 32 bits"] / c),
            Ratio("ScheduledController.step / exported C", times["ScheduledController.step"] / c),
            Ratio("by hand in NumPy / exported C", times["by hand in NumPy, 64 bits"] / c),
        ]
    ratios.append(
        Ratio(
            "the table in Python / ScheduledController.step, in a flight",
            times["the table in Python, step of a flight"] / times["ScheduledController.step"],
        )
    )
    rows = [(name, readable(t)) for name, t in times.items()]
    shown = table("### One sample of a controller", rows, ("", "median"))
    present("controller step", options, [shown], ratios, notes)


if __name__ == "__main__":
    main()
