"""Tables that a command wrote into the documentation are what it would write today: one row of
each is computed again.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

import synthesis
from evidence import (
    box_jenkins,
    gain_table,
    logs,
    r50,
    responses,
    sets,
    specs,
    structured,
    tube_gains,
    tube_loops,
    tuning,
    two_bands,
)
from evidence.ah1s import compared
from evidence.bracket.measured import GAINS, bracket
from evidence.flown import campaign, designs
from evidence.flown import tuning as sizes
from evidence.jerk.measured import TransitionPlan, fastest
from evidence.marks import (
    calibrated,
    conditions,
    coverage,
    fit_for_control,
    guarantee,
    measured,
    spanning,
    unseen,
)
from evidence.planar_vtol import tubes as planar_vtol
from evidence.public_files import fetched
from evidence.reach.measured import gains
from evidence.tables import DOCS
from evidence.tube_terms import HELD_AGAINST, held_against, remainders
from evidence.tubes import TRANSITIONS, VEHICLES
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
        for page in sorted(DOCS.glob("*.md"))
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


def marks_of_the_worst_seed(section, truth="xcell60", turbulent=False, gentle=False):
    shown, seed = worst(KEPT["identified.md", section].cells("worst nu-gap, lateral")[2])
    setting = measured.Setting(truth, measured.PAIRS[truth], turbulent, gentle)
    assert same(shown, measured.of_seed(setting, seed).gaps["lateral"][0])


def ah1s_of_the_worst_seed(structure, ramps, knots):
    pytest.importorskip("jsbsim", reason="needs jsbsim: pip install 'symheli[jsbsim]'")
    section = KEPT["identified.md", f"AH-1S {structure} {ramps} {knots} kt"]
    (shown, seed), *_ = re.findall(r"worst ([\d.]+) \(seed (\d+)\)", section.text)
    found = compared.of_seed(structure, ramps, knots, "filter error", int(seed))
    assert same(shown, max(found.gaps))


def guarantee_of_the_worst_seed():
    section = KEPT["identified.md", "guarantee xcell60"]
    shown, seed = worst(section.cells("worst (seed)")[0])
    proof = guarantee.exact_gain(Helicopter.load("xcell60", governor="ideal"))
    exact = proof.gamma, proof.lower
    found = guarantee.of_seed("xcell60", guarantee.PAIRS["xcell60"], seed, exact)
    assert same(shown, found.ratio)
    assert found.verdict == "holds"


def unseen_flights_of_the_first_seed():
    """One heavier vehicle of the table is refused, as the row says of all."""
    section = KEPT["identified.md", "unseen flights xcell60"]
    found = unseen.of_seed(0)
    assert section.cells("deflections")
    assert found.explained["deflections", True, "20 % heavier"] == [False]
    assert sum(found.explained["deflections", True, unseen.SAME_VEHICLE]) >= 19


def exact_loop_in_the_most_head_wind():
    shown = KEPT["identified.md", "two masses in wind xcell60"].cells("1.2")
    found = spanning.exact("xcell60", 1.2, spanning.WINDS[0], prove=False)
    assert same(shown[1], found.frozen, rel=1e-3)


def regions_of_the_first_seed():
    """A seed lies between the least and the largest that the table prints."""
    cell = KEPT["identified.md", "regions xcell60"].cells(conditions.CONDITIONS["ideal"].about)[1]
    least, most = map(float, re.findall(r"[\d.]+", cell)[1:])
    assert least - 0.06 <= 100 * coverage.of_seed("ideal", 0).covered <= most + 0.06


def verdict_of_the_farthest_model_that_is_called_fit():
    about = fit_for_control.CASES["delay"].about
    shown, seed = worst(KEPT["identified.md", "verdicts xcell60"].cells(about)[2])
    assert fit_for_control.farthest(fit_for_control.of_seed("delay", seed)) == f"{shown} ({seed})"


def calibrated_vehicle_of_the_worst_seed():
    shown, seed = worst(KEPT["identified.md", "xcell60 calibrated"].cells("all axes")[2])
    assert same(shown, calibrated.of_seed(seed).gaps["all axes"], rel=1e-3)


def flight_with_servos_of_the_worst_seed():
    name = "servos"
    about = conditions.CONDITIONS[name].about
    shown, seed = worst(KEPT["identified.md", "xcell60 under real conditions"].cells(about)[2])
    assert same(shown, conditions.of_seed(name, seed).gap)


def coefficient_of_the_box_jenkins_system():
    """The median of the first five seeds is within the scatter of theirs, .02."""
    name = "Box-Jenkins, noise of order 2"
    shown = float(KEPT["identification.md", "Box-Jenkins system"].cells(name)[0])
    found = [box_jenkins.of_seed(seed)[name][0] @ [1.0, 0.5, 0.25] for seed in range(5)]
    assert abs(sorted(found)[2] - shown) < 0.02


def bands_of_ten_seeds():
    """Of the row of 8 m/s: ten of its hundred seeds are within two percent of them all."""
    shown = KEPT["identified.md", "frequency responses"].cells("8 m/s")[0]
    found = [responses.of_seed(8.0, seed) for seed in range(10)]
    held, usable = (
        sum(getattr(c, kind)["references"].sum() for c in found) for kind in ("inside", "usable")
    )
    assert abs(held / usable - float(shown.rstrip("%")) / 100) < 0.02


def two_bands_of_the_first_seed():
    """The bands of one seed hold what those of all do, within a tenth."""
    found = two_bands.of_seed(0)
    for name, held in found.held.items():
        shown = float(KEPT["identified.md", "two bands"].cells(name)[1].rstrip("%")) / 100
        assert abs(held[found.measured.usable].mean() - shown) < 0.1


def margins_of_the_first_flight():
    assert KEPT["identified.md", "changed gains"].cells("all true margins in their bands")
    found = tuning.of_seed(0)
    assert found.inside
    assert found.called in (found.stable, None)


def proven_by_p_alone(section, loop):
    found = bracket(loop, 1.0, GAINS[1.0], search=synthesis.analysis.LowerBoundSearch(seconds=1.0))
    shown = KEPT["gains.md", section].cells("1")
    assert same(shown[1], found.memory)
    assert same(shown[2], found.plain)
    assert found.exact


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


def governed_flights():
    # 20 other commands: none leaves with the governor, nearly all without
    name = "xcell_kahn_hudson"
    _, governed, without, *_ = KEPT["sets.md", "jumps"].cells(name)
    heli = Helicopter.load(name, governor="ideal")
    _, _, *today = sets.row(name, sets.proven_set(heli), 20)
    assert governed == today[0] == "0, 0"
    shown, found = ([int(n) for n in each.split(",")] for each in (without, today[1]))
    assert 18 <= found[0] <= shown[0]
    assert 18 <= found[1] <= shown[1]


def hover_of_the_r50():
    shown = KEPT["vehicles.md", "r50"].text.splitlines()
    assert shown == r50.table().splitlines()


def tube_in_hover():
    airspeed, gust, _, attitude, *_ = KEPT["tubes.md", "amplitudes"].cells("xcell60")
    found = synthesis.tubes.tube(_xcell(), float(airspeed), gust=float(gust))
    assert found.verified
    assert attitude == " ".join(f"{w:.2g}" for w in found.half_widths[6:8])


def tube_of_a_loop(section, case):
    cells = KEPT["tubes.md", section].cells(case.vehicle)
    governor, _, airspeed, gust, states, _, attitude, *_ = cells
    assert (governor, airspeed, gust) == (case.governor, f"{case.airspeed:g}", f"{case.gust:g}")
    found = case.found()
    assert found.verified
    assert states == str(len(found.deviations.states))
    assert attitude == " ".join(f"{w:.2g}" for w in found.half_widths[6:8])


def remainder_of_one_cell():
    *_, row = remainders(VEHICLES[0], [3.0]).splitlines()
    shown = KEPT["tubes.md", "remainders"].cells("3 to 4")
    assert shown == [cell.strip() for cell in row.strip("| ").split("|")][1:]


def terms_of_one_interval():
    low, gust = HELD_AGAINST[0]
    *_, row = held_against(VEHICLES[0], [(low, gust)]).splitlines()
    shown = KEPT["tubes.md", "terms"].cells(f"{low:g} to {low + 1:g}")
    assert shown == [cell.strip() for cell in row.strip("| ").split("|")][1:]


def tube_along_a_transition():
    name = "xcell_kahn_hudson"
    case = next(case for case in TRANSITIONS if case[0] == name)
    _, gust, limits, _, attitude, *_ = KEPT["tubes.md", "transitions"].cells(name)
    acceleration, jerk, snap = case[4:]
    assert (gust, limits) == (f"{case[3]:g}", f"{acceleration:g}, {jerk:g}, {snap:g}")
    heli = Helicopter.load(name, governor="ideal")
    found = synthesis.tubes.tube(
        heli, case[1:3], gust=case[3], acceleration=acceleration, jerk=jerk, snap=snap
    )
    assert attitude == (" ".join(f"{w:.2g}" for w in found.half_widths[6:8]) * found.verified)


def gains_on_one_tube():
    airspeed, output, _, _, proven, flown = KEPT["tubes.md", "gains"].cells("xcell60")
    found = synthesis.tubes.tube(_xcell(), float(airspeed), gust=tube_gains.GUST)
    gain = found.with_gain([output.split(",")[0]]).gains[0]
    assert same(proven, gain.gamma, rel=1e-3)  # the solver stops at 1e-6 of a cost
    assert float(flown) < gain.gamma


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


def scheduled_lqr_beside_the_gain_table():
    heli = Helicopter.load("xcell60", governor="ideal")
    of = gain_table.plant(heli)
    name, *found = gain_table.row("scheduled LQR", heli, of, gain_table.lqr_schedule(heli))
    for new, shown in zip(found, KEPT["structured.md", "gain table"].cells(name), strict=True):
        (number, *unit), (old, *old_unit) = new.split(), shown.split()
        assert unit == old_unit
        assert same(old, float(number), rel=1e-2)  # a proof of another machine ends elsewhere


def first_sizes_of_the_lqr():
    """The first evaluation of its search."""
    ideal, heli = _xcell(), Helicopter.load("xcell60", governor="pi")
    (found,) = sizes.searched(lambda powers: designs.retuned(ideal, powers), heli, 1)
    _, _, *shown = KEPT["flown.md", "tuning"].cells(designs.RETUNED)
    for cell, ratio in zip(shown, found.ratios, strict=True):
        assert same(cell, ratio)


def flown_case(name, controller):
    """What the trial finds of a controller in light turbulence at the permitted acceleration."""
    return campaign.trial_of({name: controller}).run(controller=name)


def ratio_of_the_lqr_in_light_turbulence():
    light = sizes.SIZES_OF_GUSTS.index(WINDS[0])
    shown = KEPT["flown.md", "energy ratios"].cells(LQR)[light].strip("*")
    assert same(shown, flown_case(LQR, lqr_schedule(_xcell()))["energy ratio, median"])


def frozen_gain_of_the_retuned_lqr():
    heli = _xcell()
    (found,) = design(designs.RETUNED, lambda: designs.retuned(heli), flown_plant(baseline(heli)))
    states, frozen, *_ = KEPT["flown.md", "controllers"].cells(designs.RETUNED)
    assert int(states) == found.order
    assert same(frozen, found.frozen)


def entries_of_the_lqr():
    """Every entry at the permitted acceleration, to the digits shown."""
    row = flown_case(LQR, lqr_schedule(_xcell()))
    lost, *shown, _, _, every = KEPT["flown.md", "flown entries"].cells(f"{LQR}, 3 m/s^2, 7.7 m/s")
    specs = [s for s in campaign.flown_entries(campaign.of_the_vehicle()) if s.axis == "transition"]
    assert lost == f"{row['lost']:.1%}"
    assert every == f"{row['every entry met']:.1%}"
    for cell, spec in zip(shown, specs, strict=False):
        assert float(cell) == pytest.approx(row[f"{campaign.entry(spec)}, 95%"], rel=6e-3)


def the_lqr_in_still_air():
    ideal, heli = _xcell(), Helicopter.load("xcell60", governor="pi")
    (flies,) = design(LQR, lambda: lqr_schedule(ideal), flown_plant(baseline(ideal)))
    found = in_still_air(heli, flies.controller, campaign.of_the_vehicle())
    shown = KEPT["flown.md", "still air"].cells(LQR)
    assert [float(cell) for cell in shown] == pytest.approx(list(found.values()), rel=6e-3)


def frozen_entries_that_static_controllers_come_nearest_to():
    """Their margins, evaluated again, to a percent."""
    heli, vehicle = _xcell(), specs.OfVehicle(name="xcell60", points=specs.POINTS)
    static = {
        LQR: lqr_schedule(heli),
        designs.RETUNED: designs.retuned(heli),
        designs.PD: designs.pd(),
    }
    table = vehicle.frozen(static)
    reached = {n: {r.specification: r for r in table.reached(n)} for n in static}
    looked_at = 0
    for line in KEPT["flown.md", "conflicts"].text.splitlines()[2:]:
        axis, entry, _, nearest, _, shown = (cell.strip() for cell in line.strip("|").split("|"))
        spec = table.sheet.of(axis, entry)
        if nearest in static and spec.kind == "frozen":
            assert abs(float(shown) - reached[nearest][spec].margin) <= 1.0
            looked_at += 1
    assert looked_at


ROWS = {
    ("flown.md", "tuning"): first_sizes_of_the_lqr,
    ("flown.md", "energy ratios"): ratio_of_the_lqr_in_light_turbulence,
    ("flown.md", "controllers"): frozen_gain_of_the_retuned_lqr,
    ("flown.md", "flown entries"): entries_of_the_lqr,
    ("flown.md", "still air"): the_lqr_in_still_air,
    ("flown.md", "conflicts"): frozen_entries_that_static_controllers_come_nearest_to,
    ("controllers.md", "specification sheet"): margins_of_the_lqr_schedule,
    ("gains.md", "interpolated"): lambda: proven_by_p_alone("interpolated", lateral_loop(_xcell())),
    ("gains.md", "exact"): lambda: proven_by_p_alone("exact", ExactLateral.of(_xcell()).loop()),
    ("gains.md", "identified"): frozen_gain_of_the_exact_servo_loop,
    ("gains.md", "lateral"): lambda: gain_with_any_jerk("lateral", lateral_loop(_xcell())),
    ("gains.md", "longitudinal"): lambda: gain_with_any_jerk(
        "longitudinal", longitudinal_loop(_xcell())
    ),
    ("gains.md", "flights"): fastest_of_the_test_flight,
    ("lft.md", "reach"): gains_on_a_narrow_range,
    ("structured.md", "static output feedback"): static_output_feedback_of_one_helicopter,
    ("structured.md", "gain table"): scheduled_lqr_beside_the_gain_table,
    ("sets.md", "jumps"): governed_flights,
    ("vehicles.md", "r50"): hover_of_the_r50,
    ("tubes.md", "amplitudes"): tube_in_hover,
    ("tubes.md", "transitions"): tube_along_a_transition,
    ("tubes.md", "remainders"): remainder_of_one_cell,
    ("tubes.md", "terms"): terms_of_one_interval,
    ("tubes.md", "gains"): gains_on_one_tube,
    ("tubes.md", "loops"): lambda: tube_of_a_loop("loops", tube_loops.CASES[0]),
    ("tubes.md", "governed"): lambda: tube_of_a_loop("governed", tube_loops.GOVERNED[0]),
    ("tubes.md", "vtol"): tube_of_the_planar_vtol,
    ("identify.md", "public logs"): one_public_log,
    ("identified.md", "xcell60"): lambda: marks_of_the_worst_seed("xcell60"),
    ("identified.md", "xcell_kahn_hudson"): lambda: marks_of_the_worst_seed(
        "xcell_kahn_hudson", "xcell_kahn_hudson"
    ),
    ("identified.md", "xcell60, two flights"): lambda: marks_of_the_worst_seed(
        "xcell60, two flights", gentle=True
    ),
    ("identified.md", "xcell_kahn_hudson, two flights"): lambda: marks_of_the_worst_seed(
        "xcell_kahn_hudson, two flights", "xcell_kahn_hudson", gentle=True
    ),
    ("identified.md", "AH-1S known lags slow 60 kt"): lambda: ah1s_of_the_worst_seed(
        "known lags", "slow", 60
    ),
    ("identified.md", "AH-1S as the X-Cell slow 60 kt"): lambda: ah1s_of_the_worst_seed(
        "as the X-Cell", "slow", 60
    ),
    ("identified.md", "AH-1S known lags fast 60 kt"): lambda: ah1s_of_the_worst_seed(
        "known lags", "fast", 60
    ),
    ("identified.md", "AH-1S known lags slow 100 kt"): lambda: ah1s_of_the_worst_seed(
        "known lags", "slow", 100
    ),
    ("identified.md", "xcell60 in turbulence"): lambda: marks_of_the_worst_seed(
        "xcell60 in turbulence", turbulent=True
    ),
    ("identified.md", "guarantee xcell60"): guarantee_of_the_worst_seed,
    ("identified.md", "unseen flights xcell60"): unseen_flights_of_the_first_seed,
    ("identified.md", "two masses in wind xcell60"): exact_loop_in_the_most_head_wind,
    ("identified.md", "regions xcell60"): regions_of_the_first_seed,
    ("identified.md", "xcell60 under real conditions"): flight_with_servos_of_the_worst_seed,
    ("identified.md", "verdicts xcell60"): verdict_of_the_farthest_model_that_is_called_fit,
    ("identified.md", "xcell60 calibrated"): calibrated_vehicle_of_the_worst_seed,
    ("identification.md", "Box-Jenkins system"): coefficient_of_the_box_jenkins_system,
    ("identified.md", "frequency responses"): bands_of_ten_seeds,
    ("identified.md", "two bands"): two_bands_of_the_first_seed,
    ("identified.md", "changed gains"): margins_of_the_first_flight,
    ("checks.md", "fuzzing symheli"): lambda: faults_of_one_entry("symheli", "symheli.Scheduling"),
    ("checks.md", "fuzzing identification"): lambda: faults_of_one_entry(
        "identification", "identification.judge.theil"
    ),
    ("checks.md", "fuzzing synthesis"): lambda: faults_of_one_entry(
        "synthesis", "synthesis.objectives.PoleRegion"
    ),
    ("checks.md", "fuzzing readers"): outcomes_of_one_reader,
}
"""How a row of each is computed again."""

TIMED = {key for key in KEPT if key[0] == "benchmarks.md"}
"""What these hold is of the machine and the day: of them the command must still run."""


def test_every_table_that_a_command_wrote_is_checked():
    marked = {
        (page.name, name)
        for page in DOCS.glob("*.md")
        for name in re.findall(
            r"^<!-- (.+): written by its command -->$", page.read_text(encoding="utf-8"), re.M
        )
    }
    assert marked == KEPT.keys() == ROWS.keys() | TIMED
    for found in KEPT.values():
        what = shlex.split(found.command)[: 2 if found.command.startswith("-m") else 1]
        file = Path(*what[-1].split(".")) if what[0] == "-m" else Path(what[0])
        assert any((ROOT / f).is_file() for f in (file, file / "__main__.py", f"{file}.py"))


@pytest.mark.slow
@pytest.mark.parametrize("key", sorted(ROWS), ids=" ".join)
def test_a_row_is_what_the_command_finds_today(key):
    ROWS[key]()


@pytest.mark.slow
@pytest.mark.parametrize("key", sorted(TIMED), ids=" ".join)
def test_the_command_of_a_timed_table_still_runs(key):
    command = shlex.split(KEPT[key].command)
    assert _ran(*(part for part in command if part != "--write"), "--quick").strip()
