"""Tables that a command wrote into the documentation are what it would write today: one row of
each is computed again.
"""

import argparse
import math
import os
import re
import runpy
import shlex
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

import synthesis
from evidence import (
    box_jenkins,
    damaged_logs,
    logs,
    r50,
    specs,
    structured,
)
from evidence.flown import campaign, designs
from evidence.flown import tuning as sizes
from evidence.jerk.measured import TransitionPlan, fastest
from evidence.marks import conditions, summary
from evidence.planar_vtol import tubes as planar_vtol
from evidence.public_files import fetched
from evidence.reach.measured import gains
from evidence.tables import APPENDIX, DOCS
from studies.controllers.designs import LQR, design, lqr_schedule
from studies.controllers.flown import WINDS
from studies.controllers.plant import baseline, flown_plant
from studies.loops.exact_lateral import ExactLateral
from studies.loops.lateral import lateral_loop
from studies.loops.longitudinal import longitudinal_loop
from studies.setup.bounds import PERIOD
from studies.setup.flights import TOP, autopilot_for
from studies.specs.flown import in_still_air
from studies.transition.guarantees import scaled
from symheli import Helicopter

ROOT = DOCS.parent
MARKED = re.compile(
    r"<!-- (?P<name>[^\n]+): written by its command -->\n\n`python (?P<command>[^`]*)`, .*?\n\n"
    r"(?P<text>.*?)\n\n<!-- (?P=name): end -->",
    re.DOTALL,
)


class Kept(NamedTuple):
    """What stands between the marks of a page: the command that wrote it and the text."""

    command: str
    text: str

    def cells(self, label):
        """Of the first row that begins with `label`, without it."""
        for line in self.text.splitlines():
            first, *rest = (cell.strip() for cell in line.strip("|").split("|"))
            if first == label:
                return rest
        raise AssertionError(f"no row begins with {label!r}")


def kept():
    """{(page, section): what is kept there} of the whole documentation."""
    return {
        (page.name, found["name"]): Kept(found["command"], found["text"])
        for page in sorted([*DOCS.glob("*.md"), *(DOCS / APPENDIX).glob("*.md")])
        for found in MARKED.finditer(page.read_text(encoding="utf-8"))
    }


KEPT = kept()


def same(shown, value, rel=0.0):
    """Whether a printed number is this one, to its last digit or a relative `rel`."""
    digits = len(shown.partition(".")[2])
    return abs(float(shown) - value) <= max(0.51 * 10.0**-digits, rel * abs(value))


def worst(cell):
    """(number, seed) of "0.039 (6)"."""
    found = re.fullmatch(r"(-?[\d.]+) \((\d+)\)", cell)
    assert found, cell
    return found[1], int(found[2])


def flight_with_servos_of_the_worst_seed():
    name = "servos"
    about = conditions.CONDITIONS[name].about
    shown, seed = worst(KEPT["identified.md", "xcell60 under real conditions"].cells(about)[2])
    assert same(shown, conditions.of_seed(name, seed).gap)


def nu_gaps_by_flight():
    assert KEPT["identified.md", summary.SECTION].text == summary.table()


def coefficient_of_the_box_jenkins_system():
    """The median of the first three seeds is within the scatter of theirs, .02."""
    name = "Box-Jenkins, noise of order 2"
    shown = float(KEPT["identification.md", "Box-Jenkins system"].cells(name)[0])
    found = [box_jenkins.of_seed(seed)[name][0] @ [1.0, 0.5, 0.25] for seed in range(3)]
    assert abs(sorted(found)[1] - shown) < 0.02


def frozen_gain_of_the_exact_servo_loop():
    loop = scaled(ExactLateral.of(_xcell(), 0.0, TOP).loop("inputs", PERIOD))
    text = KEPT["gains.md", "identified"].text
    row = next(line for line in text.splitlines() if line.split()[:2] == ["exact", "frozen"])
    assert same(row.split()[3], synthesis.frozen_gain(loop).gain)


def gain_with_any_jerk(section, loop):
    shown = KEPT["gains.md", section].cells("1")
    assert same(shown[-1], synthesis.l2_gain(loop, 1.0, search=None).gamma)


