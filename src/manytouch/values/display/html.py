"""Small HTML tables, which notebooks show for values."""

from collections.abc import Iterable, Sequence
from html import escape

LEFT = ' style="text-align:left"'


def facts_table(title: str, rows: Iterable[tuple[str, object]]) -> str:
    """A table of names and values below a title; texts are escaped."""
    lines = "".join(
        f"<tr><th{LEFT}>{escape(name)}</th><td{LEFT}>{escape(str(value))}</td></tr>" for name, value in rows
    )
    return f"<table><caption{LEFT}>{escape(title)}</caption>{lines}</table>"


def columns_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table with a header; texts are escaped."""
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    lines = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><tr>{head}</tr>{lines}</table>"
