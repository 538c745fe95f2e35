"""Options that several verbs share."""

from __future__ import annotations

import argparse
import math
import tomllib
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.commands.arguments import Argument, flag, option, positional, several
from studies.output import Output
from symheli.airframe.printed_forms import PRINTED
from symheli.errors import InputError
from symheli.values.whole_files import write_text

if TYPE_CHECKING:
    from studies.live.identifier import LiveIdentifier
    from studies.live.sample import Source
    from studies.live.watch import Watch
    from symheli import Helicopter
    from symheli.steady.equilibrium import TrimPoint

STANDARD_OUTPUT = "-"
"""Place that choices are written to without a file."""

PICTURES = (".png", ".svg", ".pdf")


def number(text: str) -> float:
    """A finite number."""
    value = _float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, got {text!r}")
    return value


def positive(text: str) -> float:
    """A finite number > 0."""
    value = number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"expected a number > 0, got {text!r}")
    return value


def rate(text: str) -> float:
    """A number >= 0, or inf."""
    value = _float(text)
    if not value >= 0:
        raise argparse.ArgumentTypeError(f"expected a number >= 0 or inf, got {text!r}")
    return value


def fraction(text: str) -> float:
    """A number in (0, 1]."""
    value = number(text)
    if not 0 < value <= 1:
        raise argparse.ArgumentTypeError(f"expected a fraction in (0, 1], got {text!r}")
    return value


def count(text: str) -> int:
    """A whole number >= 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"expected a whole number >= 0, got {text!r}")
    return int(text)


def at_least_one(text: str) -> int:
    """A whole number >= 1."""
    value = count(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1, got {text!r}")
    return value


def names(text: str) -> tuple[str, ...]:
    """a,b,c"""
    found = tuple(part.strip() for part in text.split(","))
    if not all(found):
        raise argparse.ArgumentTypeError(f"expected names with commas between them, got {text!r}")
    return found


def picture(text: str) -> Path:
    """Return the path of a plot in a format that matplotlib can write."""
    path = Path(text)
    if path.suffix.lower() not in PICTURES:
        raise argparse.ArgumentTypeError(
            f"expected a file that ends in {', '.join(PICTURES)}, got {text!r}"
        )
    return path


def model_file(text: str) -> Path:
    """A file for an identified model."""
    path = Path(text)
    if path.suffix not in (".json", ".mat"):
        raise argparse.ArgumentTypeError(
            f"expected a file that ends in .json or .mat, got {text!r}"
        )
    return path


def unit(text: str) -> tuple[str, str]:
    """name=unit"""
    name, sign, value = text.partition("=")
    if not (name and sign and value):
        raise argparse.ArgumentTypeError(f"expected name=unit such as q=deg/s, got {text!r}")
    return name, value


def assignment(text: str) -> tuple[str, float]:
    """name=number"""
    name, sign, value = text.partition("=")
    if not (name and sign and value):
        raise argparse.ArgumentTypeError(f"expected NAME=NUMBER, got {text!r}")
    return name.strip(), number(value)


def feedback(text: str) -> tuple[tuple[str, str], float]:
    """input=output:gain"""
    pair, colon, gain = text.rpartition(":")
    to, sign, of = pair.partition("=")
    if not (colon and to and sign and of):
        raise argparse.ArgumentTypeError(
            f"expected input=output:gain such as d_lat=phi:-0.03, got {text!r}"
        )
    return (to, of), number(gain)


def _float(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}") from error


class _Span(argparse.Action):
    """Refuses a range that does not increase or has no points."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        low, high, points = values
        if points != int(points) or points < 1 or low > high or (points > 1 and low == high):
            parser.error(
                f"argument {option_string}: expected LOW < HIGH and a whole number of points, got"
                f" {low:g} {high:g} {points:g}"
            )
        setattr(namespace, self.dest, (low, high, int(points)))


ALLOW_CODE = flag(
    "--allow-code", "run the Python files that the file names (parts of a vehicle, a trial)"
)