def fastest_of_the_test_flight():
    heli = _xcell()
    found = fastest(TransitionPlan().test(heli, autopilot_for(heli)))
    shown = KEPT["gains.md", "flights"].cells("test")
    assert same(shown[0], found.acceleration)
    assert same(shown[1], found.jerk)


def gains_on_a_narrow_range():
    found = list(gains(lateral_loop(_xcell()), 5.5, 7.5).values())
    for shown, value in zip(KEPT["lft.md", "reach"].cells("[5.5, 7.5] m/s"), found, strict=True):
        assert same(shown, value, rel=2e-4)


def hover_of_the_r50():
    shown = KEPT["vehicles.md", "r50"].text.splitlines()
    assert shown == r50.table().splitlines()


def tube_in_hover():
    airspeed, gust, _, attitude, *_ = KEPT["tubes.md", "amplitudes"].cells("xcell60")
    found = synthesis.tubes.tube(_xcell(), float(airspeed), gust=float(gust))
    assert found.verified
    assert attitude == " ".join(f"{w:.2g}" for w in found.half_widths[6:8])


def tube_of_the_planar_vtol():
    case = planar_vtol.CASES[0]
    _, _, position, control, *_ = KEPT["tubes.md", "vtol"].cells(f"{case.motions}, regulator")
    found = planar_vtol.sizes(planar_vtol.proven(case))
    assert same(position, found[0], rel=1e-3)  # as above
    assert same(control, found[1], rel=1e-3)


def one_public_log():
    folder = Path(os.environ.get("SYMHELI_PUBLIC_LOGS", ROOT.parent / "shared" / "data" / "xplane"))
    log = next(log for log in logs.LOGS if log.name == "Data.txt")
    if not (folder / log.name).is_file():
        pytest.skip(f"{log.name} is not here: python -m evidence.logs --folder DIR --fetch-only")
    *_, row = logs.table([(log, logs.judged(fetched(log, folder.resolve())))]).splitlines()
    (shown,) = (
        line
        for line in KEPT["identify.md", "public logs"].text.splitlines()
        if log.path[-8:] in line
    )
    number = re.compile(r"-?\d+\.\d+")
    assert number.sub("", row) == number.sub("", shown)
    for now, then in zip(number.findall(row), number.findall(shown), strict=True):
        assert same(then, float(now), rel=0.01)


def damages_by_text():
    shown = KEPT["identify.md", "damaged logs"].text.splitlines()
    *_, row, _ = damaged_logs.table(damaged_logs.all_of(("text",))).splitlines()
    assert row in shown


def faults_of_one_entry(package, entry):
    """As many inputs, no more faults: how many of them are refused is the draw's."""
    code = (
        "import sys; sys.path[:0] = ['benchmarks', 'tests/reliability']; import fuzz;"
        f" calls = fuzz.caught(lambda name: name == {entry!r});"
        f" tally = fuzz.fuzzed.tally(calls, fuzz.entries.inputs({entry!r}), None);"
        " print(tally.outcomes.total(), len(tally.faults))"
    )
    inputs, faults = _ran("-c", code).split()
    shown = KEPT["checks.md", f"fuzzing {package}"].cells(f"`{entry}`")
    assert [inputs, faults] == [shown[0], shown[-1] or "0"]


def outcomes_of_one_reader():
    code = (
        "import sys, tempfile, pathlib; sys.path[:0] = ['benchmarks', 'tests/reliability'];"
        " import fuzz; folder = pathlib.Path(tempfile.mkdtemp());"
        " reader = next(r for r in fuzz.good_files.readers(folder) if r.entry == 'CSV');"
        " tally = fuzz.damaged_files.tally(reader, fuzz.damaged_files.USUAL, first=0);"
        " print(*fuzz._row('`CSV`', tally.outcomes, len(tally.faults)), sep=' | ')"
    )
    assert _ran("-c", code).strip() in KEPT["checks.md", "fuzzing readers"].text


def _xcell():
    return Helicopter.load("xcell60", governor="ideal")


def _ran(*arguments):
    """What Python prints of this, in the root of the repository."""
    found = subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert found.returncode == 0, found.stderr[-2000:]
    return found.stdout


