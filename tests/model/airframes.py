"""Vehicle files for tests: the packaged X-Cell with something changed, written where a user would."""

from __future__ import annotations

import re
from importlib import resources

XCELL = (resources.files("symheli.vehicles") / "xcell60.toml").read_text(encoding="utf-8")


def write(folder, *sections, name="mine.toml", **changes):
    """The X-Cell's file with `sections` appended and {entry line: other text} replaced; its path."""
    text = XCELL
    for old, new in changes.get("replace", {}).items():
        assert len(re.findall(re.escape(old), text)) >= 1, f"{old!r} is not in the file"
        text = text.replace(old, new)
    path = folder / name
    path.write_text("\n".join((text, *sections)), encoding="utf-8")
    return path


WING_COMPONENT = '''
"""A small wing: lift along z, in linear attached flow."""

from symheli.components import Component, Effect


def evaluate(par, motion, controls, own, flow):
    """Z = -0.5 rho S C_La u_a w_a."""
    return Effect(force=(0.0, 0.0, -0.5 * motion.rho * par.area * par.lift_slope * motion.u_a * motion.w_a))


COMPONENT = Component(evaluate, parameters={"area": "m^2", "lift_slope": "1/rad"}, positive=("lift_slope",))
'''

WING = """
[wing]
component = "./wing.py"
area = { value = 0.3, unit = "m^2", source = "test" }
lift_slope = { value = 4.5, unit = "1/rad", source = "test" }
"""

AFT_ROTOR = """
[aft_rotor]
component = "main_rotor"
controls = { d_col = { d_col = 1.0, d_lon = -0.5 } }
x = { value = -0.4, unit = "m", source = "test" }
radius = { ref = "main_rotor.radius" }
chord = { ref = "main_rotor.chord" }
lift_slope = { ref = "main_rotor.lift_slope" }
profile_drag = { ref = "main_rotor.profile_drag" }
ct_max = { ref = "main_rotor.ct_max" }
hub_height = { ref = "main_rotor.hub_height" }
hub_stiffness = { ref = "main_rotor.hub_stiffness" }
bar_lock_number = { ref = "main_rotor.bar_lock_number" }
lateral_gain = { ref = "main_rotor.lateral_gain" }
longitudinal_gain = { ref = "main_rotor.longitudinal_gain" }
flapping_fraction = { ref = "main_rotor.flapping_fraction" }
nominal_speed = { ref = "drivetrain.nominal_speed" }
inflow_efficiency = { ref = "main_rotor.inflow_efficiency" }
"""

FORWARD = """
[main_rotor]
controls = { d_col = { d_col = 1.0, d_lon = 0.5 } }
x = { value = 0.4, unit = "m", source = "test" }
"""
