"""Vehicle files for tests: the packaged X-Cell with something changed, written where a user
would.
"""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path

XCELL = (resources.files("symheli.airframe.vehicles") / "xcell60.toml").read_text(encoding="utf-8")


def write(folder, *sections, name="mine.toml", **changes):
    """The X-Cell's file with `sections` appended and {entry line: other text} replaced; its
    path.
    """
    text = XCELL
    for old, new in changes.get("replace", {}).items():
        assert len(re.findall(re.escape(old), text)) >= 1, f"{old!r} is not in the file"
        text = text.replace(old, new)
    path = folder / name
    path.write_text("\n".join((text, *sections)), encoding="utf-8")
    return path


DOCS = (Path(__file__).resolve().parents[2] / "docs" / "vehicles.md").read_text(encoding="utf-8")
WING_COMPONENT, WING = (
    re.findall(rf"```{language}\n(.*?)```", DOCS, re.DOTALL)[0] for language in ("python", "toml")
)
"""The wing of the documentation, so that it is known to work."""

AFT_ROTOR = """
[aft_rotor]
component = "main_rotor"
controls = { d_col = { d_col = 1.0, d_lon = -0.5 } }
x = { value = -0.4, unit = "m", source = "test" }
radius = { ref = "main_rotor.radius" }
chord = { ref = "main_rotor.chord" }
blades = { ref = "main_rotor.blades" }
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