def margins_of_the_lqr_schedule():
    """Every least margin to a percent: a hair of its design moves some by half of one."""
    cells = KEPT["controllers.md", "specification sheet"].cells("LQR schedule")
    found = specs.row(specs.frozen(["LQR schedule"]), "LQR schedule")[1:]
    assert found[0] == cells[0]
    for new, old in zip(found[1:], cells[1:], strict=True):
        (number, name), (shown, of) = (cell.split(" ", 1) for cell in (new, old))
        assert name == of
        assert abs(float(number) - float(shown)) <= 1.0


def static_output_feedback_of_one_helicopter():
    """HE1, from as many starts as the table."""
    found = structured.row("HE1", structured.tuned("HE1"))[1:]
    shown = KEPT["structured.md", "static output feedback"].cells("HE1")
    assert found[:2] == shown[:2]
    assert same(shown[2], float(found[2]), rel=1e-6)  # its infimum is at infinite gains


def first_sizes_of_the_lqr():
    """The first evaluation of its search."""
    ideal, heli = _xcell(), Helicopter.load("xcell60", governor="pi")
    (found,) = sizes.searched(lambda powers: designs.retuned(ideal, powers), heli, 1)
    _, _, *shown = KEPT["flown.md", "tuning"].cells(designs.RETUNED)
    for cell, ratio in zip(shown, found.ratios, strict=True):
        assert same(cell, ratio)


@cache
def lqr_flown():
    """What the trial finds of the LQR in light turbulence at the permitted acceleration."""
    return campaign.trial_of({LQR: lqr_schedule(_xcell())}).run(controller=LQR)


FLOWN = 0.02
"""Of medians and quantiles of 500 flights: servos move in steps, so that another rounding of the
processor makes other flights.
"""


def ratio_of_the_lqr_in_light_turbulence():
    light = sizes.SIZES_OF_GUSTS.index(WINDS[0])
    shown = KEPT["flown.md", "energy ratios"].cells(LQR)[light].strip("*")
    assert same(shown, lqr_flown()["energy ratio, median"], rel=FLOWN)


def frozen_gain_of_the_retuned_lqr():
    heli = _xcell()
    (found,) = design(designs.RETUNED, lambda: designs.retuned(heli), flown_plant(baseline(heli)))
    states, frozen, *_ = KEPT["flown.md", "controllers"].cells(designs.RETUNED)
    assert int(states) == found.order
    assert same(frozen, found.frozen)


def entries_of_the_lqr():
    """Every entry at the permitted acceleration, to the two digits shown."""
    row = lqr_flown()
    lost, *shown, _, _, every = KEPT["flown.md", "flown entries"].cells(f"{LQR}, 3 m/s^2, 7.7 m/s")
    specs = [s for s in campaign.flown_entries(campaign.of_the_vehicle()) if s.axis == "transition"]
    assert lost == f"{row['lost']:.1%}"
    assert every == f"{row['every entry met']:.1%}"
    for cell, spec in zip(shown, specs, strict=False):
        found = row[f"{campaign.entry(spec)}, 95%"]
        digit = 10 ** (math.floor(math.log10(found)) - 1)
        assert abs(float(cell) - found) <= 0.51 * digit + FLOWN * found


def the_lqr_in_still_air():
    ideal, heli = _xcell(), Helicopter.load("xcell60", governor="pi")
    (flies,) = design(LQR, lambda: lqr_schedule(ideal), flown_plant(baseline(ideal)))
    found = in_still_air(heli, flies.controller, campaign.of_the_vehicle())
    shown = KEPT["flown.md", "still air"].cells(LQR)
    assert [float(cell) for cell in shown] == pytest.approx(list(found.values()), rel=6e-3)


