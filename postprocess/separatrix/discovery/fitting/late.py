# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A delayed position sensor, beside a velocity without delay.

`sensor_delay` is a delay of x. The library begins a segment at the state that the first sample shows, a delay
before the time of that sample, and gives the velocity of that instant. The recorded v of a time is the
velocity of the body a delay later.
"""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.policy import FIT
from separatrix.errors import SeparatrixError

DELAY = "effect.sensor_delay.delay"


@dataclass
class Flown:
    """A flight: delayed x and undelayed v, each with its derivatives."""

    shown: object
    v: np.ndarray
    velocity_jacobian: np.ndarray | None


def flown_late(
    model,
    active: list[str],
    given: np.ndarray,
    start: np.ndarray,
    first: np.ndarray,
    times: np.ndarray,
    frequency: float,
    **more,
) -> Flown:
    """Segments (arguments of `Model.segments`) of a machine with a delayed sensor, and velocities at `times`.

    `frequency` is that of the drive [rad/s]. Before its start, which is away from impacts and turning points,
    a body has the acceleration of its start.
    """
    index = active.index(DELAY)
    delay, count = float(given[index]), times.size
    segment = np.repeat(np.arange(len(start)), np.diff(first))
    if abs(delay) > np.max(times, initial=0.0):
        raise SeparatrixError(f"{DELAY}: found {delay:.3g} s, allowed less than a segment lasts")
    short = FIT.late_share * np.minimum.reduceat(np.where(times > 0, times, np.inf), first[:-1])
    prompt = times + delay
    every = np.concatenate([times, np.maximum(prompt, 0.0), short])
    owner = np.concatenate([segment, segment, np.arange(len(start))])
    order = np.lexsort((every, owner))
    whole = model.segments(
        active, given, start, np.searchsorted(owner[order], np.arange(len(start) + 1)), every[order], **more
    )
    back = np.empty_like(order)
    back[order] = np.arange(order.size)
    at, later, soon = back[:count], back[count : 2 * count], back[2 * count :]
    shown = _Shown(whole, at)
    v0 = whole.v[at[first[:-1]]]
    acceleration = ((whole.v[soon] - v0) / short)[segment]
    before = np.minimum(prompt, 0.0)
    v = whole.v[later] + acceleration * before
    if whole.jacobian is None:
        return Flown(shown, v, None)
    jacobian = whole.jacobian[later, 1]
    n = len(more["directions"])
    # by the delay with the start as it is: what comes later is what an earlier start would lead to
    later_start = start[segment, 1] * jacobian[:, n] + acceleration * jacobian[:, n + 1]
    along = np.asarray(more["directions"])[:, index]
    jacobian[:, :n] += np.outer(later_start + frequency * jacobian[:, n + 2], along)
    return Flown(shown, v, jacobian)


class _Shown:
    """Some samples of a flight, and what belongs to its segments."""

    def __init__(self, whole, at: np.ndarray) -> None:
        self.x, self.v = whole.x[at], whole.v[at]
        self.jacobian = None if whole.jacobian is None else whole.jacobian[at]
        self.impacts, self.impact, self.steady, self.reason = (
            whole.impacts,
            whole.impact,
            whole.steady,
            whole.reason,
        )
