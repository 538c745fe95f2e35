"""symheli vehicles: which airframes come along."""

from __future__ import annotations

import argparse

from studies.output import Output

HELP = (
    "list the packaged airframes and identified models, their sources, and how much of each is"
    " assumed"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """No options of its own."""


def run(arguments: argparse.Namespace) -> Output:
    """Name, title, source and assumptions of each."""
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
            "linear models (symheli.identified_model)",
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
