"""symheli linearize: the exact linear model about a trim."""

from __future__ import annotations

import argparse

from studies.commands import options
from studies.output import Output, columns
from symheli.values.aligned import matrix

HELP = "linear model about a trim: A, B with names, poles"

ARGUMENTS = (
    *options.HELICOPTER,
    *options.CONDITION,
)


def run(arguments: argparse.Namespace) -> Output:
    """Trim, linearize, show A, B and the poles."""
    from symheli import linearize

    heli, point = options.trimmed(arguments)
    lin = linearize(heli, point)
    poles = sorted(lin.poles(), key=lambda z: (abs(z), z.imag))
    text = "\n\n".join(
        (
            point.outcome,
            "A (rows: derivative of the state, SI and radians)\n"
            + matrix(lin.A, lin.states, lin.states),
            "B\n" + matrix(lin.B, lin.states, lin.inputs),
            "poles\n" + _poles([z for z in poles if z.imag >= 0]),
            "stable" if lin.is_stable() else "not stable",
        )
    )
    data = {
        "status": point.outcome,
        "A": lin.A,
        "B": lin.B,
        "states": [str(s) for s in lin.states],
        "inputs": [str(s) for s in lin.inputs],
        "units": {str(s): s.unit for s in (*lin.states, *lin.inputs)},
        "poles_rad_per_s": poles,
        "stable": lin.is_stable(),
    }
    return Output(text, data)


def _poles(poles: list) -> str:
    head = ["real, 1/s", "imaginary, rad/s", "frequency, rad/s", "damping ratio"]
    body = [
        [
            f"{z.real:.5g}",
            f"+-{z.imag:.5g}" if z.imag > 0 else "0",
            f"{abs(z):.5g}",
            f"{-z.real / abs(z):.4f}" if abs(z) else "-",
        ]
        for z in poles
    ]
    return columns([head, *body], left=0)
