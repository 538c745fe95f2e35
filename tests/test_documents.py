"""The pages: what their blocks print, what runs them, and what makes the site of them."""

import importlib
import itertools
import json
import re
import shlex
import subprocess
import sys

import executed
import notebook
import numpy as np
import public_faces
import pytest
import reference
from executed import DOCS, PageError, check, difference, write
from public_faces import TOP

from studies import cli

README = DOCS.parent / "README.md"
SHOWN = re.compile(
    r"^ *(?:\.venv/bin/|python -m )?symheli ([a-z].*)$|`symheli ([a-z][^`]*)`", re.MULTILINE
)
"""A command of a line of its own, or within a sentence."""


@pytest.mark.slow
def test_the_blocks_of_the_readme_run_and_print_what_it_says():
    """Those of every page of the site are run by `make docs`."""
    check(README)


@pytest.mark.parametrize(
    "page",
    [README, *sorted(DOCS.rglob("*.md"))],
    ids=lambda path: str(path.relative_to(DOCS.parent)),
)
def test_every_command_that_a_page_shows_is_one_of_the_command_line(page):
    """Its verb and options are there and take what is shown; a verb alone is a name."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    for found in SHOWN.finditer(text):
        words = shlex.split(found[1] or found[2], comments=True)
        words = list(itertools.takewhile(lambda word: word not in (">", "|", "&&"), words))
        if len(words) == 1:
            assert words[0] in cli.VERBS
        else:
            cli.parser().parse_args(words)


@pytest.mark.parametrize("page", notebook.PAGES)
def test_a_notebook_is_its_page(page):
    """`python docs/site/notebook.py` writes it again. Its cells are the blocks that run, its output
    what they print.
    """
    text = (DOCS / page).read_text(encoding="utf-8")
    kept = notebook.path_of(page).read_text(encoding="utf-8")
    assert kept == notebook.notebook(text)
    cells = [cell for cell in json.loads(kept)["cells"] if cell["cell_type"] == "code"]
    ran = [b for b in executed.blocks(text) if b.kind in ("python", "sh")]
    assert len(cells) == len(ran)
    for cell, block in zip(cells, ran, strict=True):
        assert "".join(cell["source"]).lstrip("!") == block.code.rstrip("\n")


PAGE = """# A page

```python
import warnings
from dataclasses import dataclass

x = 1 / 3
print(f"a third is {x:.3f}")
```

```text
a third is 0.333
```

```toml
[between]
```

```sh
symheli vehicles > vehicles.txt
```

```python not run
this is no Python
```

```python
@dataclass
class Names:
    third: float


from pathlib import Path

print(Names(x).third < 1, "xcell60" in Path("vehicles.txt").read_text())
```

