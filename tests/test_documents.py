"""Pages whose blocks run, one after the other, and print what stands below them."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

from studies import cli

DOCS = Path(__file__).resolve().parents[1] / "docs"
BLOCK = re.compile(r"^```(python|sh|text)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def printed_and_written(page):
    """For each block that runs what it printed, and the text that follows it on the page (None where none does)."""
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


@pytest.mark.parametrize("page", ["identification.md"])
def test_the_blocks_of_a_page_run_and_print_what_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for code, printed, written in printed_and_written(page):
        if written is None:
            continue
        assert NUMBER.sub("#", printed) == NUMBER.sub("#", written), code
        found, said = ([float(n) for n in NUMBER.findall(text)] for text in (printed, written))
        # numbers of a flight: other processors and libraries round otherwise, and a last digit is half a unit of what is printed
        np.testing.assert_allclose(found, said, rtol=0.02, atol=0.11, err_msg=code)
