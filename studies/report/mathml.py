"""Formulas as MathML, which browsers draw without any library.

An argument that begins with `<` is MathML already. Any other is a row of atoms between spaces: a
word is an identifier, a number a number, anything else an operator.
"""

from __future__ import annotations

import re
from html import escape
from unicodedata import normalize

Part = str | float
"""MathML, atoms between spaces, or a number."""


def row(*parts: Part) -> str:
    """Side by side."""
    return f"<mrow>{''.join(map(_atom, parts))}</mrow>"


def words(text: str) -> str:
    """Upright text."""
    return f"<mtext>{escape(text)}</mtext>"


def fraction(above: Part, below: Part) -> str:
    """Above over below."""
    return f"<mfrac>{_atom(above)}{_atom(below)}</mfrac>"


def sub(base: Part, index: Part) -> str:
    """With an index."""
    return f"<msub>{_atom(base)}{_atom(index)}</msub>"


def sup(base: Part, power: Part) -> str:
    """With a power."""
    return f"<msup>{_atom(base)}{_atom(power)}</msup>"


def dot(letter: str) -> str:
    """A derivative with respect to time."""
    return _accented(letter, "\N{COMBINING DOT ABOVE}")


def hat(letter: str) -> str:
    """An estimate."""
    return _accented(letter, "\N{COMBINING CIRCUMFLEX ACCENT}")


def bar(letter: str) -> str:
    """A mean."""
    return _accented(letter, "\N{COMBINING MACRON}")


def _accented(letter: str, accent: str) -> str:
    return f'<mi class="accented">{normalize("NFC", letter + accent)}</mi>'


def total(index: Part, last: Part, *summand: Part) -> str:
    """A sum from index to last."""
    return row(f"<munderover><mo>∑</mo>{_atom(index)}{_atom(last)}</munderover>", *summand)


def extremum(which: str, over: Part, *of: Part) -> str:
    """sup, inf, min or max over something."""
    return row(f"<munder><mo>{which}</mo>{_atom(over)}</munder>", *of)


def norm(*parts: Part) -> str:
    """Between double bars."""
    return row("‖", *parts, "‖")


def root(*parts: Part) -> str:
    """The square root."""
    return f"<msqrt>{''.join(map(_atom, parts))}</msqrt>"


def matrix(*rows: tuple[Part, ...]) -> str:
    """In brackets, which the style sheet draws, row by row."""
    cells = ("".join(f"<mtd>{_atom(cell)}</mtd>" for cell in each) for each in rows)
    table = "".join(f"<mtr>{each}</mtr>" for each in cells)
    return f'<mtable class="brackets">{table}</mtable>'


SPACE = '<mspace width="1em"/>'
"""Between two formulas."""


def display(*parts: Part) -> str:
    """A formula on a line of its own."""
    return f'<math display="block">{row(*parts)}</math>'


def inline(*parts: Part) -> str:
    """A formula in the text."""
    return f"<math>{row(*parts)}</math>"


def _atom(part: Part) -> str:
    if not isinstance(part, str):
        return f"<mn>{part:g}</mn>"
    if part.startswith("<") and part != "<":
        return part
    if len(atoms := part.split()) > 1:
        return row(*atoms)
    if re.fullmatch(r"[^\W\d_]+", part):
        return f"<mi>{escape(part)}</mi>"
    if re.fullmatch(r"[\d.]+", part):
        return f"<mn>{part}</mn>"
    return f"<mo>{escape(part)}</mo>"