```text
True True
```
"""


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.md"
    path.write_text(PAGE)

    def changed(old="", new=""):
        path.write_text(PAGE.replace(old, new))
        return path

    return changed


def test_a_page_is_run_in_a_folder_of_its_own_and_from_top_to_bottom(page, tmp_path):
    check(page())
    check(page("print(Names", 'open("made.txt", "w").close()\nprint(Names'))
    assert [path.name for path in tmp_path.iterdir()] == ["page.md"]


def test_a_block_on_public_logs_is_skipped_where_there_are_none(
    page, tmp_path, monkeypatch, capsys
):
    """And run, and compared, where a folder is named."""
    own = page("```sh\n", "```sh with public logs\ncat logs/said.txt\n")
    text = own.read_text().replace("```python not run", "```text\nhello\n```\n\n```python not run")
    own.write_text(text.replace(', "xcell60" in Path("vehicles.txt").read_text()', ", True"))
    monkeypatch.delenv("SYMHELI_PUBLIC_LOGS", raising=False)
    check(own)
    assert "line 20: skipped, SYMHELI_PUBLIC_LOGS names no folder" in capsys.readouterr().err
    folder = tmp_path / "public"
    folder.mkdir()
    monkeypatch.setenv("SYMHELI_PUBLIC_LOGS", str(folder))
    for said in ("hello", "good-bye"):
        (folder / "said.txt").write_text(said)
        if said == "hello":
            check(own)
        else:
            with pytest.raises(PageError, match="prints  good-bye"):
                check(own)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.333\n", "0.345\n", "line 4: .* line 1 of what is printed"),
        ("a third is 0", "one third is 0.333\na third is 0", "prints  a third .*says    one third"),
        ("True True", "True True\nTrue", "prints 1 lines, says 2"),
        ("x = 1 / 3", "x = 1 / 0", r'the block fails(.|\n)*"page.md", line 7(.|\n)*ZeroDivisionEr'),
        ("x = 1 / 3", "warnings.warn('old')\nx = 1 / 3", "UserWarning: old"),
        ("symheli vehicles >", "symheli trim --vehicle nobody >", "line 20: (.|\n)*ended with 1"),
        ("symheli vehicles >", "false >", "line 20: (.|\n)*ended with 1"),
    ],
)
def test_a_block_that_fails_or_prints_something_else_is_named_with_its_line(page, old, new, said):
    with pytest.raises(PageError) as told:
        check(page(old, new))
    assert re.search(said, str(told.value), re.DOTALL), told.value


def test_what_a_page_prints_is_written_where_it_differs_and_nowhere_else(page):
    path = page("0.333\n", "\n")
    write(path)
    assert path.read_text() == PAGE
    written = page("0.333\n", "0.334\n")  # the last digit is no difference
    before = written.read_text()
    write(written)
    assert written.read_text() == before


@pytest.mark.parametrize(
    ("found", "said", "same"),
    [
        ("97.9", "98.0", True),  # a last digit
        ("0.87", "0.98", False),
        ("671 samples", "672 samples", True),
        ("1 lost", "0 lost", False),
        ("19", "18", False),
        ("0.270", "0.275", False),
        ("1.26e-05", "1.2e-05", True),
        ("1.26e-04", "1.2e-05", False),
        ("gain 2.0", "gains 2.0", False),
        ("a  \nb\n\n", "a\nb\n", True),
    ],
)
def test_numbers_agree_to_one_unit_of_the_last_digit(found, said, same):
    assert (difference(found, said) is None) == same


def test_a_line_for_a_compiler_is_left_out_where_there_is_none(page, monkeypatch):
    monkeypatch.setattr(executed.shutil, "which", lambda name: None)
    check(page("symheli vehicles >", "symheli vehicles > vehicles.txt\ncc --no-such-option >"))


def test_every_page_stands_in_the_table_of_contents():
    listed = re.findall(r"^([\w/]+)$", (DOCS / "index.md").read_text(), re.MULTILINE)
    there = {str(path.relative_to(DOCS).with_suffix("")) for path in DOCS.rglob("*.md")}
    assert sorted(listed) == sorted((there - {"index"}) | {"api/index"})


def test_every_public_name_is_in_the_reference_once():
    found = list(reference.public())
    names = [f"{package}.{name}" for package, name, _ in found]
    assert len(set(names)) == len(names)
    import identification
    import symheli
    import synthesis

    for module in (symheli, identification, synthesis):
        for name in module.__all__:
            thing = getattr(module, name)
            if callable(thing):
                assert any(
                    getattr(sys.modules[package], other) is thing for package, other, _ in found
                ), name


def test_a_docstring_becomes_text_that_docutils_does_not_take_for_markup():
    lines = [
        "Largest |dp/dt| of `rate`s, x_ and *args.",
        "",
        "    C_Q = |x| * y",
        "",
        "Parameters",
        "----------",
        "p : float",
        "    In `a",
        "    b`.",
        "",
        "Examples",
        "--------",
        ">>> print(*[1])",
        "1",
    ]
    assert reference.as_rst(lines) == [
        r"Largest \|dp/dt\| of ``rate``\ s, x\_ and \*args.",
        "",
        "::",
        "",
        "    C_Q = |x| * y",
        "",
        "Parameters",
        "----------",
        "p : float",
        "    In ``a",
        "    b``.",
        "",
        "Examples",
        "--------",
        ">>> print(*[1])",
        "1",
    ]


def test_a_formula_needs_no_font_for_mathematics():
    """Accents and the parentheses of a matrix are not left to it."""
    pytest.importorskip("sphinx", reason="needs Sphinx: pip install 'symheli[docs]'")
    import mathml

    written = mathml.converted(
        r"\dot x = \begin{pmatrix} \dot q & \hat\Theta \end{pmatrix}", None, True
    )
    assert 'class="accented">\u1e8b<' in written
    assert "q\u0307" in written
    assert "\u0398\u0302" in written
    assert '<mtable class="round">' in written
    assert not re.search("<mover|[(][^)]*mtable", written)


SITE = """# A site

