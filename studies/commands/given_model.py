"""Models from files instead of a vehicle: those of `symheli identify --save`, and families of
matrices.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.commands import options
from studies.commands.arguments import group, option
from symheli.errors import InputError

if TYPE_CHECKING:
    from identification.model import KinematicModel, LPVARXModel
    from symheli import LinearFamily, LPVStateSpace

    Given = LPVARXModel | KinematicModel | LinearFamily

FAMILY = "symheli linear models"
KINDS = (
    "a model of symheli identify --save, or a family of linear models (LinearFamily.save, or a JSON"
    " or NPZ file as symheli.lpv.family_file describes)"
)


FROM_A_FILE = "model from a file, instead of a vehicle"

MODEL = (
    option("--model", "FILE", KINDS, Path),
    option("--states", "A,B", "states of a family to keep, in this order", options.names),
)
CHANNELS = (
    option("--inputs", "A,B", "the gain is from these (default: all)", options.names),
    option("--outputs", "A,B", "the gain is to these (default: all)", options.names),
)
LOOP = (
    option("--degree", "D", "degree of the interpolation", options.at_least_one, 3),
    option(
        "--feedback",
        "IN=OUT:GAIN",
        "feedback gain to close, such as d_lat=phi:-0.02; may be repeated",
        options.feedback,
        [],
        action="append",
    ),
)

ARGUMENTS = (group(FROM_A_FILE, None, *MODEL, *CHANNELS), *LOOP)
WITHOUT_CHANNELS = (group(FROM_A_FILE, None, *MODEL), *LOOP)


def read(path: Path) -> Given:
    """The model in a file, whichever it is; raises `InputError` for another."""
    from identification.model import KinematicModel, LPVARXModel
    from symheli import LinearFamily

    kind = FAMILY if path.suffix == ".npz" else _schema(path)
    loaders: Mapping[str, Any] = {
        FAMILY: LinearFamily.load,
        "symheli LPV-ARX model": LPVARXModel.load,
        "symheli model with known kinematics": KinematicModel.load,
    }
    if kind not in loaders:
        raise InputError(f"{path}: expected {KINDS}, got {kind!r:.60}")
    return loaders[kind](path)


def lpv_model(arguments: argparse.Namespace) -> LPVStateSpace:
    """The LPV model of --model: a family interpolated entry by entry in --degree, an
    identified model as it is; with --states. Raises `InputError` for states of an identified model.
    """
    from symheli import LinearFamily

    given = read(arguments.model)
    if isinstance(given, LinearFamily):
        return given.select(arguments.states).interpolate("polynomial", arguments.degree)
    options.refuse(arguments, ["degree"], "on an identified model, which is not interpolated")
    if arguments.states:
        raise InputError("--states selects states of a family; an identified model keeps its own")
    return given.to_state_space()


def closed_loop(arguments: argparse.Namespace, lpv: LPVStateSpace) -> LPVStateSpace:
    """`lpv` with the loops of --feedback closed, from --inputs to --outputs."""
    return lpv.feedback(dict(arguments.feedback)).select(
        inputs=arguments.inputs, outputs=arguments.outputs
    )


def only_with_a_model(arguments: argparse.Namespace) -> None:
    """Raise `InputError` for options that need --model where none is given."""
    names = [n for n in ("states", "inputs", "outputs") if getattr(arguments, n, None)]
    if names and arguments.model is None:
        raise InputError(f"--{', --'.join(names)} need a model from a file: give --model FILE")


def words(gains: Mapping[tuple[str, str], float]) -> str:
    """A feedback as a reader would write it."""
    return ", ".join(f"{u} = {gain:g} {y}" for (u, y), gain in gains.items()) or "open loop"


def _schema(path: Path) -> str:
    try:
        whole = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError:
        raise InputError(f"{path}: expected {KINDS}") from None
    return str(whole.get("schema")) if isinstance(whole, dict) else type(whole).__name__
