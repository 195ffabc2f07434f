# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A film of one motion: the bodies where they are, and their positions until then."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from separatrix import style
from separatrix.checks import count, number
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures.animation import check_format, write_film
from separatrix.figures.pair import carried_stop, stops_of
from separatrix.figures.trajectory import other_bodies, watched_body
from separatrix.labels import axis_label, unit

_MOST_FRAMES = 3000
# so many coils of a spring, and their height in the axes
_COILS, _COIL = 6, 0.25
# beside the watched body, distinguishable in grey
_FACES = ("#ffffff", "#bbbbbb", "#777777", "#dddddd")
_LINES = ("-", (0, (4, 2)), (0, (1, 1)), (0, (6, 2, 1, 2)))


def film(
    motion: xr.Dataset,
    path: Path,
    title: str,
    begin: float | None = None,
    end: float | None = None,
    speed: float = 1.0,
    frames_per_second: float = 25.0,
    dpi: int = 100,
) -> Path:
    """Write the motion between two times [s], the last ten drive periods if none is given; return the path.

    `speed`: seconds of the motion in a second of the film. The suffix of `path`, .gif or .mp4, is the format.
    """
    check_format(path)
    speed = number("film: speed", speed, 0, above=True)
    frames_per_second = number("film: frames_per_second", frames_per_second, 0, above=True)
    count("film: dpi", dpi)
    time = motion["time"].values
    if time.size < 2:
        raise SeparatrixError(f"film: found {time.size} samples, allowed two or more", USAGE)
    end = float(time[-1]) if end is None else number("film: end", end)
    if begin is not None:
        begin = number("film: begin", begin)
    else:
        begin = max(float(time[0]), end - 10 * float(motion.attrs["drive_period"]))
    if not time[0] <= begin < end <= time[-1]:
        raise SeparatrixError(
            f"film: found {begin:g} s to {end:g} s, allowed within {time[0]:g} s to {time[-1]:g} s", USAGE
        )
    shown = np.count_nonzero((time >= begin) & (time <= end))
    if shown < 2:
        raise SeparatrixError(
            f"film: found {shown} samples from {begin:g} s to {end:g} s, allowed two or more", USAGE
        )
    step = speed / frames_per_second
    if (end - begin) / step > _MOST_FRAMES:
        raise SeparatrixError(
            f"film: found {(end - begin) / step:.0f} frames, allowed {_MOST_FRAMES}; a shorter time,"
            " or a higher speed",
            USAGE,
        )
    return write_film(_frames(motion, title, np.arange(begin, end, step), end, dpi), path, frames_per_second)


def _frames(motion: xr.Dataset, title: str, times: np.ndarray, end: float, dpi: int) -> Iterator[Image.Image]:
    with style.context():
        scene = _Scene(motion, title, float(times[0]), end)
        for now in times:
            scene.move_to(float(now))
            page = io.BytesIO()
            scene.figure.savefig(page, format="png", dpi=dpi)
            yield Image.open(page)