```{toctree}
page
```
"""


@pytest.mark.slow
def test_the_site_is_built_without_a_network_and_not_from_a_page_that_is_wrong(tmp_path):
    pytest.importorskip("furo", reason="needs Sphinx: pip install 'symheli[docs]'")
    pytest.importorskip("myst_parser")
    source, site = tmp_path / "source", tmp_path / "site"
    source.mkdir()
    (source / "index.md").write_text(SITE)
    formula = "\n$$\n\\dot x = \\begin{pmatrix} A & B \\end{pmatrix} x \\prec 0\n$$\n"

    def build(page):
        (source / "page.md").write_text(page)
        command = [sys.executable, "-m", "sphinx", "-q", "-W", "-c", str(DOCS / "site")]
        off = ["-D", "extensions=myst_parser,executed,mathml"]
        return subprocess.run(
            [*command, *off, str(source), str(site)], capture_output=True, text=True
        )

    done = build(PAGE + formula)
    assert done.returncode == 0, done.stderr
    html = (site / "page.html").read_text()
    assert "<math" in html
    assert "\\prec" not in html
    loaded = re.findall(r"""<(?:script|link|img)[^>]+(?:src|href)=["'](https?:)?//""", html)
    assert not loaded
    wrong = build(PAGE.replace("0.333\n", "0.433\n"))
    assert wrong.returncode != 0
    assert "says    a third is 0.433" in wrong.stderr
    unknown = build(PAGE + formula.replace("prec", "nosuchcommand"))
    assert unknown.returncode != 0
    assert "nosuchcommand" in unknown.stderr


COMMAND = re.compile(
    r"^    (symheli identify tests/data(?:.*\\\n)*.*)\n\n((?:\|.*\n)+)", re.MULTILINE
)


@pytest.mark.slow(but="xplane")
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


@pytest.mark.parametrize("package", ["symheli", "symheli.lpv", "identification", "synthesis"])
def test_the_page_of_names_lists_every_public_name_once(package):
    page = (DOCS / "names.md").read_text(encoding="utf-8")
    section = page.split(f"\n## {package}\n")[1].split("\n## ")[0]
    named = re.findall(r"`(\w+)`", section)
    assert sorted(named) == sorted(importlib.import_module(package).__all__)


def test_the_page_of_names_lists_every_name_one_level_lower():
    page = (DOCS / "names.md").read_text(encoding="utf-8")
    section = page.split("\n## One level lower\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `([\w.]+)` \| (.*) \|$", section, flags=re.MULTILINE)
    listed = {face: set(re.findall(r"`(\w+)`", names)) for face, names in rows}
    lower = set(public_faces.faces((*TOP, "symheli.lpv")))
    assert listed.keys() == lower - {*TOP, "symheli.lpv"}
    for face, names in listed.items():
        assert names == set(public_faces.names(face)), face
