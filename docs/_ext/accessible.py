# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What keyboards and screen readers need and the theme leaves out, put into the finished pages."""

from pathlib import Path

from sphinx.application import Sphinx

# what scrolls can be reached by keys; headings have levels, landmarks names; no header of a column is empty
CHANGES = {
    "<pre": '<pre tabindex="0"',
    '<div class="math"': '<div tabindex="0" class="math"',
    '<div class="table-wrapper': '<div tabindex="0" class="table-wrapper',
    'role="heading">': 'role="heading" aria-level="2">',
    '<aside class="sidebar-drawer"': '<aside aria-label="Site" class="sidebar-drawer"',
    '<aside class="toc-drawer': '<aside aria-label="Page" class="toc-drawer',
    '<th class="head"><p></p></th>': '<td class="head"></td>',
}


def _change(app: Sphinx, error: Exception | None) -> None:
    if error is not None or app.builder.format != "html":
        return
    for page in Path(app.outdir).rglob("*.html"):
        old = text = page.read_text()
        for found, wanted in CHANGES.items():
            text = text.replace(wanted, found).replace(found, wanted)
        if text != old:
            page.write_text(text)


def setup(app: Sphinx) -> dict:
    """Change the pages when they are all there."""
    app.connect("build-finished", _change)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
