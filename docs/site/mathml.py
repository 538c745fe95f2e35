"""Formulas as MathML, written when the site is built: no script and no font is loaded to read
them.

Where no font for mathematics is installed browsers neither place accents nor stretch parentheses.
So an accented letter is one character, and the parentheses of a matrix are its rounded borders.
"""

from __future__ import annotations

import re
import unicodedata

from docutils.nodes import SkipNode
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

SAYS = logging.getLogger(__name__)
COMBINING = {"˙": "\u0307", "¨": "\u0308", "ˉ": "\u0304", "^": "\u0302", "ˆ": "\u0302"}
ACCENT = re.compile(
    rf"<mover[^>]*>\s*<mi[^>]*>(\w)</mi>\s*<mo[^>]*>([{''.join(COMBINING)}])</mo>\s*</mover>"
)
MATRIX = re.compile(
    r"<mrow>\s*<mo[^>]*>\(</mo>\s*<mtable>((?:(?!<mtable).)*?)</mtable>\s*<mo[^>]*>\)</mo>\s*</mrow>",
    re.DOTALL,
)


def converted(tex, node, block):
    """The element <math> of a formula; a warning names one that cannot be written so."""
    try:
        written = tex2mathml(tex, as_block=block)
    except MathError as error:
        SAYS.warning("formula: %s in %s", error, tex, location=node)
        return f"<code>{tex}</code>"
    written = ACCENT.sub(_accented, written)
    return MATRIX.sub(r'<mtable class="round">\1</mtable>', written)


def _accented(found):
    letter = unicodedata.normalize("NFC", found[1] + COMBINING[found[2]])
    return f'<mi class="accented">{letter}</mi>'


def inline(writer, node):
    """A formula within a line."""
    writer.body.append(converted(node.astext(), node, block=False))
    raise SkipNode


def block(writer, node):
    """A formula of its own line, with its number."""
    writer.body.append(writer.starttag(node, "div", CLASS="math notranslate nohighlight"))
    writer.body.append(converted(node.astext(), node, block=True))
    if node["number"]:
        writer.body.append(f'<span class="eqno">({node["number"]})')
        writer.add_permalink_ref(node, "Link to this equation")
        writer.body.append("</span>")
    writer.body.append("</div>\n")
    raise SkipNode


def setup(app):
    """To Sphinx."""
    app.add_html_math_renderer(
        "mathml", inline_renderers=(inline, None), block_renderers=(block, None)
    )
    return {"parallel_read_safe": True}
