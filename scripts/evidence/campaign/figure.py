# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The confusion matrix."""

from pathlib import Path

import numpy as np
from scoring import Score
from separatrix import style

ENDS = (
    "set with the truth",
    "one of the pair",
    "set without the truth",
    "not-in-catalogue",
    "none",
    "no verdict",
)


def confusion_counts(found: list[Score], rows: list[str]) -> tuple[np.ndarray, list[str]]:
    """Cases by hidden effect and answer; names of the columns: right, sets, abstentions, wrong names."""
    wrong = sorted({one.column for one in found if one.wrong_name and one.column not in ENDS})
    columns = ["right", *ENDS, *wrong]
    counts = np.zeros((len(rows), len(columns)), dtype=int)
    for one in found:
        name = "right" if one.right else one.column
        counts[rows.index(one.truth), columns.index(name)] += 1
    return counts, columns


def confusion(found: list[Score], rows: list[str], path: Path) -> None:
    """Draw it: colours are shares of a row, numbers are cases."""
    counts, columns = confusion_counts(found, rows)
    shares = counts / counts.sum(axis=1, keepdims=True)
    with style.context():
        made = style.new_figure(style.DOUBLE_COLUMN, 45 + 4.6 * len(rows))
        axes = made.add_axes((0.36, 0.02, 0.62, 0.97 - 38 / (45 + 4.6 * len(rows))))
        axes.imshow(shares, cmap="Blues", vmin=0, vmax=1.2, aspect="auto")
        for i, k in zip(*np.nonzero(counts), strict=True):
            colour = "white" if shares[i, k] > 0.6 else "black"
            axes.text(k, i, str(counts[i, k]), ha="center", va="center", color=colour)
        axes.set_xticks(range(len(columns)), columns, rotation=60, ha="left", rotation_mode="anchor")
        axes.xaxis.tick_top()
        axes.set_yticks(
            range(len(rows)),
            [f"{name} ({total})" for name, total in zip(rows, counts.sum(axis=1), strict=True)],
        )
        axes.tick_params(length=0)
        axes.set_xlabel("answer")
        axes.xaxis.set_label_position("top")
        axes.set_ylabel("hidden effect (cases)")
        made.savefig(path, dpi=200)
