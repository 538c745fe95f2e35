"""The reference: a page a room, with every public name under the name it is imported by.

Docstrings are plain text with numpydoc sections, code in backticks and formulas indented; `as_rst`
makes of them what Sphinx reads.
"""

from __future__ import annotations

import importlib
import re
from itertools import groupby
from pathlib import Path

PACKAGES = (
    "symheli",
    "symheli.lpv",
    *("symheli.lpv.tools", "symheli.lpv.bases", "symheli.steady", "symheli.airframe"),
    *("symheli.environment", "symheli.flight", "symheli.records", "symheli.integrate"),
    *("symheli.equations", "symheli.export", "symheli.embedding", "symheli.progress"),
    *("symheli.values", "symheli.errors"),
    "identification",
    *("identification.methods", "identification.forgetting", "identification.judge"),
    *("identification.model", "identification.structure", "identification.design"),
    *("identification.recursive", "identification.export"),
    "synthesis",
    *("synthesis.analysis", "synthesis.designs", "synthesis.objectives", "synthesis.forms"),
    *("synthesis.impose", "synthesis.robust", "synthesis.sets", "synthesis.tubes"),
    *("synthesis.regions", "synthesis.switching", "synthesis.structures", "synthesis.sheet"),
    "synthesis.claims",
)
"""Modules with names for users, the names that count most first."""
OWN = {"symheli.embedding": ("embed",), "symheli.progress": ("watched",)}
"""Names for users of modules without an `__all__`; of errors all classes."""
FIRST_PAGES = ("symheli", "identification", "synthesis")


def public():
    """(package, name, room) of every public class and function, once: where it is imported from
    first, and the room of the file it is written in.
    """
    seen = set()
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in names(module):
            thing = getattr(module, name)
            for at, one in [(package, thing), *results(thing)]:
                if callable(one) and id(one) not in seen:
                    seen.add(id(one))
                    yield at, name if one is thing else one.__name__, _room(package, one)


def names(module):
    """Names of a module for users."""
    own = [n for n, thing in vars(module).items() if isinstance(thing, type) and n[0].isupper()]
    return getattr(module, "__all__", OWN.get(module.__name__, own))


def results(thing):
    """(module, class) of what a public function, or the methods of a public class, return: classes
    of these packages that nobody constructs, and that are not imported by a name of their own.
    """
    methods = vars(thing).values() if isinstance(thing, type) else [thing]
    for method in methods:
        plain = getattr(method, "fget", None) or getattr(method, "__func__", method)
        said = getattr(plain, "__annotations__", {}).get("return", "")
        for word in re.findall(r"[A-Z]\w+", said if isinstance(said, str) else ""):
            found = getattr(plain, "__globals__", {}).get(word)
            if isinstance(found, type) and found.__module__.split(".")[0] in FIRST_PAGES:
                yield found.__module__, found


def _room(package, thing):
    """The folder of its file within a first package; that itself for files beside its folders."""
    top = package.split(".")[0]
    home = getattr(thing, "__module__", package)
    parts = home.split(".") if home.split(".")[0] in FIRST_PAGES else [top]
    if len(parts) < 3:  # a file beside the folders, or the package itself
        return package if package != top else parts[0]
    return ".".join(parts[:2])


def write_pages(folder):
    """The pages as .rst: one a room, and one a package that lists its rooms."""
    folder.mkdir(exist_ok=True)
    rooms = {
        room: list(group) for room, group in groupby(sorted(public(), key=_by_room), key=_by_room)
    }
    written = {}
    for room, names in rooms.items():
        written[f"{room}.rst"] = _page(room, names)
    written["index.rst"] = _index(rooms)
    for old in folder.glob("*.rst"):
        if old.name not in written:
            old.unlink()
    for name, text in written.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def _by_room(found):
    return found[2]


def _heading(text, line):
    return f"{text}\n{line * len(text)}\n"


