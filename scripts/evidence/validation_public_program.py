# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the cases of examples/validation/public/ and what they give."""

from collections.abc import Sequence

import evidence_program
import numpy as np
from evidence_rows import SOURCE, Row
from separatrix import open_result
from separatrix.open import decode_flags

CLOSED = "closed form"


class Program(evidence_program.Program):
    """Runs of the program on these cases."""

    cases = SOURCE / "examples" / "validation" / "public"

    def times(self, case: str, **settings: str | float) -> list[tuple[str, float]]:
        """Kind and time of every event of a motion."""
        with open_result(self.run("trajectory", case, **settings)) as result:
            names, at = decode_flags(result["event_kind"]).values, result["event_time"].values
            return list(zip(map(str, names), map(float, at), strict=True))

    def ends(self, case: str, *names: str, **settings: str | float) -> list[float]:
        """The last samples of columns."""
        with open_result(self.run("trajectory", case, **settings)) as result:
            return [float(result[name][-1]) for name in names]


def series(
    source: str, what: str, theirs: Sequence[float], ours: Sequence[float] | np.ndarray, bar: float
) -> list[Row]:
    """A number of each pair; what is missing differs."""
    found = [*map(float, ours), *[float("nan")] * len(theirs)]
    return [Row(source, f"{what} {k + 1}", value, found[k], bar) for k, value in enumerate(theirs)]


def largest(
    source: str, what: str, theirs: Sequence[float], ours: Sequence[float] | np.ndarray, bar: float
) -> Row:
    """The largest difference of two lists, infinite where one is longer."""
    apart = np.inf
    if len(theirs) == len(ours):
        apart = float(np.max(np.abs(np.asarray(theirs) - np.asarray(ours))))
    return Row(source, f"{what}: largest difference of {len(theirs)}", 0.0, apart, bar)
