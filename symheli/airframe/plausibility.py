"""What no airframe can be: a negative mass, inertias that belong to no body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations

from symheli.airframe.part import Part
from symheli.airframe.quantity import Quantity

POSITIVE = {
    "body": ("mass", "Ixx", "Iyy", "Izz"),
    "drivetrain": ("nominal_speed", "inertia", "max_power"),
    "controls": ("d_lon", "d_lat", "d_col", "d_ped"),
}


def impossibilities(
    sections: Mapping[str, Mapping[str, Quantity]], parts: Mapping[str, Part]
) -> Iterator[tuple[str, str, str]]:
    """(section, entry, what is wrong) of every quantity that cannot be."""
    for section, entries in sections.items():
        positive = POSITIVE.get(section) or parts[section].positive
        counts = parts[section].counts if section in parts else {}
        for entry, q in entries.items():
            if entry in positive and not q.value > 0:
                yield section, entry, f"must be > 0 {q.unit}, got {q.value:g}"
            elif entry in counts and not (q.value >= counts[entry] and q.value == int(q.value)):
                yield section, entry, f"must be a whole number >= {counts[entry]}, got {q.value:g}"
            elif q.unit == "m^2" and q.value < 0:
                yield section, entry, f"an area must be >= 0 m^2, got {q.value:g}"
    inertia = {axis: sections["body"][axis].value for axis in ("Ixx", "Iyy", "Izz")}
    for largest, *others in permutations(inertia):
        both = sum(inertia[axis] for axis in others)
        if others == sorted(others) and inertia[largest] > both * (1 + 1e-12):
            yield (
                "body",
                largest,
                (
                    f"no body has {largest} = {inertia[largest]:g} > {' + '.join(others)} ="
                    f" {both:g} kg m^2"
                ),
            )
