# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One table of the attractors of several maps, the same motion with the same number."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from separatrix.errors import USAGE, SeparatrixError
from separatrix.open import table

if TYPE_CHECKING:
    import pandas

__all__ = ["attractors_of"]

# Distance of section points, in sizes of the motions, beyond which two attractors are not the same.
_FARTHEST = 1.0


def attractors_of(maps: Mapping[str, xr.Dataset] | Sequence[xr.Dataset]) -> "pandas.DataFrame":
    """Return one table of the attractors of several maps, such as those of a study over a parameter.

    Attractors are carried from each map to the next by the rule of the slices of one map: the same regime
    and period, the nearest section points, closer than the size of the motions; no two of a map have one
    number. What is new has the next number; a motion that comes back has its old one.

    Parameters
    ----------
    maps
        Results of `sx.basin` without parameter axes, in order: by name, or a sequence, numbered from 0.

    Returns
    -------
    pandas.DataFrame
        The columns of `result.separatrix.attractors`, with the index (`case`, `joint`): the map, and the
        number over all maps. The label within its map is the column `attractor`.

    Raises
    ------
    SeparatrixError
        For anything that is no map, or one of several slices.

    Examples
    --------
    >>> case = sx.load("examples/basin_coulomb.toml")
    >>> maps = {ratio: sx.basin(case.with_(drive__ratio=ratio), x0=12, v0=12) for ratio in (1.2, 1.21)}
    >>> sx.attractors_of(maps)["regime"].unstack().loc[1.21].tolist()
    ['non_impact', 'impact']
    """
    import pandas

    named = maps if isinstance(maps, Mapping) else dict(enumerate(maps))
    known: dict[int, _Seen] = {}
    frames = []
    for name, result in named.items():
        if result.attrs.get("kind") != "basin":
            raise SeparatrixError(f"maps: found a {result.attrs.get('kind')} ({name}), allowed maps", USAGE)
        frame = result.separatrix.attractors.reset_index()
        if "slice" in frame and frame["slice"].nunique() > 1:
            raise SeparatrixError(
                f"maps: {name} has several slices, allowed maps without parameter axes", USAGE
            )
        seen = [_Seen(frame, result, entry) for entry in range(len(frame))]
        frame.insert(0, "joint", _carried(known, seen))
        known |= dict(zip(frame["joint"], seen, strict=True))
        frame.insert(0, "case", [name] * len(frame))
        frames.append(frame.sort_values("joint"))
    if not frames:
        raise SeparatrixError("maps: found none", USAGE)
    return pandas.concat(frames, ignore_index=True).set_index(["case", "joint"])


class _Seen:
    """An attractor as it was seen last: what it is, its section points, and its size."""

    def __init__(self, frame: "pandas.DataFrame", result: xr.Dataset, entry: int) -> None:
        row, catalogue = frame.iloc[entry], table(result, "catalogue")
        self.marks = (row["regime"], int(row["period"]), row.get("kind"))
        self.is_rest = row.get("kind") == "rest"
        self.points = np.array([[row["x"], row["v"]]])
        if "point" in catalogue:
            mine = catalogue["point"].values[catalogue["point_entry"].values == entry]
            if mine.size:
                self.points = mine[:, :2]
        self.scale = np.maximum([row["amplitude"], row["v_max"]], np.finfo(float).tiny)

    def distance(self, other: "_Seen") -> float:
        """Return the distance of the nearest section points, infinite if it cannot be the same motion."""
        if self.marks != other.marks:
            return np.inf
        if self.marks[1] == 0 and not self.is_rest:
            return 0.0
        away = other.points - self.points[0]
        if self.is_rest:
            # positions of rest have no size of their own
            far = float(np.hypot(*away.T).min())
            return _FARTHEST * far / (1 + far)
        return float(np.hypot(*(away / np.maximum(self.scale, other.scale)).T).min())


def _carried(known: dict[int, _Seen], seen: list[_Seen]) -> list[int]:
    """Return the number of each attractor of a map: nearest pairs first, then new ones."""
    pairs = sorted(
        (old.distance(new), number, k) for number, old in known.items() for k, new in enumerate(seen)
    )
    numbers: dict[int, int] = {}
    for distance, number, k in pairs:
        if distance <= _FARTHEST and k not in numbers and number not in numbers.values():
            numbers[k] = number
    following = max(known, default=0)
    for k in range(len(seen)):
        if k not in numbers:
            following += 1
            numbers[k] = following
    return [numbers[k] for k in range(len(seen))]
