# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Many motions of a machine between random kicks: what acts on them, their random numbers, their flight."""

from dataclasses import dataclass, field

import numpy as np

from separatrix.cases import Case
from separatrix.errors import GivenUpError
from separatrix.segments import Impacts

__all__ = ["PIECE", "Machine", "Noise", "fly"]

# Motions that are flown at once; their random numbers are drawn together.
PIECE = 1024
# Random numbers of a motion that are drawn at once.
_BLOCK = 64
# Impacts within a step or between samples after which restitution is that of the case: the body chatters.
_MOST_IMPACTS = 64
_FORCE, _WAIT, _IMPULSE, _RESTITUTION = 1, 2, 3, 4


@dataclass(frozen=True)
class Machine:
    """A machine whose state is the start of a segment (`Model.segments`).

    `watched`, `kicked`: where position and velocity of the watched and of the kicked body are in the state.
    `period` [s] of the crank angle, the last number of a state; with a motor the crank is a part of the
    motion instead, and it is infinite.
    """

    case: Case
    start: np.ndarray
    watched: tuple[int, int]
    kicked: tuple[int, int]
    mass: float
    period: float

    @property
    def turns(self) -> bool:
        """Whether the crank angle follows from the time."""
        return np.isfinite(self.period)


@dataclass(frozen=True)
class Noise:
    """What acts on the motions, in SI units: a kick has a velocity, impulses a rate and a velocity."""

    kick: float
    impulses: tuple[float, float] | None
    restitution: float
    deviation: float
    step: float
    stops: tuple[float, float]
    leaves: tuple[float, float]
    at_impact: bool
    seed: int

    @property
    def steps(self) -> bool:
        """Whether anything happens at the end of each step."""
        return self.kick > 0 or bool(np.isfinite(self.leaves).any())


