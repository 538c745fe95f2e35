"""The program that meets every design with every certificate ends in numbers and reasons."""

import pytest
from scheduled_plants import spring

from evidence import every_pair


@pytest.mark.slow
def test_every_cell_is_a_number_or_a_reason(monkeypatch, capfd):
    quick = ("stability", "l2_gain", "passivity_index", "certify", "saved", "margins")
    chosen = {name: every_pair.CERTIFICATES[name] for name in quick}
    monkeypatch.setattr(every_pair, "CERTIFICATES", chosen)
    monkeypatch.setitem(every_pair.PLANTS, "spring", spring)
    found = every_pair.table("spring", 15.0)
    assert every_pair.CRASHED not in found
    rows = [row.split("|")[2:-1] for row in found.splitlines() if row.startswith("|")][2:]
    assert len(rows) == len(every_pair.DESIGNS)
    made = [row for row in rows if "[" not in row[0] and "over" not in row[0]]
    assert len(made) >= 6
    assert all(cell.strip() for row in made for cell in row)
    assert sum("yes" in cell for row in made for cell in row) >= 4
    assert "NO" not in {cell.strip() for row in made for cell in row}


def test_a_crash_is_no_reason(capfd):
    cells = [every_pair.cell(lambda: 1 / 0, {}), every_pair.cell(lambda: True, {})]
    assert [text for text, _ in cells] == [every_pair.CRASHED, "yes"]
    assert "ZeroDivisionError" in capfd.readouterr().err
