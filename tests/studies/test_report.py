"""The report is written whatever the study found, and no finished number waits for it."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from dataclasses import fields, replace
from pathlib import Path

import pytest
from json_schema import faults

from studies.report import drawn, pages
from studies.transition import figures, gain_tables, guarantees, report
from studies.transition.outcome import Outcome
from symheli import LPVStateSpace, Scheduling
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import Spline

GLIMPSE = LowerBoundSearch(levels=2, dwells=1, starts=1, nodes=8, evaluations=1, samples=100)
STAGES = [
    f.name
    for f in fields(Outcome)
    if f.name not in ("vehicle", "quick", "seed", "effort", "heli", "seconds", "complete")
]


@pytest.fixture
def unpainted(monkeypatch):
    """Figures are drawn but not turned into pixels, which takes most of the time."""
    files = dict.fromkeys(("png", "svg", "pdf"), b"picture")
    monkeypatch.setattr(drawn, "_files", lambda figure: files)


def page(outcome, folder):
    return report.write_report(outcome, folder).read_text()


@pytest.mark.slow
def test_a_full_outcome_fills_every_section(full, tmp_path, unpainted):
    for name in STAGES:
        assert getattr(full, name), f"{name} is empty: not a full outcome"
    text = page(full, tmp_path)
    assert "Not reached" not in text
    assert not re.search("(figure|table|equation|section) not reached", text, re.IGNORECASE)
    drawn = {path.stem for path in (tmp_path / "figures").iterdir()}
    assert text.count("<figure") == len(drawn) > 10
    for ending in ("png", "svg", "pdf"):
        assert {path.stem for path in (tmp_path / "figures").glob(f"*.{ending}")} == drawn


@pytest.mark.slow
def test_the_numbers_of_a_full_outcome_are_what_the_schema_says(full, tmp_path):
    schema = Path(report.__file__).with_name("results.schema.json").read_text(encoding="utf-8")
    found = json.loads(report.write_results(full, tmp_path).read_text())
    assert None not in found.values()
    assert not list(faults(found, json.loads(schema)))


def test_an_empty_outcome_says_what_was_not_reached(tmp_path, unpainted):
    text = page(Outcome(vehicle="xcell60", quick=True, seed=0), tmp_path)
    assert text.count("Not reached") == 10
    assert "Nothing was reached that answers this" in text
    assert "No computation that was reached failed" in text
    assert "No result that was reached is negative" in text


@pytest.mark.slow
@pytest.mark.parametrize("name", ["baseline", "gust", "controllers", "real_conditions"])
def test_any_stage_of_the_outcome_may_be_missing(full, tmp_path, monkeypatch, name):
    outcome = replace(full, **{name: None})
    monkeypatch.setattr(figures, "figures", lambda _: ())
    assert 'id="section-provenance"' in page(outcome, tmp_path)
    assert outcome.summary()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["baseline", "gust"])
def test_figures_are_drawn_without_any_stage(full, tmp_path, unpainted, name):
    without = replace(full, **{name: None})
    text = page(without, tmp_path)
    drawn = list((tmp_path / "figures").glob("*.svg"))
    assert text.count("<figure") == len(drawn) > 5


@pytest.mark.slow
def test_a_vehicle_whose_entries_are_all_fitted_gets_its_report(full, tmp_path, unpainted):
    baseline = full.baseline
    smooth = replace(
        baseline, entries=tuple(e for e in baseline.entries if e not in baseline.unfit)
    )
    assert "is fitted by a polynomial" in page(replace(full, baseline=smooth), tmp_path)
    assert "is fitted by a polynomial" in page(
        replace(full, baseline=replace(baseline, entries=())), tmp_path
    )
    kinkless = replace(smooth, between=replace(baseline.between, kinks={}))
    assert "Corners of the model" not in page(replace(full, baseline=kinkless), tmp_path)


@pytest.mark.slow
def test_a_loop_that_is_unstable_when_frozen_gets_its_report(full, tmp_path, unpainted):
    growing = LPVStateSpace.polynomial(
        [[[-1.0]], [[1.0]]],
        [[[1.0]]],
        [[[1.0]]],
        [[[0.0]]],
        Scheduling("airspeed", "m/s", 0.0, 2.0),
    )
    asked = guarantees.bounds(
        "baseline", "gust", growing, (0.0, math.inf), Spline(segments=(2,)), GLIMPSE
    )
    found = guarantees.answered(asked)
    gust = replace(full.gust, bounds=tuple(found), exact_frozen=math.inf)
    outcome = replace(full, gust=gust)
    assert "unstable" in page(outcome, tmp_path)
    assert outcome.summary()


@pytest.mark.slow
def test_numbers_are_on_the_disk_before_a_picture_fails(full, tmp_path, monkeypatch):
    def fail(_):
        raise RuntimeError("a picture failed")

    monkeypatch.setattr(figures, "trim", fail)
    with pytest.raises(RuntimeError, match="a picture failed"):
        report.write_report(replace(full, complete=True), tmp_path)
    assert json.loads((tmp_path / "results.json").read_text())["complete"]


REPORT = Path(pages.__file__).parent


def test_every_table_scrolls_in_a_box_of_its_own_and_keeps_its_rows_on_paper():
    """What the tests in a browser see, where there is none."""
    for template in REPORT.glob("*.html.j2"):
        source = template.read_text(encoding="utf-8")
        assert source.count("<table") == source.count('<div class="scroll"><table') > 0
        assert source.count("<table") == source.count("<thead>")
    screen, paper = (REPORT / "page.css").read_text(encoding="utf-8").split("@media print")
    assert re.search(r"\.scroll \{[^}]*overflow-x: auto[^}]*max-width: 100%", screen)
    assert re.search(r"\btd \{[^}]*white-space: nowrap", screen)
    assert re.search(r"\btr\b[^{}]*\{[^}]*break-inside: avoid", paper)
    assert "thead { display: table-header-group; }" in paper
    assert report.whole("0.85, 1.36") == "0.85,\N{NO-BREAK SPACE}1.36"
    assert report.whole("v, p") == "v, p"


@pytest.mark.slow
@pytest.mark.skipif(
    not (shutil.which("chromium") and shutil.which("pdftotext")),
    reason="wants chromium and pdftotext",
)
def test_on_paper_no_column_is_lost(full, tmp_path, unpainted):
    """A4, as a browser prints it: every column of the widest table."""
    page(full, tmp_path)
    sheet = tmp_path / "report.pdf"
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={tmp_path / 'browser'}",
        f"--print-to-pdf={sheet}",
    ]
    subprocess.run(
        ["chromium", *options, str(tmp_path / "report.html")],
        check=True,
        capture_output=True,
        timeout=60,
    )
    text = subprocess.run(
        ["pdftotext", "-layout", str(sheet), "-"], check=True, capture_output=True, text=True
    ).stdout
    (table,) = gain_tables.every([b for b in full.bounds if b.channel == "gust"])
    frozen = next(line for line in text.splitlines() if re.match(r"\s*baseline\s+frozen\s", line))
    assert frozen.split() == " ".join(table.rows[0]).split()