ROWS = {
    ("identified.md", "nu-gaps"): nu_gaps_by_flight,
    ("flown.md", "tuning"): first_sizes_of_the_lqr,
    ("flown.md", "energy ratios"): ratio_of_the_lqr_in_light_turbulence,
    ("flown.md", "controllers"): frozen_gain_of_the_retuned_lqr,
    ("flown.md", "flown entries"): entries_of_the_lqr,
    ("flown.md", "still air"): the_lqr_in_still_air,
    ("controllers.md", "specification sheet"): margins_of_the_lqr_schedule,
    ("gains.md", "identified"): frozen_gain_of_the_exact_servo_loop,
    ("gains.md", "lateral"): lambda: gain_with_any_jerk("lateral", lateral_loop(_xcell())),
    ("gains.md", "longitudinal"): lambda: gain_with_any_jerk(
        "longitudinal", longitudinal_loop(_xcell())
    ),
    ("gains.md", "flights"): fastest_of_the_test_flight,
    ("lft.md", "reach"): gains_on_a_narrow_range,
    ("structured.md", "static output feedback"): static_output_feedback_of_one_helicopter,
    ("vehicles.md", "r50"): hover_of_the_r50,
    ("tubes.md", "amplitudes"): tube_in_hover,
    ("tubes.md", "vtol"): tube_of_the_planar_vtol,
    ("identify.md", "public logs"): one_public_log,
    ("identify.md", "damaged logs"): damages_by_text,
    ("identified.md", "xcell60 under real conditions"): flight_with_servos_of_the_worst_seed,
    ("identification.md", "Box-Jenkins system"): coefficient_of_the_box_jenkins_system,
    ("checks.md", "fuzzing identification"): lambda: faults_of_one_entry(
        "identification", "identification.judge.theil"
    ),
    ("checks.md", "fuzzing readers"): outcomes_of_one_reader,
}
"""How a row of each is computed again."""

DEAR = {
    ("checks.md", "fuzzing symheli"),
    ("checks.md", "fuzzing synthesis"),
    ("flown.md", "conflicts"),
    ("gains.md", "exact"),
    ("gains.md", "interpolated"),
    ("sets.md", "jumps"),
    ("structured.md", "gain table"),
    ("tubes.md", "remainders"),
    ("tubes.md", "terms"),
    ("tubes.md", "gains"),
    ("tubes.md", "governed"),
    ("tubes.md", "loops"),
    ("tubes.md", "transitions"),
    *(key for key in KEPT if key[0] == "identified.md" and key not in ROWS),
}
"""Those of which the cheapest row takes ten seconds or more, or is computed as that of another
table: their commands alone compute them again. That the commands are still taken is tested.
"""

TIMED = {key for key in KEPT if key[0] == "benchmarks.md"}
"""What these hold is of the machine and the day."""


def test_every_table_that_a_command_wrote_is_checked():
    marked = {
        (page.name, name)
        for page in DOCS.rglob("*.md")
        if page.parent.name != "howto"
        for name in re.findall(
            r"^<!-- (.+): written by its command -->$", page.read_text(encoding="utf-8"), re.M
        )
    }
    assert marked == KEPT.keys() == ROWS.keys() | TIMED | DEAR
    assert not DEAR & ROWS.keys()
    for found in KEPT.values():
        what = shlex.split(found.command)[: 2 if found.command.startswith("-m") else 1]
        file = Path(*what[-1].split(".")) if what[0] == "-m" else Path(what[0])
        assert any((ROOT / f).is_file() for f in (file, file / "__main__.py", f"{file}.py"))


@pytest.mark.slow
@pytest.mark.parametrize("key", sorted(ROWS), ids=" ".join)
def test_a_row_is_what_the_command_finds_today(key):
    ROWS[key]()


class Taken(Exception):
    """The program has read its options."""


@pytest.mark.parametrize("key", sorted(KEPT), ids=" ".join)
@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
def test_the_command_above_a_table_is_one_that_its_program_takes(key, monkeypatch):
    """Its module is there, and it knows the options; what follows is left out."""
    what, *options = shlex.split(KEPT[key].command)
    read = argparse.ArgumentParser.parse_args

    def only_read(self, *arguments):
        read(self, *arguments)
        raise Taken

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", only_read)
    monkeypatch.setattr(sys, "path", list(sys.path))
    name, options = (options[0], options[1:]) if what == "-m" else (str(ROOT / what), options)
    monkeypatch.setattr(sys, "argv", [name, *options])
    run = runpy.run_module if what == "-m" else runpy.run_path
    with pytest.raises(Taken):
        run(name, run_name="__main__")


@pytest.mark.slow
def test_the_command_of_a_timed_table_still_runs():
    command = shlex.split(KEPT["benchmarks.md", "gains of loops"].command)
    assert _ran(*(part for part in command if part not in ("--write", "--quick")), "--quick")
