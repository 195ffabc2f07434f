# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sections of text, tables and figures as one self-contained HTML page and as a PDF of A4 pages."""

import base64
import functools
import io
import logging
import textwrap
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.image import imread

from separatrix import style
from separatrix.labels import plain
from separatrix.version import __version__

_PAGE = (210.0, 297.0)  # mm
_MARGIN = 18.0
_WIDTH = 100  # characters of a line of text
_TABLE_WIDTH = 108
_CAPTION_WIDTH = 125
_MM_PER_POINT = 25.4 / 72


@dataclass
class Table:
    """A table of texts."""

    head: list[str]
    rows: list[list[str]]


@dataclass
class Picture:
    """A figure and the caption that says what it shows."""

    name: str
    figure: Figure
    caption: str

    @functools.cached_property
    def png(self) -> bytes:
        """The figure as a picture fit for print."""
        buffer = io.BytesIO()
        self.figure.savefig(
            buffer, format="png", dpi=style.PNG_DPI, metadata={"Software": f"separatrix {__version__}"}
        )
        return buffer.getvalue()


@dataclass
class Section:
    """A heading and what stands below it: paragraphs, lists (of str), tables, pictures."""

    key: str
    title: str
    body: list[str | list[str] | Table | Picture] = field(default_factory=list)


_CSS = """
body { font: 16px/1.5 sans-serif; color: #1a1a1a; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2 { line-height: 1.25; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.9rem; }
th, td { border-bottom: 1px solid #ddd; padding: 0.2rem 0.8rem 0.2rem 0; }
th, td { text-align: left; vertical-align: top; }
figure { margin: 1.5rem 0; } img { max-width: 100%; height: auto; }
figcaption { font-size: 0.85rem; color: #444; max-width: 50rem; }
"""


def write_html(path: Path, title: str, sections: list[Section]) -> None:
    """Write the page; nothing in it is loaded from elsewhere."""
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<meta name="generator" content="separatrix {__version__}">',
        f"<title>{escape(title)}</title><style>{_CSS}</style></head><body>",
        f"<h1>{escape(title)}</h1>",
    ]
    for section in sections:
        parts.append(f'<section id="{section.key}"><h2>{escape(section.title)}</h2>')
        parts += [_html(one) for one in section.body]
        parts.append("</section>")
    path.write_text("\n".join([*parts, "</body></html>", ""]), encoding="utf-8")


def _html(one: str | list[str] | Table | Picture) -> str:
    if isinstance(one, str):
        return f"<p>{escape(one)}</p>"
    if isinstance(one, list):
        return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in one) + "</ul>"
    if isinstance(one, Table):
        head = "".join(f"<th>{escape(cell)}</th>" for cell in one.head)
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in one.rows)
        return f"<table><tr>{head}</tr>" + "".join(f"<tr>{row}</tr>" for row in rows) + "</table>"
    data = base64.b64encode(one.png).decode("ascii")
    width = round(one.figure.get_figwidth() * 25.4 * 4.6)
    caption = escape(one.caption)
    return (
        f'<figure id="{one.name}"><img width="{width}" alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def write_pdf(path: Path, title: str, sections: list[Section]) -> None:
    """Write A4 pages of text, tables and figures."""
    # it finds the fonts of matplotlib too old
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    about = {"Title": title, "Creator": f"separatrix {__version__}", "CreationDate": None}
    with PdfPages(path, metadata=about) as pdf:
        sheet = _Sheet(pdf)
        sheet.line(title, size=16, weight="bold", after=4)
        for section in sections:
            first = section.body[0] if section.body else ""
            sheet.keep(24 + (25.4 * first.figure.get_figheight() if isinstance(first, Picture) else 0))
            sheet.line(section.title, size=12, weight="bold", before=5, after=1.5)
            for one in section.body:
                _set(sheet, one)
        sheet.close()


def _set(sheet: "_Sheet", one: str | list[str] | Table | Picture) -> None:
    if isinstance(one, Picture):
        caption = textwrap.wrap(one.caption, _CAPTION_WIDTH)
        sheet.picture(one, room=3.2 * len(caption))
        for line in caption:
            sheet.line(line, size=7.0)
        sheet.skip(3.0)
    elif isinstance(one, str):
        for line in textwrap.wrap(one, _WIDTH):
            sheet.line(line)
        sheet.skip(1.5)
    elif isinstance(one, list):
        for item in one:
            for place, line in enumerate(textwrap.wrap(item, _WIDTH - 4)):
                sheet.line(("\N{BULLET} " if place == 0 else "   ") + line)
        sheet.skip(1.5)
    else:
        for number, row in enumerate(_columns(one)):
            sheet.line(row, size=7.2, family="monospace", weight="bold" if number == 0 else "normal")
        sheet.skip(2.5)


def _columns(table: Table) -> list[str]:
    """Lines of a table in columns; the widest column is wrapped where the page is too narrow."""
    whole = [table.head, *table.rows]
    widths = [max(len(row[i]) for row in whole) for i in range(len(table.head))]
    excess = sum(widths) + 2 * (len(widths) - 1) - _TABLE_WIDTH
    if excess > 0:
        widest = widths.index(max(widths))
        widths[widest] = max(12, widths[widest] - excess)
    lines = []
    for row in whole:
        cells = [textwrap.wrap(cell, width) or [""] for cell, width in zip(row, widths, strict=True)]
        for i in range(max(len(cell) for cell in cells)):
            texts = [cell[i] if i < len(cell) else "" for cell in cells]
            lines.append(
                "  ".join(text.ljust(width) for text, width in zip(texts, widths, strict=True)).rstrip()
            )
    return lines


class _Sheet:
    """A page that is filled from the top; full, it goes into the PDF and the next begins."""

    def __init__(self, pdf: PdfPages) -> None:
        self._pdf = pdf
        self._figure: Figure | None = None
        self._y = 0.0

    def line(
        self,
        text: str,
        size: float = 8.5,
        weight: str = "normal",
        family: str = "sans-serif",
        before: float = 0.0,
        after: float = 0.0,
    ) -> None:
        """Set one line; `size` in points, room before and after it in mm."""
        height = 1.35 * size * _MM_PER_POINT
        self.keep(before + height)
        self._y += before
        self._figure.text(
            _MARGIN / _PAGE[0],
            1 - self._y / _PAGE[1],
            plain(text),
            va="top",
            fontsize=size,
            fontweight=weight,
            family=family,
        )
        self._y += height + after

    def picture(self, one: Picture, room: float) -> None:
        """Place a figure in its own size, with `room` mm below it on the same page."""
        width, height = (25.4 * size for size in one.figure.get_size_inches())
        self.keep(height + room)
        left, low = 0.5 * (_PAGE[0] - width), _PAGE[1] - self._y - height
        place = (left / _PAGE[0], low / _PAGE[1], width / _PAGE[0], height / _PAGE[1])
        ax = self._figure.add_axes(place)
        ax.imshow(imread(io.BytesIO(one.png)), aspect="auto", interpolation="none")
        ax.set_axis_off()
        self._y += height + 1.5

    def skip(self, room: float) -> None:
        """Leave room in mm."""
        self._y += room

    def keep(self, room: float) -> None:
        """Begin a page unless this one has so much room in mm."""
        if self._figure is not None and self._y + room > _PAGE[1] - _MARGIN:
            self.close()
        if self._figure is None:
            self._figure = style.new_figure(*_PAGE)
            self._y = _MARGIN

    def close(self) -> None:
        """Put the page into the PDF."""
        if self._figure is not None:
            self._pdf.savefig(self._figure)
            self._figure = None
