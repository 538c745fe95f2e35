"""The first screen of a study's report as the first picture of the README.

    python -m evidence.report_picture study/report.html           write docs/report.png

Chromium draws it: playwright's own, or the command that CHROMIUM names.
"""

from __future__ import annotations

import argparse
import os
import shutil
from pathlib import Path

from symheli.extras import extra

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "report.png"
SCREEN = {"width": 1280, "height": 900}
"""Pixels of the screen."""


def taken(page: Path, picture: Path) -> Path:
    """Write the first screen of a page as a picture of few colours and return its path."""
    from PIL import Image

    with extra("test", "the picture of a report"):
        from playwright.sync_api import sync_playwright

    command = os.environ.get("CHROMIUM") or shutil.which("chromium")
    with sync_playwright() as run:
        browser = run.chromium.launch(executable_path=command, args=["--no-sandbox"])
        try:
            screen = browser.new_page(viewport=SCREEN)  # type: ignore[arg-type]
            screen.goto(page.resolve().as_uri())
            screen.screenshot(path=picture)
        finally:
            browser.close()
    with Image.open(picture) as drawn:
        drawn.convert("RGB").quantize(64).save(picture, "PNG", optimize=True)
    return picture


def main() -> None:
    """Take the picture of the report that is named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", type=Path, help="report.html of a study")
    print(f"wrote {taken(parser.parse_args().report, PICTURE)}")


if __name__ == "__main__":
    main()
