# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The time limit of a search, at which fits look between their steps."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass


class OutOfTimeError(Exception):
    """The time limit is over in the middle of something, whose work is lost."""


@dataclass
class TimeLimit:
    """When a search ends: `end` on the monotonic clock [s].

    `work_counts`: what is under way is worth an end as it stands, rather than none.
    """

    end: float = math.inf
    work_counts: bool = False

    @property
    def over(self) -> bool:
        """Whether the limit is over."""
        return time.monotonic() > self.end

    def ends_fits(self) -> bool:
        """Whether a fit ends as it stands; an OutOfTimeError where it would be of no use."""
        if not self.over:
            return False
        if not self.work_counts:
            raise OutOfTimeError
        return True


_LIMIT: ContextVar[TimeLimit] = ContextVar("time_limit")


@contextmanager
def kept(limit: TimeLimit) -> Iterator[TimeLimit]:
    """Fits within look at this limit."""
    token = _LIMIT.set(limit)
    try:
        yield limit
    finally:
        _LIMIT.reset(token)


def present_limit() -> TimeLimit:
    """Return the limit that fits look at; one without an end if there is none."""
    return _LIMIT.get(TimeLimit())