class _Scene:
    """The machine above, positions over time below; a frame moves what moves."""

    def __init__(self, motion: xr.Dataset, title: str, begin: float, end: float) -> None:
        self.time = motion["time"].values
        self.positions = {watched_body(motion): motion["x"].values}
        if "driver_x" in motion:
            self.positions["driving body"] = motion["driver_x"].values
        self.positions |= {name: motion[f"{name}_x"].values for name in other_bodies(motion)}
        self.foot = (
            motion["drive"].values if "drive" in motion and np.ptp(motion["drive"].values) > 0 else None
        )
        # stops that the driving body carries, relative to it, and their lines
        self.carried = [(one, None) for one in stops_of(motion)] if carried_stop(motion) else []
        self.is_angle = float(motion.attrs.get("turn", 0)) > 0
        self.figure = Figure(figsize=(5.0, 3.6), layout="constrained")
        top, below = self.figure.subplots(2, 1, height_ratios=(2, 3) if not self.is_angle else (1, 1))
        self.figure.suptitle(title)
        shown = (self.time >= begin) & (self.time <= end)
        self._set_up_machine(top, motion, shown)
        self._set_up_history(below, motion, shown, begin, end)

    def _set_up_machine(self, ax: Axes, motion: xr.Dataset, shown: np.ndarray) -> None:
        ax.set_yticks([])
        self.bodies = []
        if self.is_angle:
            ax.set_aspect("equal")
            ax.set(xlim=(-1.2, 1.2), ylim=(-1.2, 1.2), xticks=[])
            self.bodies = [
                ax.plot([], [], color="black", marker="o", markevery=[1])[0] for _ in self.positions
            ]
            return
        values = [one[shown] for one in self.positions.values()]
        values += [self.foot[shown]] if self.foot is not None else []
        walls = [] if carried_stop(motion) else stops_of(motion)
        values += [self.positions["driving body"][shown] + one for one, _ in self.carried]
        low = min([one.min() for one in values] + walls)
        high = max([one.max() for one in values] + walls)
        room = 0.1 * (high - low or 1.0)
        ax.set(xlim=(low - room, high + room), ylim=(-1, 1), xlabel=axis_label(motion["x"]))
        for wall in walls:
            ax.axvline(wall, color=style.BARRIER, linewidth=3)
        self.carried = [(one, ax.axvline(one, color=style.BARRIER, linewidth=3)) for one, _ in self.carried]
        self.spring = ax.plot([], [], color="#555555", linewidth=0.8)[0]
        self.foot_mark = ax.plot([], [], linestyle="", marker="|", markersize=16, color="#555555")[0]
        for k, name in enumerate(self.positions):
            self.bodies += ax.plot(
                [], [], linestyle="", marker="s", markersize=11, markeredgecolor="black",
                markerfacecolor=_FACES[k % len(_FACES)], label=name, zorder=3,
            )  # fmt: skip
        if len(self.positions) > 1:
            ax.legend(loc="upper right", ncols=3, markerscale=0.5)

    def _set_up_history(
        self, ax: Axes, motion: xr.Dataset, shown: np.ndarray, begin: float, end: float
    ) -> None:
        self.lines: list[tuple[Line2D, Line2D]] = []
        for line, values in zip(_LINES * len(self.positions), self.positions.values(), strict=False):
            ax.plot(self.time[shown], values[shown], color="#cccccc", linewidth=0.8, linestyle=line)
            self.lines.append(
                (ax.plot([], [], color=style.MOTION, linewidth=1.0, linestyle=line)[0],
                 ax.plot([], [], linestyle="", marker="o", markersize=4, color="black")[0])
            )  # fmt: skip
        for wall in [] if carried_stop(motion) else stops_of(motion):
            ax.axhline(wall, color=style.BARRIER, linewidth=1.2)
        ax.set(xlim=(begin, end), xlabel=axis_label(motion["time"]), ylabel=f"position ({unit(motion['x'])})")

    def move_to(self, now: float) -> None:
        """Put everything where it is at a time [s]."""
        past = (self.time >= self.lines[0][0].axes.get_xlim()[0]) & (self.time <= now)
        for body, (line, point), values in zip(self.bodies, self.lines, self.positions.values(), strict=True):
            at = float(np.interp(now, self.time, values))
            line.set_data(np.append(self.time[past], now), np.append(values[past], at))
            point.set_data([now], [at])
            body.set_data([0, np.sin(at)], [0, -np.cos(at)]) if self.is_angle else body.set_data([at], [0])
        for one, wall in self.carried:
            driver = float(np.interp(now, self.time, self.positions["driving body"]))
            wall.set_xdata([driver + one, driver + one])
        if self.foot is None or self.is_angle:
            return
        foot = float(np.interp(now, self.time, self.foot))
        at = float(np.interp(now, self.time, next(iter(self.positions.values()))))
        share = np.linspace(0, 1, 2 * _COILS + 1)
        heights = np.where(np.arange(share.size) % 2, _COIL, -_COIL)
        heights[[0, -1]] = 0
        self.spring.set_data(foot + share * (at - foot), heights)
        self.foot_mark.set_data([foot], [0])
