"""Formulas as pictures within the page: no script, no font and no host is needed to read them."""

import html
from typing import Any

import ziamath
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

# Outlines in each picture, as names of shared ones would clash on a page.
ziamath.config.svg2 = False


def _drawn(node: nodes.Element, *, inline: bool) -> str:
    """The SVG of a formula, on the line of the text around it."""
    text = node.astext()
    try:
        formula = ziamath.Latex(text, size=16, inline=inline, color="currentColor")
    except Exception as error:
        # What ziamath raises for a formula that it cannot read is no one class.
        raise ExtensionError(f"{node.source}:{node.line}: the formula {text!r} cannot be drawn") from error
    label = f'<svg role="img" aria-label="{html.escape(text)}" style="vertical-align:{formula.getyofst():.2f}px"'
    return formula.svg().replace("<svg", label, 1)


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(f'<span class="math">{_drawn(node, inline=True)}</span>')
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="math" style="overflow-x:auto">{_drawn(node, inline=False)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer under the name ``svg``."""
    app.add_html_math_renderer("svg", inline_renderers=(_inline, None), block_renderers=(_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
