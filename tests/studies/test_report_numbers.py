"""Every number of the report's tables is in results.json, what is referred to is there, and nothing
that diverges stands out.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from statistics import median

import pytest

from studies.controllers.flown import WINDS
from studies.report.labels import Labels
from studies.report.references import REFERENCES
from studies.setup.flights import NOISES
from studies.transition import conclusions, gain_tables, guarantees, held, report, tables
from studies.transition import controller_tables as controllers
from studies.transition.outcome import Outcome
from studies.transition.results import to_dict
from studies.transition.shortfalls import shortfalls
from symheli import LPVStateSpace, Scheduling
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import Spline

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?")
WANTED = ("mark", "seeds better")
"""Columns that are no results, by how they begin, or counted from others."""

GLIMPSE = LowerBoundSearch(levels=2, dwells=1, starts=1, nodes=8, evaluations=1, samples=100)


@pytest.fixture(scope="module")
def results(full):
    return json.loads(json.dumps(to_dict(full)))


@pytest.fixture(scope="module")
def page(full):
    return report.page(full, {}, to_dict(full))


def every_table(study):
    yield tables.interpolation(study)
    yield tables.experiment(study)
    yield from (tables.scores(study, noise) for noise in NOISES)
    yield tables.modes(study)
    yield from map(tables.comparison, study.comparison.predictions)
    yield from tables.known_kinematics(study.known_kinematics)
    yield tables.real_conditions(study.real_conditions)
    yield from gain_tables.every(study.bounds)
    yield from (t for t in controllers.every(study) if t.name != "ranking")


def at(results, path):
    for key in path.split("."):
        results = results[key]
    return results


def numbers(part):
    """Every number below, and of lists what tables tell of them."""
    if isinstance(part, dict):
        for value in part.values():
            yield from numbers(value)
    elif isinstance(part, list):
        own = [x for x in part if isinstance(x, float | int) and not isinstance(x, bool)]
        if own and len(own) == len(part):
            yield from (median(own), max(own), sum(own))
        for value in part:
            yield from numbers(value)
    elif isinstance(part, float | int) and not isinstance(part, bool):
        yield float(part)


def printed(number, token):
    """The number as the token prints numbers: with its decimals, or its three digits."""
    decimals = len(token.partition(".")[2])
    shown = f"{number:.{decimals}f}"
    return token.lstrip("+") in (shown, f"{number:.3g}") or float(shown) == float(token) == 0.0


def cells(table):
    for row in table.rows:
        for column, cell in zip(table.columns[1:], row[1:], strict=True):
            if not column.startswith(WANTED):
                yield column, cell


@pytest.mark.slow
def test_every_number_of_a_table_is_in_results_json_where_the_table_says(full, results):
    looked_at = 0
    for table in every_table(full):
        found = list(numbers(at(results, table.source)))
        found += [math.degrees(x) for x in found]
        for column, cell in cells(table):
            for token in NUMBER.findall(re.sub(r"m/s\^2", "", cell)):
                looked_at += 1
                assert any(printed(x, token) for x in found), (table.name, column, cell)
    assert looked_at > 300


def test_a_number_that_is_not_in_results_json_would_be_found():
    found = list(numbers({"a": {"value": [1.234, 5.0], "unit": "m"}}))
    assert any(printed(x, "1.23") for x in found)
    assert not any(printed(x, "1.24") for x in found)


@pytest.mark.slow
def test_what_scheduling_is_worth_is_the_difference_of_the_fits(full, results):
    fits = {one["name"]: one["ahead"] for one in results["known_kinematics"]["models"]}
    table = tables.scheduling(full.known_kinematics)
    alone, constant = (
        fits[f"known kinematics, {k}"] for k in ("over airspeed", "constant coefficients")
    )
    for output, cell in zip(table.columns[2:], table.rows[0][2:], strict=True):
        change = alone[output]["value"] - constant[output]["value"]
        assert abs(int(cell) - change) <= 0.5


@pytest.mark.slow
def test_the_ranking_is_that_of_the_medians(full, results):
    table = controllers.ranking(full.flown_controllers)
    for row, wind in zip(table.rows, WINDS, strict=True):
        here = [
            one
            for one in results["controllers"]["flights"]
            if one["mean_wind_at_20ft"]["value"] == wind and one["lost"]["value"] == 0
        ]
        ratios = {one["controller"]: median(one["energy_ratio"]["value"]) for one in here}
        best = min(ratios, key=ratios.__getitem__)
        assert row[1:3] == [best, f"{ratios[best]:.2f}"]
        for name, cell in zip(table.columns[4:], row[4:], strict=True):
            if cell.startswith("+"):
                assert abs(float(cell) - 100 * (ratios[name] / ratios[best] - 1)) <= 0.5


@pytest.mark.slow
def test_every_path_that_the_report_names_is_in_results_json(full, results, page):
    named = re.findall(r'<span class="path">\[<code>([\w.]+)</code>', page)
    named += [row.path for row in shortfalls(full)]
    assert len(named) > 15
    for path in named:
        assert at(results, path), path


@pytest.mark.slow
def test_every_link_leads_somewhere_and_every_number_is_given_once(page):
    identifiers = re.findall(r'\bid="([^"]+)"', page)
    assert len(identifiers) == len(set(identifiers))
    links = set(re.findall(r'href="#([^"]+)"', page))
    assert links <= set(identifiers)
    assert {f"reference-{key}" for key in REFERENCES} <= links
    given = [int(n) for n in re.findall(r"<b>Table (\d+)\.</b>", page)]
    assert given == list(range(1, len(given) + 1))
    assert "http" not in page


def test_a_mention_of_what_was_not_reached_is_no_link():
    labels = Labels({"figure-trim": "3"})
    assert labels.to("figure", "trim", True) == '<a href="#figure-trim">Figure 3</a>'
    assert labels.to("table", "flown") == "table not reached"


@pytest.mark.slow
def test_the_best_that_diverges_in_free_run_is_not_bold(full):
    """The winner 1 s ahead is made to diverge: the next best stands out, and without one none."""
    compared = full.comparison.predictions[0]
    output = compared.axis.outputs[0]

    def lost(prediction):
        scores = prediction.scores
        return replace(
            prediction, scores=replace(scores, free_run={**scores.free_run, output: -math.inf})
        )

    table = tables.comparison(compared)
    (best,) = (row for row, column in table.bold if column == 1)
    predictions = list(compared.found.predictions)
    predictions[best] = lost(predictions[best])
    fewer = replace(compared, found=replace(compared.found, predictions=tuple(predictions)))
    assert (best, 1) not in tables.comparison(fewer).bold
    none = replace(
        compared, found=replace(compared.found, predictions=tuple(map(lost, predictions)))
    )
    assert not [row for row, column in tables.comparison(none).bold if column == 1]


@pytest.mark.slow
def test_no_bold_cell_of_any_table_diverges(full):
    for table in every_table(full):
        for row, column in table.bold:
            assert not re.search(r"diverges|unstable|lost|inf|nan|none", table.rows[row][column])


@pytest.mark.slow
def test_abstract_and_conclusion_are_short_sentences_with_the_numbers(full):
    for said in (conclusions.abstract(full), conclusions.conclusions(full)):
        assert 4 <= len(said) <= 13
        assert max(map(len, said)) < 420
    cubic = full.known_kinematics.rivals[0]
    worst = max(gap.max() for gap in cubic.gaps.values())
    assert any(f"{worst:.3f}" in sentence for sentence in conclusions.abstract(full))


@pytest.mark.slow
def test_the_answer_follows_the_proofs(full):
    """The gust loop of the fixture grows when airspeed jumps; a lag that hardly changes does not
    care.
    """
    alone = Outcome(vehicle="x", quick=True, seed=0, gust=full.gust)
    assert conclusions.conclusions(alone)[0].startswith("Take an LPV model")
    assert "makes the state grow" in conclusions.abstract(alone)[0]
    tame = replace(alone, gust=replace(full.gust, bounds=hardly_changing()))
    assert conclusions.conclusions(tame)[0].startswith("Take the LFT")
    assert "the LFT is enough" in conclusions.abstract(tame)[0]


def hardly_changing():
    """Bounds of a lag whose pole moves by a hundredth."""
    lag = LPVStateSpace.polynomial(
        [[[-1.0]], [[-0.01]]],
        [[[1.0]]],
        [[[1.0]]],
        [[[0.0]]],
        Scheduling("airspeed", "m/s", 0.0, 1.0),
    )
    asked = guarantees.bounds("baseline", "gust", lag, (0.0, math.inf), Spline(), GLIMPSE)
    return tuple(guarantees.answered([*asked, *guarantees.lft_bounds("baseline", "gust", lag)]))


@pytest.mark.slow
def test_models_at_a_held_airspeed_are_computed_once_until_they_change(full, monkeypatch):
    asked = []
    monkeypatch.setattr(held, "_kept", [])
    monkeypatch.setattr(held, "axes", lambda study: asked.append(study) or [])
    first = held.held_to_dict(full)
    assert held.held_to_dict(replace(full, flown_controllers=None, complete=True)) is first
    assert len(asked) == 1
    without = replace(full, known_kinematics=None)
    assert held.held_to_dict(without) is not first
    assert held.held_to_dict(replace(full, baseline=None)) is None
    assert held.held_to_dict(without) is held.held_to_dict(without)
    assert asked == [full, without]
