"""Models from files instead of a vehicle: what `symheli identify --save` keeps, and families of
matrices.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.commands import options
from symheli.errors import InputError

if TYPE_CHECKING:
    from identification import KinematicModel, LPVARXModel
    from symheli import LPVStateSpace
    from symheli.lpv import LinearFamily

    Given = LPVARXModel | KinematicModel | LinearFamily

FAMILY = "symheli linear models"
KINDS = (
    "a model of symheli identify --save, or a family of linear models (LinearFamily.save, or a JSON"
    " or NPZ file as symheli.lpv.family_file describes)"
)


def configure(parser: argparse.ArgumentParser, channels: bool = True) -> None:
    """--model with what it keeps and its loop; with `channels` those that a gain is of."""
    group = parser.add_argument_group("model from a file, instead of a vehicle")
    group.add_argument("--model", type=Path, metavar="FILE", help=KINDS)
    group.add_argument(
        "--states",
        type=options.names,
        metavar="A,B",
        help="states of a family to keep, in this order",
    )
    if channels:
        for name, way in (("inputs", "from"), ("outputs", "to")):
            words = f"the gain is {way} these (default: all)"
            group.add_argument(f"--{name}", type=options.names, metavar="A,B", help=words)
    parser.add_argument(
        "--degree",
        type=options.at_least_one,
        default=3,
        metavar="D",
        help="degree of the interpolation (default: %(default)s)",
    )
    parser.add_argument(
        "--feedback",
        type=options.feedback,
        action="append",
        default=[],
        metavar="IN=OUT:GAIN",
        help="feedback gain to close, such as d_lat=phi:-0.02; may be repeated",
    )


def read(path: Path) -> Given:
    """The model in a file, whichever it is; raises `InputError` for another."""
    from identification import KinematicModel, LPVARXModel
    from symheli.lpv import LinearFamily

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
    from symheli.lpv import LinearFamily

    given = read(arguments.model)
    if isinstance(given, LinearFamily):
        return given.select(arguments.states).interpolate("polynomial", arguments.degree)
    if arguments.states:
        raise InputError("--states selects states of a family; an identified model keeps its own")
    return given.to_state_space()


def closed_loop(arguments: argparse.Namespace, lpv: LPVStateSpace) -> LPVStateSpace:
    """`lpv` with the loops of --feedback closed, from --inputs to --outputs."""
    return lpv.feedback(dict(arguments.feedback)).select(
        inputs=arguments.inputs, outputs=arguments.outputs
    )


def only_with_a_model(arguments: argparse.Namespace) -> None:
    """Raises `InputError` for options that say something of --model where none is given."""
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
