"""Pictures of pages are those that the blocks above them draw."""

import re

import pytest

from evidence import page_pictures
from evidence.page_pictures import DIFFERENT, DOCS, PAGES, difference, drawn, main, saved_by

SHOWN = re.compile(r"!\[([^\]]+)\]\(([\w-]+\.png)\)")


@pytest.mark.parametrize("page", PAGES)
def test_a_page_shows_each_picture_that_it_draws_and_says_what_is_on_it(page):
    shown = SHOWN.findall((DOCS / page).read_text(encoding="utf-8"))
    assert [name for _, name in shown] == saved_by(page)
    assert all(len(words) > 20 for words, _ in shown)
    for _, name in shown:
        content = (DOCS / name).read_bytes()
        assert content.startswith(b"\x89PNG")
        assert 10_000 < len(content) < 150_000


def test_the_pages_are_in_the_index():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    for page in PAGES:
        assert f"\n{page.removesuffix('.md')}\n" in index


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_a_picture_is_what_its_page_draws(page, tmp_path):
    for path in drawn(page, tmp_path):
        assert difference(path, DOCS / path.name) < DIFFERENT, f"{path.name}: --write"


def test_another_picture_is_seen_and_written(tmp_path, monkeypatch, capsys):
    def draws(line):
        code = "from matplotlib.figure import Figure\n\nax = Figure(figsize=(2, 2)).subplots()\n"
        text = f'# A page\n\n```python\n{code}{line}\nax.figure.savefig("a.png")\n```\n'
        (tmp_path / "page.md").write_text(text, encoding="utf-8")

    monkeypatch.setattr(page_pictures, "DOCS", tmp_path)
    monkeypatch.setattr(page_pictures, "PAGES", ("page.md",))
    draws("ax.plot([0, 1], [0, 1])")
    assert main([]) == 1  # there is none
    assert main(["--write"]) == 0
    assert main([]) == 0
    draws("ax.fill_between([0, 1], [0, 0], [1, 1])")
    assert main([]) == 1
    assert "a.png differ" in capsys.readouterr().out.splitlines()[-1]
