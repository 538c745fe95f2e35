"""Pages whose blocks run, one after the other, and print what stands below them."""

import contextlib
import io
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from studies import cli

DOCS = Path(__file__).resolve().parents[1] / "docs"
BLOCK = re.compile(r"^```(python|sh|text)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def printed_and_written(page):
    """For each block that runs what it printed, and the text that follows it on the page (None
    where none does).
    """
    blocks, names = BLOCK.findall((DOCS / page).read_text(encoding="utf-8")), {"__name__": "page"}
    for (kind, code), (after, text) in zip(blocks, [*blocks[1:], ("", "")], strict=True):
        if kind == "text":
            continue
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            if kind == "python":
                exec(compile(code, page, "exec"), names)
            else:
                for line in code.strip().splitlines():
                    assert cli.main(line.split()[1:]) == 0, line
        yield code, out.getvalue(), text if after == "text" else None


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(
            "campaigns.md",
            marks=pytest.mark.skipif(
                find_spec("zarr") is None, reason="needs zarr: pip install 'symheli[campaigns]'"
            ),
        ),
        "controllers.md",
        "flying.md",
        "identification.md",
        "plant.md",
        "points.md",
        "results.md",
        "uncertain.md",
    ],
)
def test_the_blocks_of_a_page_run_and_print_what_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for code, printed, written in printed_and_written(page):
        if written is None:
            continue
        assert NUMBER.sub("#", printed) == NUMBER.sub("#", written), code
        found, said = ([float(n) for n in NUMBER.findall(text)] for text in (printed, written))
        # numbers of a flight: other processors and libraries round otherwise, and a last digit is
        # half a unit of what is printed
        np.testing.assert_allclose(found, said, rtol=0.02, atol=0.11, err_msg=code)


COMMAND = re.compile(
    r"^    (symheli identify tests/data(?:.*\\\n)*.*)\n\n((?:\|.*\n)+)", re.MULTILINE
)


@pytest.mark.parametrize(
    ("command", "table"),
    COMMAND.findall((DOCS / "identify.md").read_text(encoding="utf-8")),
    ids=["xplane", "trex550"],
)
def test_the_logs_beside_the_tests_give_the_tables_of_the_page(command, table, monkeypatch, capsys):
    """Fits held out, percent: q and theta, LPV and LTI."""
    monkeypatch.chdir(DOCS.parent)
    assert cli.main(command.replace("\\\n", " ").split()[1:]) == 0
    said = [[float(cell) for cell in row.split("|")[2:-1]] for row in table.splitlines()[2:]]
    printed = [
        line
        for line in capsys.readouterr().out.splitlines()
        if re.search(r"  (LPV, degree \d|LTI) ", line)
    ]
    found = [[float(number) for number in line.split()[-3:]] for line in printed]
    # a free run of hundreds of samples: other processors and libraries round otherwise
    np.testing.assert_allclose(found, said, rtol=0.02, atol=0.11)
