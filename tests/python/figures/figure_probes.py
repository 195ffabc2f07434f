# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws a figure of a file and looks at it."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from separatrix import style
from separatrix.figures import basin
from separatrix.open import open_result

X0 = np.linspace(-1.0, 0.8, 7)
V0 = np.linspace(-6.0, 6.0, 4)


def colour_at(figure: Figure, x: float, y: float, panel: int = 0) -> tuple:
    """The colour of the rendered figure at a point of the data of one panel."""
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())
    column, row = figure.axes[panel].transData.transform((x, y))
    return tuple(pixels[pixels.shape[0] - 1 - int(row), int(column), :3] / 255)


def legend_texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def draw(path: Path, field: str = "attractor") -> Figure:
    with style.context(), open_result(path) as result:
        return basin.basin_map(path, result, field, "title")


def drawn(path: Path, make: object) -> Figure:
    with style.context(), open_result(path) as result:
        return make(result, "title")
