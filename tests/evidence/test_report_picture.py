"""The picture of the report is that of the page that is given."""

import os
import shutil

import pytest

from evidence.report_picture import PICTURE, SCREEN, taken


def test_the_picture_is_the_first_screen_of_a_page(tmp_path):
    pytest.importorskip("playwright", reason="needs playwright")
    if not (os.environ.get("CHROMIUM") or shutil.which("chromium")):
        pytest.skip("needs chromium")
    from PIL import Image

    page = tmp_path / "page.html"
    page.write_text("<body style='margin:0;background:#0b61a4'><div style='height:3000px'></div>")
    with Image.open(taken(str(page), tmp_path / "page.png")) as drawn:
        assert drawn.size == (SCREEN["width"], SCREEN["height"])
        assert drawn.convert("RGB").getpixel((600, 880)) == (0x0B, 0x61, 0xA4)
    assert PICTURE.is_file()
