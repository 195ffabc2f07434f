# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a figure is drawn: on a page with title, legend and caption, or in axes of the user."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.transforms import ScaledTranslation

from separatrix import style
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures.caption import shown
from separatrix.figures.look import Look
from separatrix.layout import compose

Maker = Callable[[], Figure]
_BESIDE = 4.0  # points between the label of an axis and the legend below
_ROOM = 0.01  # of the range of values, beside the first and the last


def show_all(ax: Axes, values: np.ndarray) -> None:
    """Limit the horizontal axis to values, with room for whole markers at the ends."""
    low, high = float(values.min()), float(values.max())
    if high > low:
        room = _ROOM * (high - low)
        ax.set_xlim(low - room, high + room)


class Figures(Mapping):
    """Figures by name, each drawn when it is taken; `more` are drawn on request alone."""

    def __init__(self, makers: Mapping[str, Maker], more: Mapping[str, Maker] | None = None) -> None:
        """Take what draws them."""
        self._makers, self._all = makers, {**makers, **(more or {})}

    def __getitem__(self, name: str) -> Figure:
        """Draw a figure. SeparatrixError if there is none of this name."""
        if name not in self._all:
            raise SeparatrixError(f"no figure '{name}'; there are {', '.join(self._all)}", USAGE)
        return self._all[name]()

    def __contains__(self, name: object) -> bool:
        """Whether there is a figure of this name."""
        return name in self._all

    def __iter__(self) -> Iterator[str]:
        """Names of the figures that are drawn without a request."""
        return iter(self._makers)

    def __len__(self) -> int:
        """How many these are."""
        return len(self._makers)


class Page:
    """The axes of a figure, in rows; without axes in `look` those of a new figure."""

    def __init__(
        self, look: Look, size: tuple[float, float], panels: int = 1, columns: int = 1, **sharing: object
    ) -> None:
        """Make the axes, or take those of `look`; `size`: width of the page and height of the axes in mm."""
        self.look = look
        if look.ax:
            if len(look.ax) != panels:
                many = "" if panels == 1 else " in a sequence, one for each panel"
                raise SeparatrixError(
                    f"ax: found {len(look.ax)} axes, this figure needs {panels}{many}", USAGE
                )
            self.axes = list(look.ax)
            return
        figure = style.new_figure(*(look.size or size))
        grid = figure.subplots(-(-panels // columns), columns, squeeze=False, **sharing).ravel()
        for spare in grid[panels:]:
            spare.remove()
        for above in grid[max(0, panels - columns) : panels]:
            above.xaxis.set_tick_params(labelbottom=True)
        self.axes = list(grid[:panels])

    @property
    def figure(self) -> Figure:
        """The figure of the axes; of a part of a figure the whole."""
        return self.axes[0].figure.figure

    def letter(self) -> None:
        """Letter the panels, as the caption calls them; axes of the user are lettered by the user."""
        for letter, ax in zip("abcdefgh", () if self.look.ax else self.axes, strict=False):
            ax.set_title(f"{letter})", loc="left")

    def finish(
        self, title: str, caption: Sequence[str], handles: Sequence[Artist] = (), columns: int = 1
    ) -> Figure:
        """Return the figure with title, legend and caption; axes of the user get no caption."""
        if not self.look.ax:
            compose(self.figure, title, shown(caption, self.look), handles, columns)
            return self.figure
        last = self.axes[-1]
        for ax in self.axes[:-1]:
            if not ax.get_xlabel() and _is_labelled(ax):
                ax.set_xlabel(last.get_xlabel())
        for ax in self.axes:
            _raise_titles(ax)
        if title:
            self.axes[0].set_title("\n".join(text for text in (title, self.axes[0].get_title()) if text))
        if handles:
            _legend_below(last, handles, columns)
        return self.figure


def label(ax: Axes, across: str, up: str) -> None:
    """Label the axes of a panel where their ticks are labelled: those inside a grid may share labels."""
    if _is_labelled(ax):
        ax.set_xlabel(across)
    if ax.yaxis.get_tick_params().get("labelleft", True):
        ax.set_ylabel(up)


def _is_labelled(ax: Axes) -> bool:
    return ax.xaxis.get_tick_params().get("labelbottom", True)


def _raise_titles(ax: Axes) -> None:
    """Let titles, also later ones, stand above what is written above the axes: they clear child axes."""
    above = max((text.get_window_extent().y1 for text in ax.texts), default=0.0) - ax.get_window_extent().y1
    if above > 0:
        lifted = ScaledTranslation(0, above / ax.figure.dpi, ax.figure.dpi_scale_trans)
        ax.inset_axes((0, 0, 1, 1), transform=ax.transAxes + lifted).set_visible(False)


def _legend_below(ax: Axes, handles: Sequence[Artist], columns: int) -> Legend:
    """Put a legend below the label of the horizontal axis, in so many columns as its width has room for."""
    box, labels = ax.get_window_extent(), ax.xaxis.get_tightbbox()
    depth = (box.y0 - labels.y0 if labels else 0.0) / ax.figure.dpi + _BESIDE / 72
    below = ax.transAxes + ScaledTranslation(0, -depth, ax.figure.dpi_scale_trans)
    for number in range(columns, 0, -1):
        legend = ax.legend(
            handles=handles, ncols=number, loc="upper center", bbox_to_anchor=(0.5, 0.0),
            bbox_transform=below, frameon=False, borderaxespad=0.0, handlelength=1.4,
        )  # fmt: skip
        if legend.get_window_extent().width <= box.width:
            break
    return legend
