"""The first screen of a study's report as the first picture of the README; that of a page of
`symheli live --page`.

    python -m evidence.report_picture study/report.html           write docs/report.png
    python -m evidence.report_picture ADDRESS --picture docs/live-page.png

Chromium draws it: playwright's own, or the command that CHROMIUM names.
"""

from __future__ import annotations

import argparse
import os
import shutil
from pathlib import Path
from typing import Any

from symheli.extras import extra

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "report.png"
SCREEN = {"width": 1280, "height": 900}
"""Pixels of the screen."""
OPTIONS = ["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader"]
"""For a computer without a graphics card: pages with a picture in three dimensions."""
BROWSERS, UNDRAWN = 3, "Unable to capture screenshot"
"""Browsers that are tried, and how Chromium says that its drawing process is lost, as it is now and
then on a busy computer without a graphics card.
"""
SETTLED = 6000
"""Milliseconds after which a page that is served shows its numbers."""


def taken(page: str, picture: Path) -> Path:
    """Write the first screen of a page, a file or an address, as a picture of few colours and
    return its path.
    """
    from PIL import Image

    with extra("test", "the picture of a report"):
        from playwright.sync_api import Error, sync_playwright

    with sync_playwright() as run:
        for left in reversed(range(BROWSERS)):
            try:
                _drawn(run.chromium, page, picture)
                break
            except Error as error:
                if not left or UNDRAWN not in str(error):
                    raise
    with Image.open(picture) as drawn:
        drawn.convert("RGB").quantize(64).save(picture, "PNG", optimize=True)
    return picture


def _drawn(chromium: Any, page: str, picture: Path) -> None:
    """Write the first screen of a page as a browser of its own draws it."""
    command = os.environ.get("CHROMIUM") or shutil.which("chromium")
    browser = chromium.launch(executable_path=command, args=OPTIONS)
    try:
        screen = browser.new_page(viewport=SCREEN)
        served = page.startswith("http://")
        screen.goto(page if served else Path(page).resolve().as_uri())
        screen.wait_for_timeout(SETTLED if served else 0)
        screen.screenshot(path=picture)
    finally:
        browser.close()


def main() -> None:
    """Take the picture of the report that is named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", help="report.html of a study, or the address of a page")
    parser.add_argument("--picture", type=Path, default=PICTURE, help="file that is written")
    arguments = parser.parse_args()
    print(f"wrote {taken(arguments.report, arguments.picture)}")


if __name__ == "__main__":
    main()
