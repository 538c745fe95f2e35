"""A flight computed here that an exported controller must reproduce."""

from __future__ import annotations

import numpy as np

from symheli.flight.table_controller import TableController
from symheli.values.arrays import Array
from symheli.values.c_text import define, rows, table

SAMPLES = 240
TOLERANCE = 1e-5
"""Of the largest command of an axis: what a compiler that contracts products and sums may make of
32-bit numbers.
"""
SIZES = (0.01, 0.1, 10.0)
"""Of what is measured, in turn: far within the limits of a command, about them, beyond them."""
RESET, ENTER = 1, 2


def cases(controller: TableController, up: str) -> str:
    """A flight from a fixed seed as C tables: any size of error, jumps of the parameter and bad
    ones, resets, entries, axes flown by others.
    """
    own, state, rng = controller, controller.init(), np.random.default_rng(0)
    nu, ny = len(own.inputs), len(own.outputs)
    events, axes, valid, status = (np.zeros(SAMPLES, int) for _ in range(4))
    given = np.zeros((SAMPLES, 2 * nu + 2 * ny + 1), np.float32)
    expected = np.zeros((SAMPLES, ny), np.float32)
    parameter = _parameter(rng, float(own.knots[0]), float(own.knots[-1]))
    for k in range(SAMPLES):
        block = k // 20
        draw = SIZES[block % len(SIZES)] * rng.standard_normal(2 * nu)
        given[k] = *draw, *(0.1 * rng.standard_normal(2 * ny)), parameter[k]
        events[k] = {0: RESET, 1: ENTER}.get(k % 47, 0)
        axes[k] = (1 << ny) - 1 if block % 4 else rng.integers(1 << ny)
        valid[k] = rng.random() > 0.05
        if k % 71 == 70:
            given[k, 0] = np.nan
        measured, reference, trim, others = np.split(given[k, :-1], np.cumsum([nu, nu, ny]))
        if events[k]:
            state = own.init(others if events[k] == ENTER else None)
        state = own.fly_axes(state, [y for i, y in enumerate(own.outputs) if axes[k] >> i & 1])
        expected[k], state = own.update(
            state, measured, reference, trim, given[k, -1], valid=bool(valid[k]), others=others
        )
        status[k] = state.status
    return "\n".join(
        [
            define("SAMPLES", SAMPLES),
            define("TOLERANCE", f"{TOLERANCE:g}"),
            *(
                table("int", name, values.tolist())
                for name, values in (
                    ("events", events),
                    ("axes", axes),
                    ("valid", valid),
                    ("status", status),
                )
            ),
            rows("float", "given", str(given.shape[1]), given, np.float32),
            rows("float", "expected", f"{up}NY", expected, np.float32),
        ]
    )


def _parameter(rng: np.random.Generator, low: float, high: float) -> Array:
    """Over the whole range and beyond its ends, slow, stuck and fast, and none."""
    wave = np.sin(0.05 * np.arange(SAMPLES)) + 0.02 * rng.standard_normal(SAMPLES)
    p = 0.5 * (low + high) + 0.6 * (high - low) * wave
    p[40:60] = p[40]
    p[100:130] = np.nan
    p[160] = high + 10 * (high - low)
    p[200:] = rng.uniform(low, high, SAMPLES - 200)
    return p