def _page(room, names):
    text = [_heading(room, "="), f".. automodule:: {room}\n   :no-members:\n"]
    for package, name, _ in sorted(names, key=lambda found: found[1].lower()):
        thing = getattr(importlib.import_module(package), name)
        if isinstance(thing, type):
            kind = "autoexception" if issubclass(thing, BaseException) else "autoclass"
        else:
            kind = "autofunction"
        text.append(f".. {kind}:: {package}.{name}\n")
    return "\n".join(text)


def _index(rooms):
    text = [
        _heading("Reference", "="),
        "Every public name, by the room it lives in, under the name it is imported by. Generated"
        " from the docstrings; their examples are run by the tests.\n",
    ]
    for package in FIRST_PAGES:
        text.append(_heading(package, "-"))
        text.append(".. list-table::\n   :widths: 30 70\n")
        for room in rooms:
            if room.split(".")[0] != package:
                continue
            names = ", ".join(
                f":py:obj:`~{at}.{name}`"
                for at, name, _ in sorted(rooms[room], key=lambda found: found[1].lower())
            )
            text.append(f"   * - :doc:`{room}`\n     - {names}")
        text.append("")
    text.append(".. toctree::\n   :hidden:\n")
    text += [
        f"   {room}" for package in FIRST_PAGES for room in rooms if room.split(".")[0] == package
    ]
    return "\n".join(text) + "\n"


CODE = re.compile(r"(`[^`]+`)")
ACTIVE = re.compile(r"[*|\\\\]|(?<=\w)_(?!\w)")


def as_rst(lines):
    """A docstring with its formulas as literal blocks, its code in double backticks, and nothing
    else that means something to docutils.
    """
    out, prose, formula, last = [], [], None, 0

    def close():
        out.extend(_escaped("\n".join(prose)).split("\n") if prose else [])
        prose.clear()

    example = False
    for number, line in enumerate(lines):
        text, indent = line.strip(), len(line) - len(line.lstrip())
        if not text:
            close()
            example = False
            out.append("")
            continue
        if formula is not None and indent < formula:
            formula = None
        example = example or text.startswith(">>>")
        after_blank = number > 0 and not lines[number - 1].strip()
        if formula is None and not example and after_blank and indent > last:
            out += [" " * last + "::", ""]
            formula = indent
        if formula is not None or example:
            close()
            out.append(line)
        else:
            last = indent
            prose.append(line)
    close()
    return out


def _escaped(text):
    parts = CODE.split(text)
    parts[0::2] = [ACTIVE.sub(r"\\\g<0>", part) for part in parts[0::2]]
    parts[1::2] = [f"`{part}`" for part in parts[1::2]]
    return re.sub(r"``(?=\w)(?<=\w``)", r"``\\ ", "".join(parts))  # a plural of code


def _docstring(app, kind, name, thing, options, lines):
    lines[:] = as_rst(lines)


def _field_of_a_tuple(app, kind, name, thing, skip, options):
    """Leaves out what only says which position a name has."""
    return True if str(getattr(thing, "__doc__", "")).startswith("Alias for field number") else None


NAME = re.compile(rf"(?:{'|'.join(FIRST_PAGES)})(?:\.\w+)+")


def _linked(app, page):
    """Makes a public name that stands in a page as code lead to its place in the reference."""
    from docutils import nodes
    from sphinx import addnodes

    for code in list(page.findall(nodes.literal)):
        name = code.astext().split("(")[0]
        if NAME.fullmatch(name) and not isinstance(code.parent, addnodes.pending_xref):
            code.replace_self(
                addnodes.pending_xref(
                    "", code.deepcopy(), refdomain="py", reftype="obj", reftarget=name
                )
            )


def _before(app):
    write_pages(Path(app.srcdir) / "api")


def setup(app):
    """To Sphinx: the pages are written before any is read."""
    app.connect("builder-inited", _before)
    app.connect("doctree-read", _linked)
    app.connect("autodoc-skip-member", _field_of_a_tuple)
    app.connect("autodoc-process-docstring", _docstring, priority=100)
    return {"parallel_read_safe": True}