class _Random:
    """Random numbers of a piece of the motions by purpose; a motion has the same for any size of it."""

    def __init__(self, seed: int, piece: int, count: int) -> None:
        self._key, self._count = (seed, piece), count
        self._blocks: dict[tuple[int, int], np.ndarray] = {}

    def take(self, purpose: int, which: np.ndarray, numbers: np.ndarray, oldest: int) -> np.ndarray:
        """Return the given number of each motion; none before the `oldest` is asked for again."""
        wanted = numbers // _BLOCK
        found = np.empty(which.size)
        for block in np.unique(wanted).tolist():
            mine = wanted == block
            found[mine] = self._block(purpose, block)[which[mine], numbers[mine] % _BLOCK]
        for kept in [kept for kept in self._blocks if kept[0] == purpose and kept[1] < oldest // _BLOCK]:
            del self._blocks[kept]
        return found

    def _block(self, purpose: int, block: int) -> np.ndarray:
        if (purpose, block) not in self._blocks:
            # Philox: a counter, and a key that is made of these numbers
            seed = np.random.SeedSequence([*self._key, purpose, block])
            stream = np.random.Generator(np.random.Philox(seed))
            draw = stream.standard_exponential if purpose == _WAIT else stream.standard_normal
            self._blocks[purpose, block] = draw((self._count, _BLOCK))
        return self._blocks[purpose, block]


def fly(
    machine: Machine, noise: Noise, starts: np.ndarray, times: np.ndarray, piece: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return states (motion, time, number) and times of first passage, infinite of what has not left."""
    ensemble = _Ensemble(machine, noise, starts, _Random(noise.seed, piece, len(starts)))
    states = np.empty((len(starts), times.size, starts.shape[1]))
    states[:, 0] = ensemble.state
    ensemble.look(ensemble.all)
    count = 0
    for k in range(1, times.size):
        while True:
            kick_at = (count + 1) * noise.step
            until = min(kick_at, times[k]) if noise.steps else times[k]
            ensemble.move_to(float(until))
            if noise.steps and kick_at <= times[k]:
                ensemble.kick(count)
                count += 1
            ensemble.look(ensemble.all)
            if until >= times[k]:
                break
        states[:, k] = ensemble.state
    return states, ensemble.left


@dataclass
class _Ensemble:
    """Motions that are all at the same time between two kicks."""

    machine: Machine
    noise: Noise
    state: np.ndarray
    random: _Random
    all: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.state)
        self.state = self.state.copy()
        self.all = np.arange(count)
        self.clock = np.zeros(count)
        self.left = np.full(count, np.inf)
        self.impulses = np.zeros(count, int)
        self.impacts = np.zeros(count, int)
        self.next_impulse = np.full(count, np.inf)
        self._wait(self.all)

    def look(self, which: np.ndarray) -> None:
        """Note which of these motions have left."""
        lower, upper = self.noise.leaves
        if lower == -np.inf and upper == np.inf:
            return
        x = self.state[which, self.machine.watched[0]]
        out = which[(x < lower) | (x > upper)]
        self.left[out] = np.minimum(self.left[out], self.clock[out])

    def kick(self, number: int) -> None:
        """Change all velocities by the random force of a step."""
        if self.noise.kick > 0:
            drawn = self.random.take(_FORCE, self.all, np.full(self.all.size, number), number)
            self.state[:, self.machine.kicked[1]] += self.noise.kick * drawn

    def move_to(self, until: float) -> None:
        """Move all to a time [s], past impulses and impacts of random restitution."""
        before = self.impacts.copy()
        going = np.flatnonzero(self.clock < until)
        while going.size:
            aim = np.minimum(self.next_impulse[going], until)
            struck = self._fly(going, aim, self.impacts[going] - before[going] < _MOST_IMPACTS)
            self.clock[going[~struck]] = aim[~struck]
            struck_now = going[~struck & (self.next_impulse[going] <= aim)]
            if struck_now.size:
                self._impulse(struck_now)
            going = going[self.clock[going] < until]

    def _fly(self, going: np.ndarray, aim: np.ndarray, may_bounce: np.ndarray) -> np.ndarray:
        """Fly motions to times; which of them have come to an impact of random restitution before."""
        waits = aim - self.clock[going]
        flown = self.machine.case.model.segments(
            [], np.zeros(0), self.state[going], np.arange(going.size + 1), waits, derivatives=False
        )
        if flown.reason.any():
            raise GivenUpError(f"noise: {np.count_nonzero(flown.reason)} motions had to be given up", None)
        struck = np.zeros(going.size, bool)
        if flown.impact.segment.size and (self.noise.at_impact or self.noise.deviation > 0):
            first, at = np.unique(flown.impact.segment, return_index=True)
            if self.noise.at_impact:
                hit = going[first]
                self.left[hit] = np.minimum(self.left[hit], self.clock[hit] + flown.impact.time[at])
            if self.noise.deviation > 0:
                struck[first] = may_bounce[first]
                chosen = struck[first]
                self._bounce(going[first[chosen]], at[chosen], flown.impact)
        moved = going[~struck]
        if self.machine.turns:
            self.state[moved, -1] = self._angle(moved, waits[~struck])
        self.state[moved, : flown.motion.shape[1]] = flown.motion[~struck]
        return struck

    def _bounce(self, hit: np.ndarray, at: np.ndarray, impact: Impacts) -> None:
        """Put motions of one body behind an impact, each with a restitution of its own."""
        drawn = self.random.take(_RESTITUTION, hit, self.impacts[hit], int(self.impacts.min()))
        coefficient = np.clip(self.noise.restitution + self.noise.deviation * drawn, 0.0, 1.0)
        x, v = self.machine.watched
        self.state[hit, -1] = self._angle(hit, impact.time[at])
        self.state[hit, x] = np.where(impact.side[at] > 0, self.noise.stops[1], self.noise.stops[0])
        self.state[hit, v] = -impact.side[at] * coefficient * np.abs(impact.speed_before[at])
        self.clock[hit] += impact.time[at]
        self.impacts[hit] += 1

    def _angle(self, which: np.ndarray, waits: np.ndarray) -> np.ndarray:
        """Crank angles after waiting [rad]."""
        return np.mod(self.state[which, -1] + 2 * np.pi * waits / self.machine.period, 2 * np.pi)

    def _impulse(self, struck_now: np.ndarray) -> None:
        drawn = self.random.take(_IMPULSE, struck_now, self.impulses[struck_now], int(self.impulses.min()))
        self.state[struck_now, self.machine.kicked[1]] += self.noise.impulses[1] * drawn
        self.look(struck_now)
        self.impulses[struck_now] += 1
        self._wait(struck_now)

    def _wait(self, which: np.ndarray) -> None:
        if self.noise.impulses is None:
            return
        waits = self.random.take(_WAIT, which, self.impulses[which], int(self.impulses.min()))
        self.next_impulse[which] = self.clock[which] + waits / self.noise.impulses[0]