def page(what: str) -> tuple[Argument, ...]:
    """The option that shows something on a page in a browser."""
    return (
        option(
            "--page",
            "PORT",
            f"show {what} in a browser on this machine, at the printed address (default port: the"
            " first free one from 8400)",
            port,
            nargs="?",
            const=0,
        ),
    )


def on_page(
    port: int | None, identifier: LiveIdentifier, found: Source, vehicle: str | None
) -> AbstractContextManager[list[Callable[[Watch], None]]]:
    """Return the context of what looks at a watch: a page at a port, beside a `vehicle`, where one
    is given; else nothing.
    """
    if port is None:
        return nullcontext([])
    from studies.page.live_page import watched

    return watched(port, identifier, found, vehicle)


def port(text: str) -> int:
    """A port that needs no rights."""
    value = count(text)
    if not 1024 <= value < 2**16:
        raise argparse.ArgumentTypeError(f"expected a port from 1024 to 65535, got {text!r}")
    return value


class _OneVehicle(argparse.Action):
    """Takes the vehicle from its place or from --vehicle, and refuses two different ones."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        if values is None:  # its place is empty
            return
        before = getattr(namespace, "named_vehicle", None)
        if before not in (None, values):
            parser.error(f"two vehicles are given, {before} and {values}: give one")
        namespace.named_vehicle = namespace.vehicle = values


def vehicle(default: str | None = "xcell60", help: str = "", in_place: bool = True) -> tuple:
    """The vehicle of a verb, as argument (where its place is free) or as --vehicle, and
    --allow-code.
    """
    help = help or "packaged airframe or TOML file"
    named = option("--vehicle", "NAME", help, default=default, action=_OneVehicle)
    place = positional(
        "vehicle", "the same as --vehicle", nargs="?", metavar="VEHICLE", action=_OneVehicle
    )
    return (named, *([place] if in_place else []), ALLOW_CODE)


HELICOPTER = (
    *vehicle(),
    option(
        "--governor",
        ("ideal", "pi"),
        "ideal: rotor speed held exactly; pi: engine and governor",
        default="ideal",
    ),
    option(
        "--printed",
        "A,B",
        "equations as the source prints them, where this project found the print wrong or ambiguous"
        f" and departs from it: any of {', '.join(PRINTED)} (default: none; docs/model.md has the"
        " reasons)",
        names,
        (),
    ),
)

CONDITION = (
    option("--airspeed", "M/S", "true airspeed, m/s (default: hover)", number, 0.0),
    option("--climb-rate", "M/S", "m/s, up (default: level)", number, 0.0),
    option("--turn-rate", "RAD/S", "rad/s, to the right (default: none)", number, 0.0),
    option("--altitude", "M", "in the standard atmosphere, m (default: sea-level density)", number),
    option(
        "--sideslip-deg",
        "DEG",
        "degrees, airspeed from the right; 180: rearward (default: 0)",
        number,
        0.0,
    ),
)
"""Options of the steady flight to trim."""

ON_A_RUNNER = (
    option(
        "--workers",
        "N",
        "number of processes on this machine, one thread each (default: one per core; 1: in this"
        " process)",
        at_least_one,
    ),
    option(
        "--scheduler",
        "ADDRESS",
        "address of a dask.distributed scheduler to run on, such as tcp://10.0.0.5:8786",
    ),
    option(
        "--out",
        "DIR.zarr",
        "folder of the dataset of cases; cases already there are not computed again",
        Path,
    ),
)
"""The place where a campaign runs, and the one where its cases are kept."""


def write_config(what: str) -> Argument:
    """--write-config of a command that takes a file of choices."""
    help = f"write {what} with the defaults (default: to standard output); run nothing"
    return option("--write-config", "FILE", help, nargs="?", const=STANDARD_OUTPUT)


def span(name: str, default: tuple[float, float], points: int, what: str) -> Argument:
    """LOW HIGH N: a range of speeds in m/s with its number of points."""
    low, high = default
    help = f"{what}, m/s, and how many (default: {low:g} {high:g} {points})"
    metavar = ("LOW", "HIGH", "N")
    return several(name, metavar, help, type=number, action=_Span, default=(low, high, points))


def kept_on_a_runner(arguments: argparse.Namespace) -> str:
    """Return a message on the finished part of an interrupted campaign."""
    if arguments.out:
        return f"what was finished is in {arguments.out}: the same command goes on from there"
    return "what was finished is kept where --out or a file of a campaign says so"


def choices_written(text: Callable[[Path], str], target: str) -> Output:
    """The choices, whose `text` is that of a file in a folder, to a new file or to standard output.

    Raises `InputError` for a file that is there.
    """
    if target == STANDARD_OUTPUT:
        shown = text(Path())
        return Output(shown.rstrip("\n"), {"configuration": shown})
    path = Path(target)
    if path.exists():
        raise InputError(f"{path} already exists; give another name, or remove it")
    write_text(path, text(path.parent))
    return Output(f"wrote {path}", {"written": path})


def file_or_vehicle(arguments: argparse.Namespace) -> None:
    """Take what stands in the place of the file of choices as the vehicle, where it is one.

    Raises `InputError` where --vehicle names another.
    """
    from symheli.airframe.vehicle import vehicles

    given = arguments.file
    if given is None or not (str(given) in vehicles() or _is_a_vehicle(given)):
        return
    if arguments.vehicle not in (None, str(given)):
        raise InputError(
            f"two vehicles are given, {given} and {arguments.vehicle}: give one, or a file of"
            " choices"
        )
    arguments.vehicle, arguments.file = str(given), None


def _is_a_vehicle(path: Path) -> bool:
    try:
        return "body" in tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False  # whoever reads it says what is wrong


def refuse(arguments: argparse.Namespace, names: Iterable[str], why: str) -> None:
    """Raise `InputError` where one of these options is given another value than its default; `why`
    says for what it has no effect.
    """
    given = [n for n in names if getattr(arguments, n) != arguments.default_of(n)]
    if given:
        listed = ", ".join(f"--{name.replace('_', '-')}" for name in given)
        raise InputError(f"{listed}: no effect {why}; leave it out")


OF_A_VEHICLE = ("vehicle", "governor", "printed")
"""Options without effect where a model comes from a file."""


def helicopter(arguments: argparse.Namespace) -> Helicopter:
    """The helicopter of --vehicle, --governor and --printed."""
    from symheli import Helicopter

    return Helicopter.load(
        arguments.vehicle, governor=arguments.governor, printed=arguments.printed
    )


def trimmed(arguments: argparse.Namespace) -> tuple[Helicopter, TrimPoint]:
    """The helicopter and its trim at the flight condition of the options."""
    from symheli import trim

    speed, climb = arguments.airspeed, arguments.climb_rate
    if speed < 0:
        raise InputError(
            f"--airspeed must be >= 0 m/s, got {speed:g}; rearward flight is --airspeed"
            f" {-speed:g} --sideslip-deg 180"
        )
    if abs(arguments.sideslip_deg) > 360:
        raise InputError(
            f"--sideslip-deg {arguments.sideslip_deg:g} is beyond a full circle: give -180 to 180"
        )
    if abs(climb) > speed:
        raise InputError(
            f"--climb-rate {climb:g} exceeds the --airspeed of {speed:g} m/s of the total velocity;"
            f" straight {'up' if climb > 0 else 'down'} is --airspeed {abs(climb):g} --climb-rate"
            f" {climb:g}"
        )
    heli = helicopter(arguments)
    point = trim(
        heli,
        arguments.airspeed,
        climb_rate=arguments.climb_rate,
        turn_rate=arguments.turn_rate,
        sideslip=math.radians(arguments.sideslip_deg),
        altitude=arguments.altitude,
    )
    return heli, point


def named(vector: Any) -> dict[str, dict[str, Any]]:
    """{name: {value, unit}} of a named vector."""
    return {
        str(s): {"value": float(v), "unit": s.unit}
        for s, v in zip(vector.signals, vector.array, strict=True)
    }
