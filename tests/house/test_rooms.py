"""The rooms stand on floors: nothing below imports what is above, lazily or for types either."""

import subprocess
import sys

import pytest

from evidence import house as plan
from evidence import ratchets
from evidence.house import House, arrows, circles, outside, roomless, table, upward

pytestmark = pytest.mark.guard

RINGS = [room.name for room in table()["synthesis"] if room.ring]
LINES_OF_THE_PROOF = 8000


@pytest.fixture(scope="module")
def house():
    return House()


@pytest.mark.parametrize("package", plan.PACKAGES)
def test_no_room_imports_one_above_it(house, package):
    """And no ring another. The order is total, so that no circle of rooms can stand."""
    found = arrows(house, package)
    wrong = [place for arrow in upward(found) for place in found[arrow]]
    assert not wrong, "\n".join(wrong)


def test_every_file_lies_in_a_room(house):
    assert not roomless(house)


def test_a_package_sees_of_those_below_only_what_the_table_allows(house):
    wrong = outside(house)
    assert not wrong, "\n".join(wrong)


def test_no_import_runs_in_a_circle_of_files(house):
    assert not circles(house)


def test_every_ring_imports_with_the_other_rings_blocked(house):
    """All modules of a ring load without the others; one process forgets the rings in between."""
    own = {r: [m for m in house.files if m == r or m.startswith(f"{r}.")] for r in RINGS}
    code = f"""
import importlib, sys
from importlib.abc import MetaPathFinder

class Blocked(MetaPathFinder):
    own = ""
    def find_spec(self, name, path=None, target=None):
        around = [r for r in {RINGS} if name == r or name.startswith(r + ".")]
        if around and around != [self.own]:
            raise ImportError(name + " is blocked for " + self.own)

finder = Blocked()
sys.meta_path.insert(0, finder)
for ring, modules in {own}.items():
    finder.own = ring
    for name in [m for m in sys.modules if any(m.startswith(r) for r in {RINGS})]:
        del sys.modules[name]
    for module in modules:
        importlib.import_module(module)
"""
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_a_wrong_arrow_is_found(tmp_path):
    """An import upwards, lazily or for types, in a copy of one room of each package."""
    for name, text in {
        "symheli/errors.py": "def f():\n    from symheli.lpv.made import g\n    return g\n",
        "symheli/lpv/__init__.py": '"""Models."""\n',
        "symheli/lpv/made.py": "import symheli.errors\n",
        "synthesis/sets/__init__.py": "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from synthesis.tubes.made import T\n",
        "synthesis/tubes/made.py": "import studies.cli\n",
        "studies/cli.py": "",
    }.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    made = House(tmp_path)
    assert [a.name for a, _ in upward(arrows(made, "symheli"))] == ["symheli.errors"]
    assert [a.name for a, _ in upward(arrows(made, "synthesis"))] == ["synthesis.sets"]
    assert outside(made) == ["synthesis/tubes/made.py:1 imports studies.cli"]
    assert circles(made) == []  # the way back is lazy


def test_the_closure_of_the_proof_is_short_enough_to_be_read(house):
    """The verification and the reader of certificates, with everything that they import."""
    closure = house.closure(plan.PROOF)
    lines = house.lines(closure)
    print(f"a proof rests on {lines} lines in {len(closure)} files")
    assert lines <= LINES_OF_THE_PROOF


def test_the_page_of_the_rooms_is_written_from_the_table_that_the_tests_read():
    page = plan.PAGE.read_text(encoding="utf-8")
    assert page == plan.with_tables(page), "python -m evidence.house --write"


def test_no_number_rises_without_a_reason(house):
    """Old, new and reason are printed for what rose; a limit far above its number is no limit."""
    found, limits = ratchets.measured(house), ratchets.limits()
    assert found.keys() <= limits.keys()
    for name, limit in limits.items():
        old, new = limit.get("was", limit["limit"]), limit["limit"]
        if new > old:
            print(f"{name}: {old} -> {new}: {limit.get('reason', '')}")
            assert limit.get("reason"), (
                f"{name} rose from {old} to {new}: say why in {ratchets.FILE.name}"
            )
        if name in found:
            assert found[name] <= new, (
                f"{name}: {found[name]}, at most {new}; make it smaller, or raise the limit in"
                f" {ratchets.FILE.name} with was = {new} and a reason"
            )
            assert found[name] >= 0.97 * new - 2, (
                f"{name} has fallen to {found[name]}: python -m evidence.ratchets --lower"
            )
