# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the cases of examples/validation/public/ and what they give."""

from collections.abc import Sequence
from dataclasses import dataclass

import h5py
import numpy as np
from validation_structures_program import SOURCE, Number, Program, text

CASES = SOURCE / "examples" / "validation" / "public"
CLOSED = "closed form"


@dataclass(frozen=True)
class Settled(Number):
    """A printed number beside ours and a closed form, which settles who is right where they differ."""

    closed: float

    @property
    def verdict(self) -> str:
        """Whether the difference is within the bar, or theirs is what the closed form is not."""
        agrees = abs(self.ours - self.theirs) <= self.bar
        if agrees or abs(self.ours - self.closed) > 1e-9:
            return "agrees" if agrees else "DIFFERS"
        return f"theirs is off, closed form {self.closed:.9g}"


def events(program: Program, case: str, kind: str, joint: str, **settings: str | float) -> np.ndarray:
    """Time, coordinate, rate before and after of the events of a kind at a joint, a row each."""
    return program.events(CASES / f"{case}.toml", kind, joint, **settings)


def times(program: Program, case: str, **settings: str | float) -> list[tuple[str, float]]:
    """Kind and time of every event of a motion."""
    with h5py.File(program.run("trajectory", CASES / f"{case}.toml", **settings)) as file:
        kinds = text(file["event_kind"].attrs["flag_meanings"]).split()
        values = list(file["event_kind"].attrs["flag_values"])
        names = [kinds[values.index(kind)] for kind in file["event_kind"][:]]
        return list(zip(names, map(float, file["event_time"][:]), strict=True))


def ends(program: Program, case: str, *names: str, **settings: str | float) -> list[float]:
    """The last samples of columns."""
    with h5py.File(program.run("trajectory", CASES / f"{case}.toml", **settings)) as file:
        return [float(file[name][-1]) for name in names]


def series(
    source: str, what: str, theirs: Sequence[float], ours: Sequence[float] | np.ndarray, bar: float
) -> list[Number]:
    """A number of each pair; what is missing differs."""
    found = [*map(float, ours), *[float("nan")] * len(theirs)]
    return [Number(source, f"{what} {k + 1}", value, found[k], bar) for k, value in enumerate(theirs)]


def largest(
    source: str, what: str, theirs: Sequence[float], ours: Sequence[float] | np.ndarray, bar: float
) -> Number:
    """The largest difference of two lists, infinite where one is longer."""
    apart = np.inf
    if len(theirs) == len(ours):
        apart = float(np.max(np.abs(np.asarray(theirs) - np.asarray(ours))))
    return Number(source, f"{what}: largest difference of {len(theirs)}", 0.0, apart, bar)
