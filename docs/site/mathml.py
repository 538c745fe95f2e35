"""Formulas as MathML, written when the site is built: no script and no font is loaded to read
them.
"""

from __future__ import annotations

from docutils.nodes import SkipNode
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

SAYS = logging.getLogger(__name__)


def converted(tex, node, block):
    """The element <math> of a formula; a warning names one that cannot be written so."""
    try:
        return tex2mathml(tex, as_block=block)
    except MathError as error:
        SAYS.warning("formula: %s in %s", error, tex, location=node)
        return f"<code>{tex}</code>"


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
