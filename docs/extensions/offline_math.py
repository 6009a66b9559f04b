"""Formulae as MathML, which browsers draw themselves: the site needs no script from the internet."""

import re

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True}


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(_mathml(node.astext()))
    raise nodes.SkipNode


def _block(translator: HTML5Translator, node: nodes.math_block) -> None:
    translator.body.append(_mathml(node.astext(), is_block=True))
    raise nodes.SkipNode


def _mathml(text: str, *, is_block: bool = False) -> str:
    """MathML of a formula; `tex2mathml` needs braces around the digits of a fraction, which TeX does not."""
    return tex2mathml(re.sub(r"(frac)(\d)(\d)", r"\1{\2}{\3}", text), as_block=is_block)
