"""Tables of the documentation come from the command that stands above them, measured on a quiet
machine.
"""

import argparse
import math
import re
import sys
from types import SimpleNamespace

import pytest

from evidence import tables
from evidence.bracket.table import bracket_table
from symheli.errors import InputError

PAGE = "before\n<!-- gains: written by its command -->\nold\n<!-- gains: end -->\nafter\n"


def test_a_table_is_kept_between_its_marks_with_command_date_and_machine(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    for text in ("first", "second"):
        tables.keep(page, "gains", text, "a machine, 2 cores", "python -m evidence.bracket --write")
    kept = page.read_text()
    assert re.search(
        r"`python -m evidence.bracket --write`, \d\d \w+ \d{4}: a machine, 2 cores\.\n\nsecond\n",
        kept,
    )
    assert kept.startswith("before\n")
    assert kept.endswith("after\n")
    assert "old" not in kept
    assert "first" not in kept
    with pytest.raises(InputError, match="lacks the marks"):
        tables.keep(page, "growth", "x", "m")


@pytest.mark.parametrize("name", ["evidence.jerk", "evidence.jerk.__main__"])
def test_a_package_is_stamped_by_its_own_name(name, monkeypatch):
    main = SimpleNamespace(__spec__=SimpleNamespace(name=name))
    monkeypatch.setitem(sys.modules, "__main__", main)
    monkeypatch.setattr(sys, "argv", ["__main__.py", "--write"])
    assert tables.own_command() == "python -m evidence.jerk --write"


@pytest.mark.parametrize(("load", "refused"), [(0.0, False), (0.15, False), (1.3, True)])
def test_keeping_is_refused_with_the_load_where_others_are_at_work(
    load, refused, monkeypatch, capsys
):
    monkeypatch.setattr(tables, "busy_processors", lambda seconds: load)
    monkeypatch.setattr(sys, "argv", ["bracket", "--write"])
    if not refused:
        assert tables.parsed(argparse.ArgumentParser(), "page.md").write
        return
    with pytest.raises(SystemExit):
        tables.parsed(argparse.ArgumentParser(), "page.md")
    assert "other programs keep 1.3 of" in capsys.readouterr().err
    monkeypatch.setattr(sys, "argv", ["bracket"])
    assert not tables.parsed(argparse.ArgumentParser(), "page.md").write


def test_the_load_is_that_of_processors():
    load = tables.busy_processors(0.05)
    assert math.isfinite(load)
    assert load >= 0


def test_the_bracket_as_a_table():
    gain = {
        "rate": 3.0,
        "lower": 4.9454,
        "memory": 5.2749,
        "plain": math.inf,
        "exact": True,
        "covered": math.nan,
        "gap": 1.07,
    }
    found = {
        "gain, frozen": 0.984,
        "growth at 7.5 m/s^2": "none found",
        "growth at 7.54 m/s^2": 1.00081,
        "gain at 3 m/s^2": gain,
        "stable at 3 m/s^2 by P(p)": True,
        "stable at 7.1 m/s^2 by P(p, lag)": True,
        "stable at 6 m/s^2 by V of degree four": True,
    }
    assert bracket_table(found).splitlines() == [
        "| acceleration, m/s² | lower bound | proven, P(p, lag) | proven, P(p) |",
        "|---|---|---|---|",
        "| 3 | 4.945 | 5.275 | nothing |",
        "| 7.1 |  | stable |  |",
        "| 7.5 | no growth found |  |  |",
        "| 7.54 | grows, 1.00081 a cycle |  |  |",
    ]
    assert "| 5.300 |" in bracket_table({"gain at 3 m/s^2": gain | {"covered": 5.3}})


def test_the_page_has_the_marks_of_every_table_that_is_written():
    for model in ("interpolated", "exact", "identified", "lateral"):
        _, page = tables.marked(tables.DOCS / "gains.md", model)
        assert (
            page.count(f"<!-- {model}: written by its command -->")
            == page.count(f"<!-- {model}: end -->")
            == 1
        )


def test_a_long_table_is_kept_on_the_page_of_tables(tmp_path):
    page = tmp_path / "gains.md"
    page.write_text("prose\n")
    long = tmp_path / tables.APPENDIX / "gains.md"
    long.parent.mkdir()
    long.write_text(PAGE)
    tables.keep(page, "gains", tables.markdown(["a"], [["1"]]))
    assert page.read_text() == "prose\n"
    assert tables.kept_rows(page, "gains") == [["1"]]
