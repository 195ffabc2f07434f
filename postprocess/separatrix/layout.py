# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Title above, legend and caption below, whatever their length; the axes keep their height."""

import re
from collections.abc import Sequence

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.text import Text

_GAP = 1.2  # mm between blocks
_MARGIN = 1.5  # mm to the edge of the page
_CAPTION_SIZE = 6.0


def compose(
    figure: Figure, title: str, caption: Sequence[str], handles: Sequence[Artist] = (), columns: int = 1
) -> None:
    """Put title, legend and caption around the axes and make the figure higher by what they need.

    `caption` is a list of pieces that are joined and wrapped to the width of the figure; the caption is
    also kept as `figure.separatrix_caption`, unwrapped.
    """
    figure.separatrix_caption = "; ".join(caption)
    width = figure.get_figwidth() * 25.4
    left = _MARGIN / width
    head = figure.text(left, 1.0, "", va="top", fontsize="large")
    foot = figure.text(left, 0.0, "", va="bottom", fontsize=_CAPTION_SIZE, color="#333333", linespacing=1.25)
    _wrap(figure, head, title, width - 2 * _MARGIN)
    _wrap(figure, foot, figure.separatrix_caption, width - 2 * _MARGIN)
    legend = None
    if handles:
        legend = figure.legend(
            handles=handles, loc="lower center", ncols=columns, bbox_to_anchor=(0.5, 0.0), borderaxespad=0.0
        )
    above, foot_height = _height(figure, head), _height(figure, foot)
    legend_height = _height(figure, legend) + _GAP if legend else 0.0
    below = foot_height + legend_height
    total = figure.get_figheight() * 25.4 + above + below + 2 * (_MARGIN + _GAP)
    figure.set_size_inches(width / 25.4, total / 25.4)

    head.set_y(1.0 - _MARGIN / total)
    foot.set_y(_MARGIN / total)
    if legend:
        legend.set_bbox_to_anchor((0.5, (_MARGIN + foot_height + _GAP) / total))
    bottom = (_MARGIN + below + _GAP) / total
    top = 1.0 - (_MARGIN + above + _GAP) / total
    figure.set_layout_engine("constrained", rect=(0.0, bottom, 1.0, top - bottom))


def _height(figure: Figure, artist: Artist) -> float:
    """Height of an artist in mm."""
    return artist.get_window_extent(figure.canvas.get_renderer()).height / figure.dpi * 25.4


def _wrap(figure: Figure, target: Text, content: str, width: float) -> None:
    """Fill a text with lines that are no wider than `width` mm."""
    renderer = figure.canvas.get_renderer()
    lines: list[str] = []
    for word in _words(content):
        longer = f"{lines[-1]} {word}" if lines else word
        target.set_text(longer)
        if lines and target.get_window_extent(renderer).width / figure.dpi * 25.4 <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    target.set_text("\n".join(lines))


def _words(content: str) -> list[str]:
    """Split at blanks, but keep 'symbol = value unit' in one piece."""
    kept = re.sub(r"(?<=\d) (?=(m|s|m/s|N s/m|points)\b)", "\u00a0", content.replace(" = ", "\u00a0=\u00a0"))
    return [word.replace("\u00a0", " ") for word in kept.split(" ")]
