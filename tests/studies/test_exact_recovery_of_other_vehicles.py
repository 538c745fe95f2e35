"""The study's exact recovery, for a vehicle file of one's own."""

import re
from pathlib import Path

import numpy as np
import pytest

import symheli
from studies.transition.recovery import recover


@pytest.mark.slow(but="8.2")
@pytest.mark.parametrize("mass", [8.2, 9.5])
def test_matrices_come_back_for_another_helicopter(tmp_path, mass):
    """Rounding that was left of samples explained whole once became rows of no number, for one mass
    and not for another.
    """
    packaged = Path(symheli.__file__).parent / "airframe" / "vehicles" / "xcell_kahn_hudson.toml"
    entry = f'mass = {{ value = {mass}, unit = "kg", source = "with a camera" }}'
    (tmp_path / "mine.toml").write_text(
        re.sub(r"(?m)^mass = .*", entry, packaged.read_text(encoding="utf-8")), encoding="utf-8"
    )
    family = symheli.sweep(
        symheli.Helicopter.load(tmp_path / "mine.toml", governor="ideal"),
        np.linspace(0.0, 13.0, 27),
    )
    found = recover(family)
    # identification is exact; the tolerance is that of the study's default vehicle
    assert found.A_error < 1e-11
    assert found.B_error < 1e-11
