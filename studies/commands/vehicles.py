"""symheli vehicles: which airframes come along, and a file to start from."""

from __future__ import annotations

import argparse
from pathlib import Path

from studies.commands import options
from studies.commands.arguments import flag, one_of, option
from studies.output import Output
from symheli.values.whole_files import write_text

HELP = (
    "list the packaged airframes and identified models, their sources, and how much of each is"
    " assumed; print a vehicle file to start from, or the reference of its entries"
)

ARGUMENTS = (
    *options.vehicle(None, "packaged airframe or vehicle file to check and summarise"),
    one_of(
        flag("--toml", "print a whole vehicle file to start from (default: that of xcell60)"),
        flag(
            "--reference",
            "print every part and entry of a vehicle file: meaning, units, plausible range",
        ),
    ),
    option("--write", "PAGE", "write the reference into its section of this page", Path),
)


def run(arguments: argparse.Namespace) -> Output:
    """List name, title, source and assumptions of each vehicle; or print a vehicle file, or the
    reference.
    """
    from symheli.airframe.vehicle import load_vehicle
    from symheli.airframe.written import as_toml, reference, with_reference
    from symheli.helicopter import Helicopter
    from symheli.steady.validity import Validity, warn

    if arguments.reference:
        options.refuse(arguments, ["vehicle"], "on the reference, which is that of every vehicle")
        text = reference()
        if arguments.write:
            write_text(arguments.write, with_reference(arguments.write.read_text("utf-8")))
            return Output(f"wrote {arguments.write}", {"written": arguments.write})
        return Output(text.rstrip("\n"), {"reference": text})
    options.refuse(arguments, ["write"], "without --reference")
    if arguments.toml:
        text = as_toml(load_vehicle(arguments.vehicle or "xcell60"))
        return Output(text.rstrip("\n"), {"toml": text})
    if arguments.vehicle:
        v = load_vehicle(arguments.vehicle)
        warn(Validity.of(Helicopter(v)).in_hover())
        listed = (v.name, v.title, v.source, len(v.quantities), v.assumed)
        return Output(_lines(listed), _data(listed))
    return _list()


def _list() -> Output:
    """Everything that comes along."""
    from symheli.airframe.identified_models import identified_model, identified_models
    from symheli.airframe.vehicle import load_vehicle, vehicles

    airframes = [
        (name, v.title, v.source, len(v.quantities), v.assumed)
        for name in vehicles()
        for v in [load_vehicle(name)]
    ]
    models = [
        (name, m.title, m.source, len(m.parameters), m.assumed)
        for name in identified_models()
        for m in [identified_model(name)]
    ]
    text = "\n".join(
        [
            "airframes (symheli.Helicopter.load)",
            *map(_lines, airframes),
            "linear models (symheli.airframe.identified_model)",
            *map(_lines, models),
        ]
    )
    return Output(
        text,
        {"vehicles": list(map(_data, airframes)), "identified_models": list(map(_data, models))},
    )


Listed = tuple[str, str, str, int, list[str]]


def _lines(listed: Listed) -> str:
    name, title, source, count, assumed = listed
    note = f"{len(assumed)} assumed: {', '.join(assumed)}" if assumed else "none assumed"
    return f"  {name}\n    {title}\n    source: {source}\n    {count} numbers, {note}"


def _data(listed: Listed) -> dict[str, object]:
    return dict(zip(("name", "title", "source", "numbers", "assumed"), listed, strict=True))
