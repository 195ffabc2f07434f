# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One style for all figures: print widths, fonts, and the colours of `palette`."""

import io
from contextlib import AbstractContextManager
from pathlib import Path

import matplotlib
import matplotlib.style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from separatrix.errors import USAGE, SeparatrixError
from separatrix.palette import *  # noqa: F403  (style.MOTION, style.palette(3), ...)

SINGLE_COLUMN = 85.0
DOUBLE_COLUMN = 175.0
PNG_DPI = 300
SCALAR_MAP = "cividis"

_RC = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "mathtext.fontset": "dejavusans",
    "font.size": 7.0,
    "axes.titlesize": 7.0,
    "axes.labelsize": 7.5,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "legend.fontsize": 6.5,
    "figure.titlesize": 8.0,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "lines.linewidth": 0.9,
    "legend.frameon": False,
    "legend.handlelength": 1.4,
    "axes.axisbelow": False,
    "image.interpolation": "nearest",
    "savefig.dpi": PNG_DPI,
    "figure.dpi": PNG_DPI,
    # TrueType outlines: journals refuse Type 3
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "none",
}


def context(sheet: str | Path | None = None) -> AbstractContextManager:
    """Return the context of figures; `sheet`: a style of matplotlib, or a file of one, on top of ours."""
    try:
        more = dict(matplotlib.style.library.get(str(sheet), {})) if sheet else {}
        if sheet and not more:
            more = dict(matplotlib.rc_params_from_file(sheet, use_default_template=False))
    except OSError as error:
        raise SeparatrixError(
            f"{sheet}: no style of matplotlib, and no file that can be read", USAGE
        ) from error
    return matplotlib.rc_context({**_RC, **more})


class PrintFigure(Figure):
    """A figure that is saved in this style whatever the settings of the caller, and shown by notebooks."""

    def savefig(self, *arguments: object, **options: object) -> None:
        """Save it as matplotlib does."""
        with context():
            super().savefig(*arguments, **options)

    def _repr_png_(self) -> bytes:
        image = io.BytesIO()
        self.savefig(image, format="png", dpi=200)
        return image.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in mm; no window system is needed."""
    figure = PrintFigure(figsize=(width / 25.4, height / 25.4))
    FigureCanvasAgg(figure)
    return figure
