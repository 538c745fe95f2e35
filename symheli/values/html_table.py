"""Values as tables of a notebook."""

from __future__ import annotations

from html import escape
from itertools import groupby
from typing import Any

from symheli.values.summary import has_words, rows


def as_table(self: Any) -> str:
    """The `_repr_html_` of such a value: what its `__repr__` says as a table."""
    if has_words(self):
        return _html(str(self))
    cells = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(text)}</td></tr>'
        for name, text in rows(self)
    )
    title = escape(type(self).__name__)
    return (
        f'<table><caption style="text-align:left">{title}</caption><tbody>{cells}</tbody></table>'
    )


def _html(text: str) -> str:
    """Return lines of text as rows of a table: where lines have two spaces in a row, a cell for
    each column of characters, a head of one line with those below it; other lines over its whole
    width.
    """
    lines = text.splitlines()
    blocks = [list(group) for _, group in groupby(lines, lambda line: "  " in line.strip())]
    wide = [block if "  " in block[0].strip() else [] for block in blocks]
    columns = [
        _columns([*block, *following]) if block and len(block) == 1 else _columns(block)
        for block, following in zip(wide, [*wide[2:], [], []], strict=False)
    ]
    width = max(map(len, columns), default=0) or 1
    rows = []
    for block, ends in zip(blocks, columns, strict=True):
        for line in block:
            cells = [line[a:b].strip() for a, b in ends] or [line.strip()]
            span = f' colspan="{width}"' if not ends else ""
            rows.append(
                "".join(
                    f'<td{span} style="text-align:{_side(cell)}">{escape(cell)}</td>'
                    for cell in cells
                )
            )
    return f"<table><tbody>{''.join(f'<tr>{row}</tr>' for row in rows)}</tbody></table>"


def _columns(block: list[str]) -> list[tuple[int, int]]:
    """Return (start, end) of the columns between which every line is blank."""
    wide = max(map(len, block), default=0)
    used = [any(line[k : k + 1].strip() for line in block) for k in range(wide)]
    starts = [k for k in range(wide) if used[k] and (k == 0 or not used[k - 1])]
    return list(zip(starts, [*starts[1:], wide], strict=False))


def _side(cell: str) -> str:
    return "right" if cell[:1].isdigit() or cell[:2].strip("-").isdigit() else "left"
