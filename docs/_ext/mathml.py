# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mathematics as MathML in a mathematics font of the site: no script, nothing from outside."""

import html
import shutil
from pathlib import Path

from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

# Latin Modern Math, as the packages fonts-lmodern (Debian) and texlive install it; site.css names it.
FONT = "latinmodern-math.otf"
FOLDERS = ("/usr/share/texmf/fonts", "/usr/share/texlive/texmf-dist/fonts", "/usr/share/fonts")


def _font() -> Path:
    found = [path for folder in FOLDERS for path in sorted(Path(folder).rglob(FONT))]
    if not found:
        raise ExtensionError(f"{FONT} is not installed; scripts/bootstrap.sh --docs installs it")
    return found[0]


def _copy_font(app: Sphinx, error: Exception | None) -> None:
    if error is None and app.builder.format == "html":
        shutil.copyfile(_font(), Path(app.outdir) / "_static" / FONT)


def _mathml(node: nodes.Element, block: bool) -> str:
    try:
        return LatexToMathML().convert_with_local_state(node.astext(), displaystyle=block)
    except LatexError as error:
        logging.getLogger(__name__).warning(f"{node.astext()}: {error}", location=node)
        return f"<code>{html.escape(node.astext())}</code>"


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(_mathml(node, False))
    raise nodes.SkipNode


def _display(translator: HTML5Translator, node: nodes.math_block) -> None:
    label = f' id="{node["ids"][0]}"' if node["ids"] else ""
    translator.body.append(f'<div class="math"{label}>{_mathml(node, True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict:
    """Register the renderer and the font."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    app.connect("build-finished", _copy_font)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
