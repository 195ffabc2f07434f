# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Force over position of records that are compared in force, from details.h5."""

import h5py
import numpy as np
from matplotlib.figure import Figure

from separatrix import style
from separatrix.discovery.report.figures import AFTER, BEFORE, MEASURED

_MOST_LOOPS = 3
"""Records that are shown; of more, the last one is held out where one is."""


def loops(details: h5py.File) -> Figure | None:
    """The loops of force over position: measured, and of both machines; None for records of a motion."""
    if details.attrs["compared"] != "force":
        return None
    rows = [(use, name) for use in ("training", "held_out") if use in details for name in details[use]]
    rows = rows[: _MOST_LOOPS - 1] + rows[-1:] if len(rows) > _MOST_LOOPS else rows
    if not rows:
        return None
    figure = style.new_figure(style.DOUBLE_COLUMN, 78.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(1, len(rows), squeeze=False)[0]
    handles = {}
    for (use, name), ax in zip(rows, axes, strict=True):
        record, group = details["records"][name], details[use][name]
        (handles["measured"],) = ax.plot(record["x"][:], record["force"][:], color=MEASURED, linewidth=1.4)
        for stage, dash, colour, label in (
            ("before", "--", BEFORE, "base machine"),
            ("after", "-", AFTER, "extended machine"),
        ):
            if stage not in group:
                continue
            breaks = np.flatnonzero(np.diff(group[stage]["segment"][:])) + 1
            shown = [np.insert(group[stage][key][:], breaks, np.nan) for key in ("x", "force")]
            (handles[label],) = ax.plot(*shown, dash, color=colour, linewidth=0.7)
        ax.set_title(f"{name}, {use.replace('_', ' ')}", loc="left")
        ax.set_xlabel(f"position $x$ ({details.attrs['position_unit']})")
    axes[0].set_ylabel(f"force ({details.attrs['force_unit']})")
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=3)
    return figure
