"""symheli vehicles: which airframes come along."""

from __future__ import annotations

import argparse

from studies.output import Output

HELP = "list the packaged airframes, their titles and sources"


def configure(parser: argparse.ArgumentParser) -> None:
    """No options of its own."""


def run(arguments: argparse.Namespace) -> Output:
    """Name, title and source of each."""
    from symheli.vehicle import load_vehicle, vehicles

    found = [load_vehicle(name) for name in vehicles()]
    text = "\n".join(f"{v.name}\n    {v.title}\n    source: {v.source}" for v in found)
    return Output(text, {"vehicles": [{"name": v.name, "title": v.title, "source": v.source} for v in found]})
