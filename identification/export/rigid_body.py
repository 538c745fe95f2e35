"""Kinematics of a rigid body as C99, for one sample period."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from identification.export.checked import number_type
from identification.model.kinematic_run import CORRECTIONS, STEEP
from identification.model.prediction import DIVERGED
from symheli.export.c_program import filled
from symheli.export.c_text import literals
from symheli.values.kinematics import GRAVITY

HERE = Path(__file__).parent
REALS = {"double": "double", "single": "float"}


def rigid_body_files(
    name: str, dt: float, precision: Literal["double", "single"]
) -> dict[str, str]:
    """NAME_body.h and NAME_body.c by file name, to write out."""
    dtype = number_type(precision)
    bound = DIVERGED if precision == "double" else 1e18  # squares overflow beyond
    constants = {
        "GRAVITY": GRAVITY,
        "HALF_PERIOD": 0.5 * dt,
        "DIVERGED": bound,
        "STEEP": float(STEEP),
    }
    lines = [
        f"static const real {key} = {literals([value], dtype)[0]};"
        for key, value in constants.items()
    ]
    names = {"body_": f"{name}_body_"}
    places = {
        "guard": f"{name.upper()}_BODY_H",
        "real": REALS[precision],
        "corrections": CORRECTIONS,
    }
    text = "\n".join([*lines, f"enum {{ CORRECTIONS = {CORRECTIONS} }};"])
    return {
        f"{name}_body.h": filled(HERE / "rigid_body.h", places, names),
        f"{name}_body.c": filled(
            HERE / "rigid_body.c", {"constants": text}, names | {"body.": f"{name}_body."}
        ),
    }
