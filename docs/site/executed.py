"""Pages whose blocks run, one after the other, and print what stands below them.

A fence `python` or `sh` runs, from top to bottom, in a folder of its own; the `text` that follows
one is compared with what it printed. A fence that says `not run` behind its language is shown
only; one that says `with public logs` runs where SYMHELI_PUBLIC_LOGS names the folder that
`evidence.logs` fills, which is `logs` to the page, and elsewhere it is skipped. The tests and the
build of the site both go through here.

    python docs/site/executed.py docs/plant.md              run a page, say where it differs
    python docs/site/executed.py --write docs/plant.md      write what it prints into it
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import traceback
import types
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
FENCE = re.compile(
    r"^(?P<fence>`{3,})(?P<info>[^\n`]*)\n(?P<code>.*?)^(?P=fence)[ \t]*$", re.MULTILINE | re.DOTALL
)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
PUBLIC = " with public logs"
RUNS = ("python", "sh", f"sh{PUBLIC}")


class PageError(Exception):
    """A block failed, or printed something else; says where."""


@dataclass(frozen=True)
class Block:
    """A fence: its language, its text, where the text stands in the page, and its first line."""

    kind: str
    code: str
    span: tuple[int, int]
    line: int


def blocks(page):
    """The fences of the text of a page, in order."""
    return [
        Block(
            found["info"].strip(),
            found["code"],
            found.span("code"),
            page.count("\n", 0, found.start("code")) + 1,
        )
        for found in FENCE.finditer(page)
    ]


def printed(page, name):
    """For each block that runs: it, what it printed, and the block of text that follows it or None.

    What a compiler would print is None where there is none, and so is what public logs would say.
    """
    from symheli.errors import CompilerWarning

    found, module = blocks(page), types.ModuleType("page")
    sys.modules["page"] = module  # where classes of the page are looked for
    for block, after in zip(found, [*found[1:], None], strict=True):
        if block.kind not in RUNS:
            continue
        out = io.StringIO()
        try:
            with contextlib.redirect_stdout(out), warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", DeprecationWarning)
                warnings.simplefilter("default", CompilerWarning)  # slower, and no fault of a page
                if block.kind == "python":
                    # blank lines in front: an error then names the line of the page
                    code = "\n" * (block.line - 1) + block.code
                    exec(compile(code, name, "exec", dont_inherit=True), vars(module))
                else:
                    if block.kind.endswith(PUBLIC):
                        _link_public_logs(f"{name}, line {block.line}")
                    _shell(block.code)
        except _Skipped:
            yield block, None, None
            continue
        except Exception:
            raise PageError(
                f"{name}, line {block.line}: the block fails\n{traceback.format_exc(limit=-3)}"
            ) from None
        yield block, out.getvalue(), after if after is not None and after.kind == "text" else None


class _Skipped(Exception):
    """A line asks for a C compiler or for public logs, and there are none."""


def _link_public_logs(where):
    """Makes the folder of public logs `logs` in the working folder."""
    folder = os.environ.get("SYMHELI_PUBLIC_LOGS")
    if not folder:
        print(f"{where}: skipped, SYMHELI_PUBLIC_LOGS names no folder", file=sys.stderr)
        raise _Skipped
    if not Path("logs").exists():
        Path("logs").symlink_to(Path(folder).resolve(), target_is_directory=True)


def _shell(code):
    """Runs every line; those of the command line of this package in this process."""
    from studies import cli

    for line in code.replace("\\\n", " ").strip().splitlines():
        words = shlex.split(line, comments=True)
        if not words:
            continue
        if words[0] == "symheli":
            words, into = (words[:-2], words[-1]) if ">" in words[-2:-1] else (words, None)
            with contextlib.ExitStack() as stack:
                if into is not None:
                    file = stack.enter_context(open(into, "w", encoding="utf-8"))
                    stack.enter_context(contextlib.redirect_stdout(file))
                status = cli.main(words[1:])
            if status != 0:
                raise PageError(f"{line}: ended with {status}")
            continue
        if "cc" in words and shutil.which("cc") is None:
            raise _Skipped
        done = subprocess.run(line, shell=True, capture_output=True, text=True)
        if done.returncode:
            raise PageError(f"{line}: ended with {done.returncode}\n{done.stdout}{done.stderr}")
        print(done.stdout, end="")


def difference(found, said):
    """None where what was printed is what the page says, else a sentence.

    Text is the same. A number agrees within one unit of its last printed digit: rounding on another
    processor can move it across one edge. Whole numbers below 20 are counts and agree exactly.
    """
    lines = [_lines(text) for text in (found, said)]
    for number, (one, other) in enumerate(zip(*lines, strict=False), 1):
        same = NUMBER.sub("#", one) == NUMBER.sub("#", other) and all(
            abs(float(a) - float(b)) <= 1.001 * _last_digit(b)
            for a, b in zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)
        )
        if not same:
            return f"line {number} of what is printed\n  prints  {one}\n  says    {other}"
    if len(lines[0]) != len(lines[1]):
        return f"prints {len(lines[0])} lines, says {len(lines[1])}"
    return None


def _lines(text):
    return [line.rstrip() for line in text.rstrip().splitlines()]


def _last_digit(number):
    """One unit of the last digit of a number as printed; 0 of a whole number below 20."""
    mantissa, _, exponent = number.partition("e")
    decimals = len(mantissa.partition(".")[2])
    if not decimals and not exponent and abs(float(number)) < 20:
        return 0.0
    return 10.0 ** (int(exponent or 0) - decimals)


@contextlib.contextmanager
def _in_a_folder():
    """A working folder of its own; figures are drawn without a screen."""
    before = Path.cwd()
    os.environ.setdefault("MPLBACKEND", "Agg")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)


def check(path):
    """Runs a page; `PageError` where a block fails, or with every block that differs."""
    page, name = Path(path).read_text(encoding="utf-8"), Path(path).name
    with _in_a_folder():
        wrong = [
            f"{name}, line {block.line}: the block differs in {other}"
            for block, found, after in printed(page, name)
            if after is not None and (other := difference(found, after.code))
        ]
    if wrong:
        raise PageError("\n".join(wrong))


def write(path):
    """Runs a page and puts what it prints in the place of the text that stands there."""
    path = Path(path)
    page, new = path.read_text(encoding="utf-8"), []
    with _in_a_folder():
        for _, found, after in printed(page, path.name):
            if after is not None and difference(found, after.code):
                new.append((after.span, "\n".join(_lines(found)) + "\n"))
    for (start, end), text in reversed(new):
        page = page[:start] + text + page[end:]
    path.write_text(page, encoding="utf-8")


def run_something(path):
    """Whether a page has a block that runs."""
    return any(b.kind in RUNS for b in blocks(Path(path).read_text(encoding="utf-8")))


def pages():
    """Every page of the site with a block that runs."""
    return [path for path in sorted(DOCS.rglob("*.md")) if run_something(path)]


def _start():
    from studies.threads import one_thread

    one_thread()


def _checked(path):
    try:
        check(path)
    except PageError as error:
        return str(error)
    return None


def check_pages(paths, workers=2):
    """What is wrong, a sentence a page, of pages run side by side in processes of their own."""
    with ProcessPoolExecutor(workers, get_context("spawn"), _start, max_tasks_per_child=1) as pool:
        return [wrong for wrong in pool.map(_checked, paths) if wrong]


def _before_reading(app, environment, names):
    from sphinx.errors import ExtensionError

    paths = [Path(environment.doc2path(name)) for name in names]
    paths = [path for path in paths if path.suffix == ".md" and run_something(path)]
    if app.config.run_pages and (wrong := check_pages(paths)):
        raise ExtensionError("\n\n".join(wrong))


def setup(app):
    """To Sphinx: a page that is new or has changed is run before it is read."""
    app.add_config_value("run_pages", True, "")
    app.connect("env-before-read-docs", _before_reading)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    sys.path.insert(0, str(DOCS.parent))
    _start()
    act, given = (write, sys.argv[2:]) if "--write" in sys.argv[1:2] else (check, sys.argv[1:])
    failed = []
    for page in given or pages():
        try:
            act(page)
        except PageError as error:
            failed.append(str(error))
            print(error, file=sys.stderr, flush=True)
    sys.exit(bool(failed))
