"""Figures as inline SVG with the colours and the fonts of the page, in its light and its dark theme.

Matplotlib draws with placeholder colours, one for each role; in the finished SVG each is replaced by the
variable of the page's style sheet for that role.
"""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import count
from typing import TYPE_CHECKING, Any

from manytouch.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FOREGROUND, SOFT, FAINT, PAGE_BACKGROUND = "#010203", "#010204", "#010205", "#010206"
"""Placeholder colours, one for each role; `METHOD_COLOURS` are those of the methods, in their order."""
METHOD_COLOURS = ("#010211", "#010212", "#010213", "#010214", "#010215", "#010216")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.6)), (0, (1.5, 1.4)), (0, (6, 1.5, 1.5, 1.5)), "-", "--")
PLOT_SYMBOLS = ("o", "s", "^", "D", "v", "P")
ROLES = {
    FOREGROUND: "var(--foreground)",
    SOFT: "var(--soft)",
    FAINT: "var(--faint)",
    PAGE_BACKGROUND: "var(--paper)",
    **{colour: f"var(--method-{number})" for number, colour in enumerate(METHOD_COLOURS)},
}
LETTERS_PT = 9.0
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "manytouch",
    "font.family": ["DejaVu Sans"],
    "font.size": LETTERS_PT,
    "axes.titlesize": LETTERS_PT + 0.5,
    "axes.titlelocation": "left",
    "axes.titlepad": 8.0,
    "axes.labelsize": LETTERS_PT,
    "xtick.labelsize": LETTERS_PT - 1,
    "ytick.labelsize": LETTERS_PT - 1,
    "legend.fontsize": LETTERS_PT - 1,
    "legend.frameon": False,
    "text.color": FOREGROUND,
    "axes.labelcolor": SOFT,
    "axes.edgecolor": FAINT,
    "axes.titlecolor": FOREGROUND,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": SOFT,
    "ytick.labelcolor": SOFT,
    "grid.color": FAINT,
    "grid.linewidth": 0.5,
    "grid.alpha": 0.55,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "lines.linewidth": 1.8,
    "axes.unicode_minus": True,
}
_numbers = count()


def require_matplotlib() -> None:
    """Raises MissingExtraError when matplotlib is not installed."""
    if find_spec("matplotlib") is None:
        raise MissingExtraError("the report", "matplotlib", "lab")


@contextmanager
def figure(width_in: float = 4.7, height_in: float = 3.1, **layout: Any) -> Iterator["Figure"]:
    """An empty figure in the report's style, to be drawn into and given to `svg` inside the block."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        yield Figure(figsize=(width_in, height_in), layout="constrained", **layout)


def svg(drawn: "Figure", description: str) -> str:
    """The figure as an <svg> element that needs nothing from outside.

    Args:
        drawn: from `figure`.
        description: what it shows, for those who cannot see it.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    FigureCanvasSVG(drawn)
    written = io.StringIO()
    drawn.savefig(
        written, format="svg", transparent=True, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type"))
    )
    return embedded(written.getvalue(), description)


def embedded(text: str, description: str) -> str:
    """A whole SVG file as an element: names made unique, roles for colours, letters of the page."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    width, height = re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text)[0]
    body = text[text.index(">") + 1 :].replace("xlink:href=", "href=")
    mark = f"f{next(_numbers)}-"
    body = re.sub(r'\bid="', f'id="{mark}', body)
    body = re.sub(r'(href="|url\()#', rf"\1#{mark}", body)
    body = re.sub(r"font:\s*([\d.]+)px[^;\"]*", r"font-size: \1px", body)
    for colour, role in ROLES.items():
        body = body.replace(colour, role)
    return f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{_escaped(description)}">{body}'


def legend(axes: "Axes", **where: Any) -> None:
    """The names of the methods, when there are several."""
    handles, _ = axes.get_legend_handles_labels()
    if len(handles) > 1:
        axes.legend(handlelength=2.6, **where)


def empty_chart(axes: "Axes", sentence: str) -> None:
    """Write into a chart without data why there are none."""
    axes.text(0.5, 0.5, sentence, transform=axes.transAxes, ha="center", va="center", color=SOFT, wrap=True)


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
