# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a motion survives random impulses, by simulation and by the law of rare impulses."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.errors import USAGE, SeparatrixError
from separatrix.measuring.maps import Slice, slice_of
from separatrix.measuring.sampling import NOT_KNOWN, generator, share_interval
from separatrix.open import open_result
from separatrix.progress import Progress, Report
from separatrix.version import __version__

__all__ = ["survival"]

_TIMES = 60


def survival(
    result: xr.Dataset | str | Path,
    attractor: int,
    *,
    rate: float,
    deviation: float,
    horizon: float | None = None,
    motions: int = 2000,
    slice: Mapping[str, float] | None = None,
    seed: int = 1,
    threads: int | None = None,
    progress: bool | Report | None = None,
) -> xr.Dataset:
    """Return the share of motions that random impulses have not yet taken out of their basin, over time.

    A motion has left its basin when the state right after an impulse lies in another basin, or has an unknown
    label (counted by `not_known`). `survival` is the share of motions that have not left, with its 95 %
    interval. `law` is exp(-rate p t), which holds for impulses so rare that the motion settles between them.
    `p` is the probability that one impulse at a random crank angle takes the motion out of its basin,
    estimated from further `motions` impulses. Where `survival` and `law` differ, impulses act on motions that
    have not settled.

    Parameters
    ----------
    result, attractor, slice
        A map of one body over x0 and v0, the attractor that the impulses act on, and values of the parameters
        of the map.
    rate
        Mean number of impulses per second (Poisson process).
    deviation
        Standard deviation of the change of velocity by one impulse, which is normally distributed [m/s].
    horizon
        Duration [s]; without one, 20 impulses on average.
    motions
        Number of motions, which start on the attractor at random crank angles.
    seed, threads
        The random numbers depend on the seed. The result does not depend on `threads`.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> alive = sx.survival(result, 2, rate=0.05, deviation=1.0, motions=20)
    >>> 0 <= float(alive["survival"][-1]) <= 1
    True
    """
    if not (rate > 0 and deviation > 0 and motions >= 10):
        raise SeparatrixError("survival: allowed are rate > 0, deviation > 0 and motions from 10", USAGE)
    result = open_result(result) if isinstance(result, str | Path) else result
    found = slice_of(result, slice, None, threads)
    _require(found, attractor)
    length = 20.0 / rate if horizon is None else float(horizon)
    if not 0 < length < np.inf:
        raise SeparatrixError(f"survival: found horizon {length:g} s, allowed a duration above 0", USAGE)
    states = _on_motion(found, attractor, 2 * motions, generator(seed, 10))
    once, _ = _strike(found, attractor, states[:motions].copy(), deviation, generator(seed, 11))
    left, unknown = np.full(motions, np.inf), np.zeros(motions, bool)
    random = generator(seed, 12)
    state, clock = states[motions:].copy(), np.zeros(motions)
    staying = np.arange(motions)
    with Progress(progress) as report:
        while len(staying):
            # drawn for all, so that a motion's impulses do not depend on the others
            waits = random.exponential(1 / rate, motions)[staying]
            going = clock[staying] + waits <= length
            report("motions", motions - int(going.sum()), motions)
            kicks = generator(seed, 13, int(random.integers(1 << 62)))
            staying, waits = staying[going], waits[going]
            if not len(staying):
                break
            clock[staying] += waits
            state[staying] = _flown(found, state[staying], waits)
            out, lost = _strike(found, attractor, state, deviation, kicks, staying)
            left[staying[out]] = clock[staying[out]]
            unknown[staying[lost]] = True
            staying = staying[~out]
    return _dataset(result, attractor, once, left, unknown, length, rate, deviation)


def _require(found: Slice, attractor: int) -> None:
    if found.machine is None or found.names != ("x0", "v0"):
        raise SeparatrixError(
            "survival: needs a map over x0 and v0 whose further initial conditions the library can label",
            USAGE,
        )
    if attractor not in found.entries:
        raise SeparatrixError(
            f"survival: found attractor {attractor}, allowed {', '.join(map(str, found.entries))}", USAGE
        )
    case = found.machine.case
    from separatrix.library import effects

    acting = {one.name: one.acts for one in effects().values()}
    if any(acting.get(name) == "sensor" for name in case.resolved.get("effect", {})):
        raise SeparatrixError("survival: found an effect of the sensor, allowed a case without one", USAGE)
    if found.machine.section(attractor) is None:
        raise SeparatrixError("survival: needs a motion with a known period", USAGE)


def _period(found: Slice) -> float:
    return 2 * np.pi / found.machine.case.model.drive_frequency(found.machine.values)


def _on_motion(found: Slice, own: int, count: int, random: np.random.Generator) -> np.ndarray:
    """States x, v, crank angle of the motion at random instants."""
    points = found.machine.section(own, 0.0) * found.scale
    angles = random.uniform(0, 2 * np.pi, count)
    chosen = points[random.integers(0, len(points), count)]
    starts = np.column_stack([chosen, np.zeros(count)])
    return _flown(found, starts, angles / (2 * np.pi) * _period(found))


def _flown(found: Slice, states: np.ndarray, waits: np.ndarray) -> np.ndarray:
    """States after each has moved without impulses for its time."""
    machine = found.machine
    paths = list(machine.values)
    parts = machine.case.model.segments(
        paths, np.array([machine.values[path] for path in paths]), states, np.arange(len(states) + 1), waits,
        derivatives=False,
    )  # fmt: skip
    angle = np.mod(states[:, 2] + 2 * np.pi * waits / _period(found), 2 * np.pi)
    return np.column_stack([parts.x, parts.v, angle])


def _strike(
    found: Slice,
    own: int,
    states: np.ndarray,
    deviation: float,
    random: np.random.Generator,
    staying: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Change the velocities of `states` in place; whether each is out of the basin, and not known."""
    staying = np.arange(len(states)) if staying is None else staying
    states[staying, 1] += deviation * random.standard_normal(len(states))[staying]
    labels = found.machine.labels_of(states[staying])
    return labels != own, labels == NOT_KNOWN


def _dataset(
    result: xr.Dataset, attractor: int, once: np.ndarray, left: np.ndarray, unknown: np.ndarray,
    horizon: float, rate: float, deviation: float,
) -> xr.Dataset:  # fmt: skip
    times = np.linspace(0, horizon, _TIMES + 1)
    count = len(left)
    alive = np.array([np.sum(left > time) for time in times])
    ends = np.array([share_interval(int(one), count) for one in alive])
    p, (low, high) = float(np.mean(once)), share_interval(int(once.sum()), count)
    law = {"law": p, "law_lower": high, "law_upper": low}
    data = {"survival": alive / count, "survival_lower": ends[:, 0], "survival_upper": ends[:, 1]}
    data |= {name: np.exp(-rate * value * times) for name, value in law.items()}
    attributes = {"units": "1", "long_name": "share of the motions that have not left"}
    return xr.Dataset(
        {name: ("time", values, attributes) for name, values in data.items()},
        {"time": ("time", times, {"units": "s", "long_name": "time"})},
        {
            "kind": "survival", "title": str(result.attrs.get("title", "")), "attractor": attractor,
            "rate": rate, "deviation": deviation, "motions": count, "p": p, "p_lower": low, "p_upper": high,
            "not_known": int(unknown.sum()), "source": f"Separatrix {__version__}",
            "resolved_case": str(result.attrs.get("resolved_case", "")),
        },
    )  # fmt: skip
