"""A page as a Jupyter notebook: its text, its blocks as cells, and what they print.

    python docs/site/notebook.py                            write the notebooks of `PAGES` again

The blocks are those that the build of the site runs and compares; a test holds each notebook to its
page.
"""

from __future__ import annotations

import json
import re
import sys

from executed import DOCS, blocks

PAGES = ("tutorial.md", "gallery.md")
LINE = re.compile(r"^Also \[as a notebook\].*\n+", re.MULTILINE)


def notebook(page):
    """The text of a notebook, of the text of a page."""
    page = LINE.sub("", page)
    cells, at = [], 0
    for block in blocks(page):
        if block.kind not in ("python", "sh", "text"):
            continue
        start = page.rindex("\n```", 0, block.span[0]) + 1
        _text(cells, page[at:start])
        if block.kind == "text":
            output = {"output_type": "stream", "name": "stdout", "text": _lines(block.code)}
            cells[-1]["outputs"].append(output)
        else:
            _code(cells, block)
        at = page.index("```", block.span[1]) + 3
    _text(cells, page[at:])
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {
        "cells": cells,
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def _text(cells, text):
    if text.strip():
        cells.append({"cell_type": "markdown", "metadata": {}, "source": _lines(text.strip())})


def _code(cells, block):
    code = block.code.rstrip("\n")
    if block.kind == "sh":
        code = "\n".join(f"!{line}" for line in code.splitlines())
    cells.append(
        {
            "cell_type": "code",
            "execution_count": None,
            "metadata": {},
            "outputs": [],
            "source": _lines(code),
        }
    )


def _lines(text):
    return text.splitlines(keepends=True)


def path_of(page):
    """Where the notebook of a page is."""
    return (DOCS / page).with_suffix(".ipynb")


if __name__ == "__main__":
    sys.path.insert(0, str(DOCS.parent))
    for name in PAGES:
        text = (DOCS / name).read_text(encoding="utf-8")
        path_of(name).write_text(notebook(text), encoding="utf-8")
