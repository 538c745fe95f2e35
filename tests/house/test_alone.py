"""What works without what: the tests of a ring with every other ring absent, the libraries without
what only the study needs.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from evidence.house import table

ROOT = Path(__file__).resolve().parents[2]
OF_THE_STUDY = ("jinja2", "markupsafe", "rich")
"""Packages of the report and of the terminal. Pillow is another; python-control imports it."""
LIBRARIES = ("symheli", "identification", "synthesis")
RINGS = [room.name for room in table()["synthesis"] if room.ring]


def run(arguments, blocked):
    """Run Python with these modules blocked."""
    paths = [str(ROOT), str(ROOT / "tests" / "house")]
    environment = os.environ | {"BLOCKED": ",".join(blocked), "PYTHONPATH": os.pathsep.join(paths)}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    return done.stdout


def passes(tests, blocked):
    """Whether the default tests of these folders pass without the blocked modules."""
    plugins = ["-p", "no:cacheprovider", "-p", "without", "-p", "no:xdist"]
    run(["-m", "pytest", "-q", "-x", *plugins, *tests], blocked)


@pytest.mark.slow
@pytest.mark.parametrize("ring", RINGS)
def test_the_tests_of_a_ring_pass_without_the_other_rings(ring):
    folder = "tests/synthesis/" + ring.rpartition(".")[2]
    passes([folder], [other for other in RINGS if other != ring])


IMPORTED = """
import importlib, pkgutil, without
for name in LIBRARIES:
    package = importlib.import_module(name)
    for found in pkgutil.walk_packages(package.__path__, f"{name}."):
        if not found.name.endswith("__main__"):
            importlib.import_module(found.name)
            print(found.name)
"""


@pytest.mark.guard
def test_every_module_of_the_libraries_is_imported_without_what_the_study_needs():
    program = f"LIBRARIES = {LIBRARIES}\n{IMPORTED}"
    found = run(["-c", program], (*OF_THE_STUDY, "PIL", "studies", "evidence"))
    assert {f"{name}." in found for name in LIBRARIES} == {True}


@pytest.mark.slow
def test_the_tests_of_the_libraries_pass_without_what_the_study_needs():
    passes(["tests/identification", "tests/lpv", "tests/model"], OF_THE_STUDY)
