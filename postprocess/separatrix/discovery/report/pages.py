# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sections of text, tables and figures as one self-contained HTML page, and the same page printed on A4."""

import base64
import functools
import io
import logging
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

from separatrix import style
from separatrix.version import __version__


@dataclass
class Table:
    """A table of texts."""

    head: list[str]
    rows: list[list[str]]


@dataclass
class Picture:
    """A figure and its caption."""

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
class Beside:
    """Figures side by side."""

    pictures: list[Picture]


Content = str | list[str] | Table | Picture | Beside


@dataclass
class Section:
    """A heading and what stands below it: paragraphs, lists (of str), tables, pictures."""

    key: str
    title: str
    body: list[Content] = field(default_factory=list)


_CSS = (Path(__file__).parent / "report.css").read_text(encoding="utf-8")


def page_of(title: str, sections: list[Section]) -> str:
    """The page as HTML, for the screen and for print; nothing in it is loaded from elsewhere."""
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
    return "\n".join([*parts, "</body></html>", ""])


def _html(one: Content) -> str:
    if isinstance(one, Beside):
        pictures = "".join(_html(each) for each in one.pictures)
        return f'<div class="beside">{pictures}</div>' if len(one.pictures) > 1 else pictures
    if isinstance(one, str):
        return f"<p>{escape(one)}</p>"
    if isinstance(one, list):
        return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in one) + "</ul>"
    if isinstance(one, Table):
        head = "".join(f"<th>{escape(cell)}</th>" for cell in one.head)
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in one.rows)
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    data = base64.b64encode(one.png).decode("ascii")
    width = round(one.figure.get_figwidth() * 25.4 * 4.6)
    caption = escape(one.caption)
    return (
        f'<figure id="{one.name}"><img width="{width}" alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def write_pdf(path: Path, page: str) -> str:
    """Print a page that `page_of` made on A4; return why there is no PDF, '' where there is one."""
    try:
        from weasyprint import HTML
    except (ImportError, OSError):
        path.unlink(missing_ok=True)
        return "no report.pdf: it needs pip install 'separatrix[report]' and the library Pango of the system"
    for name in ("weasyprint", "fontTools"):
        logging.getLogger(name).setLevel(logging.ERROR)
    HTML(string=page).write_pdf(path)
    return ""
