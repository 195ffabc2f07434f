# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions of one body under random forces, impulses and restitution; survival and first passage over starts.

Between kicks the body moves as in the case, flown by the library. Random numbers belong to the seed, the
motion, and what they are for: they do not depend on how many motions there are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import stats

from separatrix.cases import Case, as_case
from separatrix.errors import USAGE, GivenUpError, SeparatrixError
from separatrix.measuring.sampling import CONFIDENCE
from separatrix.segments import Impacts
from separatrix.version import __version__

__all__ = ["first_passage", "noisy"]

# Kicks of a random force in a drive period, or in one of the spring.
_KICKS = 64
# Motions that are flown at once; their random numbers are drawn together.
_PIECE = 1024
# Impacts within a step or between samples after which restitution is that of the case: the body chatters.
_MOST_IMPACTS = 64
_FORCE, _WAIT, _IMPULSE, _RESTITUTION = 1, 2, 3, 4


@dataclass(frozen=True)
class _Noise:
    """What acts on a motion, checked."""

    case: Case
    kick: float
    impulses: tuple[float, float] | None
    restitution: float
    deviation: float
    step: float
    stops: tuple[float, float]
    leaves: tuple[float, float]
    at_impact: bool
    period: float
    seed: int


def noisy(
    case: Case | str,
    x0: float | str | None = None,
    v0: float | str | None = None,
    crank_angle: float | str | None = None,
    *,
    duration: float | None = None,
    motions: int = 100,
    force: float = 0.0,
    impulses: tuple[float, float] | None = None,
    restitution: float = 0.0,
    leaves: Sequence[float] | str | None = None,
    step: float | None = None,
    samples: int = 200,
    seed: int = 1,
) -> xr.Dataset:
    """Return motions of one body from one start under noise, and the share that has not left yet.

    Parameters
    ----------
    case, x0, v0, crank_angle, duration
        As for `sx.trajectory`; `duration` in s.
    motions
        How many, each with random numbers of its own.
    force
        Intensity I of a white random force F [N^2 s]: <F(t) F(t')> = I delta(t - t'). It acts as a kick at
        the end of each `step`, normally distributed with the variance I step / m^2.
    impulses
        (rate [1/s], deviation [m/s]): changes of velocity at the instants of a Poisson process, normally
        distributed.
    restitution
        Standard deviation of the coefficient of each impact around that of the case, cut off at 0 and 1.
    leaves
        (lower, upper) positions [m] between which a motion stays, looked at after each step and impulse; or
        "impact": it has left at its first impact. Motions that have left go on.
    step
        [s]; a 64th of the drive period if not given.
    samples
        Times, equally spaced over the duration, with the first and the last.
    seed
        Results are the same bits for the same seed; motion k is the same for any number of motions.

    Returns
    -------
    xarray.Dataset
        `x` [m] and `v` [m/s] (motion, time); `first_passage` [s] (motion), NaN of one that has not left; and
        `survival`, `survival_lower`, `survival_upper` (time) with the 95 % interval of Wilson.

    Raises
    ------
    SeparatrixError
        For several bodies, a motor, effects, laws by expressions, random restitution without a rigid contact
        of constant restitution, and values that are not allowed.
    GivenUpError
        If a motion had to be given up.

    Examples
    --------
    >>> case = sx.load("examples/validation/impact_coco.toml")
    >>> ensemble = sx.noisy(case, duration=20, motions=20, restitution=0.05, impulses=(0.2, 0.1))
    >>> dict(ensemble.x.sizes)
    {'motion': 20, 'time': 200}
    """
    case = as_case(case)
    noise = _checked(case, force, impulses, restitution, leaves, step, seed)
    length = _duration(case, duration)
    if motions < 1 or samples < 2:
        raise SeparatrixError("noise: allowed are motions from 1 and samples from 2", USAGE)
    start = case.start(x0=x0, v0=v0, crank_angle=crank_angle)
    row = [start["x0"], start["v0"], start["crank_angle"]]
    times = np.linspace(0.0, length, samples)
    parts = [
        _flown(noise, np.tile(row, (min(_PIECE, motions - first), 1)), times, first // _PIECE)
        for first in range(0, motions, _PIECE)
    ]
    states = np.concatenate([part[0] for part in parts])
    left = np.concatenate([part[1] for part in parts])
    share = wilson((left[:, None] > times).sum(axis=0), motions)
    return xr.Dataset(
        {
            "x": (("motion", "time"), states[..., 0], {"units": "m", "long_name": "position"}),
            "v": (("motion", "time"), states[..., 1], {"units": "m/s", "long_name": "velocity"}),
            "first_passage": ("motion", np.where(np.isfinite(left), left, np.nan), _PASSAGE),
            **{name: ("time", values, _SURVIVAL) for name, values in zip(_SHARES, share, strict=True)},
        },
        {"time": ("time", times, {"units": "s", "long_name": "time since the start"})},
        _attributes(case, "noise", motions, seed),
    )


def first_passage(
    case: Case | str,
    x0: Sequence[float],
    v0: Sequence[float],
    *,
    leaves: Sequence[float] | str,
    duration: float | None = None,
    motions: int = 100,
    force: float = 0.0,
    impulses: tuple[float, float] | None = None,
    restitution: float = 0.0,
    step: float | None = None,
    seed: int = 1,
) -> xr.Dataset:
    """Return over a grid of starts the share of noisy motions that have not left, and when they leave.

    Parameters
    ----------
    x0, v0
        Positions [m] and velocities [m/s] of the starts, or (first, last, count) of each.
    leaves, duration, motions, force, impulses, restitution, step, seed
        As for `sx.noisy`; `motions` from each start.

    Returns
    -------
    xarray.Dataset
        Over (x0, v0): `survival` of the duration, `survival_lower` and `survival_upper`, the 95 % interval of
        Wilson; `passage_time` [s], the mean of the first passages; motions that stay count with the duration.

    Examples
    --------
    >>> case = sx.load("examples/validation/impact_coco.toml")
    >>> starts = sx.first_passage(
    ...     case, [0.0, 0.5], [0.0], leaves="impact", impulses=(0.2, 0.1), motions=5, duration=20
    ... )
    >>> dict(starts.survival.sizes)
    {'x0': 2, 'v0': 1}
    """
    case = as_case(case)
    noise = _checked(case, force, impulses, restitution, leaves, step, seed)
    length = _duration(case, duration)
    if motions < 1:
        raise SeparatrixError("noise: allowed are motions from 1", USAGE)
    axes = [_axis(name, values) for name, values in (("x0", x0), ("v0", v0))]
    angle = case.start(crank_angle=None)["crank_angle"]
    shape = (axes[0].size, axes[1].size)
    starts = np.array([[x, v, angle] for x in axes[0] for v in axes[1]]).repeat(motions, axis=0)
    times = np.array([0.0, length])
    left = np.concatenate(
        [
            _flown(noise, starts[first : first + _PIECE], times, first // _PIECE)[1]
            for first in range(0, len(starts), _PIECE)
        ]
    ).reshape(*shape, motions)
    share = wilson((left > length).sum(axis=-1), motions)
    mean = np.minimum(left, length).mean(axis=-1)
    passage = {"units": "s", "long_name": "mean time of first passage, at most the duration"}
    return xr.Dataset(
        {name: (("x0", "v0"), values, _SURVIVAL) for name, values in zip(_SHARES, share, strict=True)}
        | {"passage_time": (("x0", "v0"), mean, passage)},
        {
            "x0": ("x0", axes[0], {"units": "m", "long_name": "initial position"}),
            "v0": ("v0", axes[1], {"units": "m/s", "long_name": "initial velocity"}),
        },
        {**_attributes(case, "first_passage", motions, seed), "duration": length},
    )


_SHARES = ("survival", "survival_lower", "survival_upper")
_SURVIVAL = {"units": "1", "long_name": "share of the motions that have not left"}
_PASSAGE = {"units": "s", "long_name": "time of first passage"}


def wilson(hits: np.ndarray, count: int, confidence: float = CONFIDENCE) -> tuple[np.ndarray, ...]:
    """Return shares of `count` with the ends of their intervals (Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    z = float(stats.norm.ppf(0.5 + confidence / 2))
    share = np.asarray(hits) / count
    middle = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return share, np.maximum(middle - half, 0.0), np.minimum(middle + half, 1.0)


def _attributes(case: Case, kind: str, motions: int, seed: int) -> dict[str, object]:
    return {
        "kind": kind, "title": case.title, "motions": motions, "seed": seed,
        "source": f"Separatrix {__version__}", "resolved_case": case.to_toml(),
    }  # fmt: skip


def _duration(case: Case, duration: float | None) -> float:
    length = float(case.resolved["run"]["duration"] if duration is None else duration)
    if not 0 < length < np.inf:
        raise SeparatrixError(f"noise: found duration {length:g} s, allowed more than 0", USAGE)
    return length


def _axis(name: str, values: Sequence[float]) -> np.ndarray:
    found = (
        np.linspace(*values) if isinstance(values, tuple) and len(values) == 3 else np.array(values, float)
    )
    if found.ndim != 1 or not found.size or not np.isfinite(found).all():
        raise SeparatrixError(f"{name}: found {values}, allowed numbers, or (first, last, count)", USAGE)
    return found


def _checked(
    case: Case, force: float, impulses: tuple[float, float] | None, restitution: float,
    leaves: Sequence[float] | str | None, step: float | None, seed: int,
) -> _Noise:  # fmt: skip
    resolved = case.resolved
    body = resolved.get("body", {})
    # one of several bodies may be called mass
    one_body = "mass" in body and not isinstance(body["mass"], dict) and "driven_mass" not in body
    other = [name for name in ("motor", "effect", "state", "structure") if name in resolved]
    if not one_body or other:
        found = ", ".join(other) or "several bodies"
        raise SeparatrixError(f"noise: found {found}, allowed one body without effects", USAGE)
    mass = float(resolved["body"]["mass"])
    contact = resolved.get("contact", {"law": "none"})
    if restitution and contact["law"] != "newton":
        raise SeparatrixError(
            f'noise: found restitution with contact.law "{contact["law"]}", allowed newton', USAGE
        )
    rate, deviation = impulses or (0.0, 0.0)
    sizes = (force, rate, deviation, restitution)
    if not all(0 <= one < np.inf for one in sizes) or (impulses and not rate > 0):
        raise SeparatrixError(
            "noise: allowed are values of 0 or more, and a rate of impulses more than 0", USAGE
        )
    at_impact = isinstance(leaves, str)
    if at_impact and leaves != "impact":
        raise SeparatrixError(f'leaves: found "{leaves}", allowed "impact" or (lower, upper)', USAGE)
    if at_impact and contact["law"] == "none":
        raise SeparatrixError(
            'leaves: found "impact" of a body without a contact, allowed (lower, upper)', USAGE
        )
    lower, upper = (-np.inf, np.inf) if leaves is None or at_impact else map(float, leaves)
    if not lower < upper:
        raise SeparatrixError(f"leaves: found {lower} and {upper}, allowed lower < upper", USAGE)
    frequency = float(case.model.drive_frequency({}))
    period = 2 * np.pi / frequency
    step = period / _KICKS if step is None else float(step)
    if not 0 < step < np.inf:
        raise SeparatrixError(f"noise: found step {step:g} s, allowed more than 0", USAGE)
    stops = (float(contact.get("lower", -np.inf)), float(contact.get("upper", np.inf)))
    # an expression where it is not drawn
    coefficient = float(contact["restitution"]) if restitution else 0.0
    return _Noise(
        case, np.sqrt(force * step) / mass, impulses, coefficient, restitution, step, stops, (lower, upper),
        at_impact, period, seed,
    )  # fmt: skip


class _Random:
    """Normal and exponential numbers of a piece of the motions; number k is the same for any size of it."""

    def __init__(self, seed: int, piece: int, count: int) -> None:
        self.seed, self.piece, self.count = seed, piece, count

    def normal(self, *purpose: int) -> np.ndarray:
        return self._stream(purpose).standard_normal(self.count)

    def exponential(self, *purpose: int) -> np.ndarray:
        return self._stream(purpose).standard_exponential(self.count)

    def _stream(self, purpose: tuple[int, ...]) -> np.random.Generator:
        # Philox: a counter, and a key that is made of these numbers
        return np.random.Generator(
            np.random.Philox(np.random.SeedSequence([self.seed, self.piece, *purpose]))
        )


def _flown(noise: _Noise, starts: np.ndarray, times: np.ndarray, piece: int) -> tuple[np.ndarray, np.ndarray]:
    """Return states (motion, time, x and v) and times of first passage, infinite of what has not left."""
    ensemble = _Ensemble(noise, starts, _Random(noise.seed, piece, len(starts)))
    states = np.empty((len(starts), times.size, 2))
    states[:, 0] = ensemble.state[:, :2]
    ensemble.look()
    count = 0
    for k in range(1, times.size):
        while True:
            kick_at = (count + 1) * noise.step
            kicks = noise.kick > 0 or np.isfinite(noise.leaves).any()
            until = min(kick_at, times[k]) if kicks else times[k]
            ensemble.move_to(float(until))
            if kicks and kick_at <= times[k]:
                count += 1
                if noise.kick > 0:
                    ensemble.state[:, 1] += noise.kick * ensemble.random.normal(_FORCE, count)
            ensemble.look()
            if until >= times[k]:
                break
        states[:, k] = ensemble.state[:, :2]
    return states, ensemble.left


class _Ensemble:
    """Motions that are all at the same time between two kicks."""

    def __init__(self, noise: _Noise, starts: np.ndarray, random: _Random) -> None:
        self.noise, self.random, self.state = noise, random, starts.copy()
        self.clock = np.zeros(len(starts))
        self.left = np.full(len(starts), np.inf)
        self.impulses = np.zeros(len(starts), int)
        self.impacts = np.zeros(len(starts), int)
        self.next_impulse = np.full(len(starts), np.inf)
        self.drawn: dict[tuple[int, int], np.ndarray] = {}
        self._wait(np.arange(len(starts)))

    def look(self, which: np.ndarray | slice = slice(None)) -> None:
        """Note which of these motions have left."""
        lower, upper = self.noise.leaves
        x = self.state[which, 0]
        out = (x < lower) | (x > upper)
        self.left[which] = np.where(out, np.minimum(self.left[which], self.clock[which]), self.left[which])

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
        noise = self.noise
        waits = aim - self.clock[going]
        flown = noise.case.model.segments(
            [], np.zeros(0), self.state[going], np.arange(going.size + 1), waits, derivatives=False
        )
        if flown.reason.any():
            raise GivenUpError(f"noise: {np.count_nonzero(flown.reason)} motions had to be given up", None)
        first, at = np.unique(flown.impact.segment, return_index=True)
        if noise.at_impact:
            hit = going[first]
            self.left[hit] = np.minimum(self.left[hit], self.clock[hit] + flown.impact.time[at])
        struck = np.zeros(going.size, bool)
        if noise.deviation > 0:
            struck[first] = may_bounce[first]
        after = np.column_stack([flown.x, flown.v, self._angle(going, waits)])
        chosen = struck[first]
        self._bounce(going[first[chosen]], at[chosen], flown.impact)
        self.state[going[~struck]] = after[~struck]
        return struck

    def _bounce(self, hit: np.ndarray, at: np.ndarray, impact: Impacts) -> None:
        """Put motions behind an impact, each with a restitution of its own."""
        coefficient = np.empty(hit.size)
        for number in np.unique(self.impacts[hit]):
            mine = self.impacts[hit] == number
            coefficient[mine] = self._numbers(_RESTITUTION, int(number))[hit[mine]]
        coefficient = np.clip(self.noise.restitution + self.noise.deviation * coefficient, 0.0, 1.0)
        self.state[hit, 2] = self._angle(hit, impact.time[at])
        self.state[hit, 0] = np.where(impact.side[at] > 0, self.noise.stops[1], self.noise.stops[0])
        self.state[hit, 1] = -impact.side[at] * coefficient * np.abs(impact.speed_before[at])
        self.clock[hit] += impact.time[at]
        self.impacts[hit] += 1

    def _angle(self, which: np.ndarray, waits: np.ndarray) -> np.ndarray:
        """Crank angles after waiting [rad]."""
        return np.mod(self.state[which, 2] + 2 * np.pi * waits / self.noise.period, 2 * np.pi)

    def _impulse(self, struck_now: np.ndarray) -> None:
        deviation = self.noise.impulses[1]
        for number in np.unique(self.impulses[struck_now]):
            mine = struck_now[self.impulses[struck_now] == number]
            self.state[mine, 1] += deviation * self._numbers(_IMPULSE, int(number))[mine]
        self.look(struck_now)
        self.impulses[struck_now] += 1
        self._wait(struck_now)

    def _wait(self, which: np.ndarray) -> None:
        if self.noise.impulses is None:
            return
        for number in np.unique(self.impulses[which]):
            mine = which[self.impulses[which] == number]
            waits = self._numbers(_WAIT, int(number))[mine] / self.noise.impulses[0]
            self.next_impulse[mine] = self.clock[mine] + waits

    def _numbers(self, *purpose: int) -> np.ndarray:
        """Numbers of all motions for a purpose, drawn once."""
        if purpose not in self.drawn:
            draw = self.random.exponential if purpose[0] == _WAIT else self.random.normal
            self.drawn[purpose] = draw(*purpose)
        return self.drawn[purpose]
