"""The published claims in examples/claims: their answers are those of the table of the page."""

import numpy as np
import pytest

from evidence.claims_of_others import FOLDER, PAGE, PUBLISHED, SECTION, row
from evidence.tables import kept_rows
from studies import cli
from synthesis.claims import read_claim, read_plant

SLOW = ("drake", "lpvnorm", "sename-3.3", "iqc-beyond")


@pytest.mark.slow(only=SLOW)
@pytest.mark.parametrize("name", PUBLISHED)
def test_the_row_of_a_published_claim_is_what_its_files_give(name):
    kept = {cells[0].strip("`"): cells for cells in kept_rows(PAGE, SECTION)}
    assert kept.keys() == PUBLISHED.keys()
    assert row(name, FOLDER)[:4] == kept[name][:4]


@pytest.mark.slow(but=("mpc", "golden", "cubic"))
@pytest.mark.filterwarnings("ignore:Solution may be inaccurate")
@pytest.mark.parametrize("name", PUBLISHED)
def test_the_files_are_the_data_of_the_source(name):
    """But for the digits that a solver gives to P and K."""
    plant, claim = PUBLISHED[name].made()
    own = read_plant(FOLDER / f"{name}.plant.json")
    assert read_claim(FOLDER / f"{name}.claim.json").kind == claim["claim"]
    if "A" in plant:
        np.testing.assert_array_equal(own.A, np.reshape(plant["A"], own.A.shape))


@pytest.mark.parametrize(("name", "status"), [("mpc", 1), ("mpc-more", 0), ("golden", 0)])
def test_the_command_of_a_row_ends_as_the_row_says(name, status, capsys):
    files = FOLDER / f"{name}.claim.json", "--plant", FOLDER / f"{name}.plant.json"
    assert cli.main(["verify", *map(str, files)]) == status
    assert capsys.readouterr().out
