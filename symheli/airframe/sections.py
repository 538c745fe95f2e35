"""The sections every airframe has, and the entries each section of a vehicle file takes."""

from __future__ import annotations

from dataclasses import replace

from symheli.components import Component, Entry

BODY = {
    "mass": Entry("kg", "mass in flight", "m", "mass", positive=True),
    "Ixx": Entry("kg m^2", "moment of inertia in roll", "I_{xx}", "inertia", positive=True),
    "Iyy": Entry("kg m^2", "moment of inertia in pitch", "I_{yy}", "inertia", positive=True),
    "Izz": Entry("kg m^2", "moment of inertia in yaw", "I_{zz}", "inertia", positive=True),
}
DRIVETRAIN = {
    "nominal_speed": Entry(
        "rad/s", "commanded main-rotor speed", r"\Omega_{nom}", "rotor speed", positive=True
    ),
    "inertia": Entry(
        "kg m^2",
        "inertia of all that turns, referred to the main shaft",
        "I_{rot}",
        "inertia",
        positive=True,
    ),
    "max_power": Entry(
        "W", "power of the engine at full throttle", "P_{max}", "power", positive=True
    ),
    "governor_kp": Entry(
        "s/rad", "throttle (0 to 1) by error of rotor speed", "K_p", "governor gain"
    ),
    "governor_ki": Entry(
        "1/rad", "throttle (0 to 1) by integrated error of rotor speed", "K_i", "governor gain"
    ),
}
CONTROLS = {
    "d_lon": Entry(
        "rad",
        "travel of longitudinal cyclic to either side",
        r"\delta_{lon}",
        "angle",
        positive=True,
    ),
    "d_lat": Entry(
        "rad", "travel of lateral cyclic to either side", r"\delta_{lat}", "angle", positive=True
    ),
    "d_col": Entry(
        "rad", "largest collective pitch of the blades", r"\delta_{col}", "angle", positive=True
    ),
    "d_ped": Entry(
        "rad", "largest pitch of the tail-rotor blades", r"\delta_{ped}", "angle", positive=True
    ),
}
FIXED = {"body": BODY, "drivetrain": DRIVETRAIN, "controls": CONTROLS}
"""Sections of every airframe, {entry: its description}; every other section is a component."""

PLACE = {
    axis: Entry(
        "m",
        f"reference point from the centre of gravity, {toward}",
        kind="distance",
        optional=True,
    )
    for axis, toward in (("x", "forward"), ("y", "right"), ("z", "down"))
}
"""Entries of a component's section: the position of its reference point, body axes."""


def required_place(component: Component) -> dict[str, Entry]:
    """Return the entries of the place that a component cannot do without."""
    return {axis: replace(PLACE[axis], optional=False) for axis in component.place}
