"""Pictures of pages that their own blocks draw: docs/plots.md, embedding.md, published.md,
tutorial.md.

    python -m evidence.page_pictures             run the pages, say which pictures differ
    python -m evidence.page_pictures --write     and put the pictures into docs

A block that ends in `savefig("name.png")` draws `name.png`, and the page shows it below: a picture
is always that of the code above it.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import sys
import tempfile
from pathlib import Path

import numpy as np

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = ("plots.md", "embedding.md", "published.md", "tutorial.md")
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAVED = re.compile(r'savefig\("([\w-]+\.png)"')
DIFFERENT = 0.02
"""Mean difference of two pictures, black to white 1, up to which they are one: fonts and
antialiasing of another version of matplotlib change less.
"""


def saved_by(page: str) -> list[str]:
    """The names of the pictures that the blocks of a page save."""
    return SAVED.findall((DOCS / page).read_text(encoding="utf-8"))


def drawn(page: str, folder: Path) -> list[Path]:
    """Run the blocks of a page in a folder and return the pictures that they saved there."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    text = (DOCS / page).read_text(encoding="utf-8")
    names: dict[str, object] = {"__name__": "page"}
    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        for code in BLOCK.findall(text):
            exec(compile(code, page, "exec", dont_inherit=True), names)
    plt.close("all")
    return [folder / name for name in saved_by(page)]


def difference(one: Path, other: Path) -> float:
    """Return the mean difference of two pictures, 1 where one is not there or of another size."""
    from matplotlib.image import imread

    if not (one.is_file() and other.is_file()):
        return 1.0
    a, b = imread(one), imread(other)
    return float(np.abs(a - b).mean()) if a.shape == b.shape else 1.0


def main(arguments: list[str] | None = None) -> int:
    """Return 1 where a picture differs and is not written, else 0."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="put the pictures into docs")
    write, wrong = parser.parse_args(arguments).write, []
    with tempfile.TemporaryDirectory(prefix="symheli-") as folder:
        for page in PAGES:
            for path in drawn(page, Path(folder)):
                kept = DOCS / path.name
                if difference(path, kept) > DIFFERENT:
                    wrong.append(path.name)
                if write:
                    kept.write_bytes(path.read_bytes())
    print(", ".join(wrong) or "none", "differed" if write else "differ from docs")
    return int(bool(wrong) and not write)


if __name__ == "__main__":
    sys.exit(main())
