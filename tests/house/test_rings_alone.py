"""The tests of a ring pass with every other ring absent, and those below with all of them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from evidence.house import table

ROOT = Path(__file__).resolve().parents[2]
RINGS = [room.name for room in table()["synthesis"] if room.ring]


def passes(tests, blocked):
    """Whether the default tests of these folders pass without the blocked rings."""
    environment = {
        **os.environ,
        "BLOCKED_RINGS": ",".join(blocked),
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests" / "house")]),
    }
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    command += ["-p", "without_rings", "-p", "no:xdist", *tests]
    run = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-1000:]


@pytest.mark.slow
@pytest.mark.parametrize("ring", RINGS)
def test_the_tests_of_a_ring_pass_without_the_other_rings(ring):
    folder = "tests/synthesis/" + ring.rpartition(".")[2]
    passes([folder], [other for other in RINGS if other != ring])
