# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions under random forces, impulses and restitution; survival and first passage over starts.

Between kicks the machine moves as in the case, flown by the library. Random numbers belong to the seed, the
motion, and what they are for: they do not depend on how many motions there are, nor on threads.
"""

import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from scipy import stats

from separatrix.cases import Case, as_case
from separatrix.checks import count, number, numbers
from separatrix.cores import cores
from separatrix.errors import CANNOT_CREATE, USAGE, SeparatrixError
from separatrix.kept_rows import KeptRows, write_dataset
from separatrix.kicked import PIECE, Machine, Noise, fly
from separatrix.measuring.sampling import CONFIDENCE
from separatrix.variables import FORMAT_VERSION
from separatrix.version import __version__

__all__ = ["first_passage", "noisy"]

# Kicks of a random force in a drive period, or in the shortest of the springs.
_KICKS = 64
# Friction whose force depends on more than the state of a segment.
_MEMORY = ("elastic_coulomb", "maxwell_slip", "dahl", "bouc_wen", "lugre")


def noisy(
    case: Case | str | Path,
    x0: float | str | None = None,
    v0: float | str | None = None,
    crank_angle: float | str | None = None,
    *,
    duration: float | None = None,
    motions: int = 100,
    intensity: float = 0.0,
    impulses: tuple[float, float] | None = None,
    restitution: float = 0.0,
    body: str | None = None,
    leaves: Sequence[float] | str | None = None,
    step: float | None = None,
    samples: int = 200,
    seed: int = 1,
    threads: int | None = None,
    output: str | Path | None = None,
    overwrite: bool = False,
) -> xr.Dataset:
    """Return motions from one start under noise, and the share that has not left yet.

    Parameters
    ----------
    case, x0, v0, crank_angle, duration
        As for `sx.trajectory`; `duration` in s.
    motions
        How many, each with random numbers of its own.
    intensity
        I [N^2 s] of a white random force F: <F(t) F(t')> = I delta(t - t'). It acts as a kick at
        the end of each `step`, normally distributed with the variance I step / m^2.
    impulses
        (rate [1/s], deviation [m/s]): changes of velocity at the instants of a Poisson process, normally
        distributed.
    restitution
        Standard deviation of the coefficient of each impact around that of the case, cut off at 0 and 1; of
        one body without a motor.
    body
        Of several bodies the one that the force and `impulses` act on; the watched one if not given.
    leaves
        (lower, upper) positions [m] of the watched body between which a motion stays, looked at after each
        step and impulse; or "impact": it has left at its first impact. Motions that have left go on.
    step
        [s]; a 64th of the drive period, or of a period below those of the springs, if that is shorter.
    samples
        Times, equally spaced over the duration, with the first and the last.
    seed
        Results are the same bits for the same seed; motion k is the same for any number of motions.
    threads
        They do not change the results; the cores if not given.
    output, overwrite
        A file that `open_result` and `separatrix-figures` read; whether one that exists is replaced.

    Returns
    -------
    xarray.Dataset
        `x` [m] and `v` [m/s] (motion, time), of several bodies `NAME_x` and `NAME_v` too, with a motor
        `crank_angle` and `crank_speed`; `first_passage` [s] (motion), NaN of one that has not left; and
        `survival`, `survival_lower`, `survival_upper` (time) with the 95 % interval of Wilson.

    Raises
    ------
    SeparatrixError
        For what has a state beside positions, velocities and crank ([structure], [state], [effect], friction
        with memory, controllers that integrate), two bodies of a pair, and values that are not allowed.
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
    machine = _machine(case, body, x0, v0, crank_angle)
    noise = _noise(machine, intensity, impulses, restitution, leaves, step, count("seed", seed, 0))
    length = _duration(case, duration)
    motions, samples = count("motions", motions), count("samples", samples, 2)
    target = _target(output, overwrite)
    times = np.linspace(0.0, length, samples)
    starts = np.tile(machine.start, (motions, 1))
    parts = _pieces(motions, threads, lambda one: fly(machine, noise, starts[one.rows], times, one.piece))
    states = np.concatenate([part[0] for part in parts])
    left = np.concatenate([part[1] for part in parts])
    share = wilson((left[:, None] > times).sum(axis=0), motions)
    data = xr.Dataset(
        {
            **_motions(machine, states),
            "first_passage": ("motion", np.where(np.isfinite(left), left, np.nan), _PASSAGE),
            **{name: ("time", values, _SURVIVAL) for name, values in zip(_SHARES, share, strict=True)},
        },
        {"time": ("time", times, {"units": "s", "long_name": "time since the start"})},
        _attributes(case, "noise", motions, seed),
    )
    if target:
        write_dataset(data, target)
    return data


def first_passage(
    case: Case | str | Path,
    x0: Sequence[float],
    v0: Sequence[float],
    *,
    leaves: Sequence[float] | str,
    duration: float | None = None,
    motions: int = 100,
    intensity: float = 0.0,
    impulses: tuple[float, float] | None = None,
    restitution: float = 0.0,
    body: str | None = None,
    step: float | None = None,
    seed: int = 1,
    threads: int | None = None,
    output: str | Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
) -> xr.Dataset:
    """Return over a grid of starts the share of noisy motions that have not left, and when they leave.

    Parameters
    ----------
    x0, v0
        Positions [m] and velocities [m/s] of the starts, or (first, last, count) of each.
    leaves, duration, motions, intensity, impulses, restitution, body, step, seed, threads, output, overwrite
        As for `sx.noisy`; `motions` from each start.
    resume
        Go on with a run into `output` that was stopped: what is done is kept in OUTPUT.part.

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
    machine = _machine(case, body)
    noise = _noise(machine, intensity, impulses, restitution, leaves, step, count("seed", seed, 0))
    length, motions = _duration(case, duration), count("motions", motions)
    target = _target(output, overwrite)
    axes = [_axis(name, values) for name, values in (("x0", x0), ("v0", v0))]
    shape = (axes[0].size, axes[1].size)
    starts = np.tile(machine.start, (shape[0] * shape[1], 1))
    starts[:, machine.watched] = [[x, v] for x in axes[0] for v in axes[1]]
    starts = starts.repeat(motions, axis=0)
    times = np.array([0.0, length])
    content = [
        __version__,
        case.to_toml(),
        noise,
        machine.kicked,
        *(a.tolist() for a in axes),
        length,
        motions,
    ]
    identity = f"{zlib.crc32(repr(content).encode()):08x}"
    kept = KeptRows(target, identity, resume, "is of another case, other starts or other noise")

    def one_piece(one: _Piece) -> list[float]:
        row = kept.row(one.piece)
        if row is None:
            row = kept.keep(one.piece, fly(machine, noise, starts[one.rows], times, one.piece)[1].tolist())
        return row

    left = np.concatenate(_pieces(len(starts), threads, one_piece)).reshape(*shape, motions)
    share = wilson((left > length).sum(axis=-1), motions)
    mean = np.minimum(left, length).mean(axis=-1)
    passage = {"units": "s", "long_name": "mean time of first passage, at most the duration"}
    data = xr.Dataset(
        {name: (("x0", "v0"), values, _SURVIVAL) for name, values in zip(_SHARES, share, strict=True)}
        | {"passage_time": (("x0", "v0"), mean, passage)},
        {
            "x0": ("x0", axes[0], {"units": "m", "long_name": "initial position"}),
            "v0": ("v0", axes[1], {"units": "m/s", "long_name": "initial velocity"}),
        },
        {**_attributes(case, "first_passage", motions, seed), "duration": length},
    )
    if target:
        write_dataset(data, target)
        kept.remove()
    return data


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


@dataclass(frozen=True)
class _Piece:
    """Motions that share their random numbers."""

    piece: int
    rows: slice


def _pieces(motions: int, threads: int | None, run: Callable) -> list:
    """Return what `run` gives for the pieces of so many motions, in order."""
    pieces = [
        _Piece(number, slice(first, first + PIECE)) for number, first in enumerate(range(0, motions, PIECE))
    ]
    threads = min(cores() if threads is None else count("threads", threads), len(pieces))
    if threads == 1:
        return [run(one) for one in pieces]
    with ThreadPoolExecutor(threads) as pool:
        waiting = [pool.submit(run, one) for one in pieces]
        try:
            return [one.result() for one in waiting]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _motions(machine: Machine, states: np.ndarray) -> dict[str, tuple]:
    """Return positions and velocities as variables (motion, time)."""
    x, v = machine.watched
    found = {"x": (x, "m", "position"), "v": (v, "m/s", "velocity")}
    for i, name in enumerate(machine.case.model.coordinates):
        bodies = len(machine.case.model.coordinates)
        found[f"{name}_x"] = (i, "m", f"position of {name}")
        found[f"{name}_v"] = (bodies + i, "m/s", f"velocity of {name}")
    if not machine.turns:
        found["crank_angle"] = (1, "rad", "crank angle")
        found["crank_speed"] = (3, "rad/s", "speed of the crank")
    return {
        name: (("motion", "time"), states[..., at], {"units": unit, "long_name": meaning})
        for name, (at, unit, meaning) in found.items()
    }


def _attributes(case: Case, kind: str, motions: int, seed: int) -> dict[str, object]:
    return {
        "Conventions": "CF-1.10", "format": "separatrix", "format_version": FORMAT_VERSION, "kind": kind,
        "complete": 1, "title": case.title, "motions": motions, "seed": seed,
        "source": f"Separatrix {__version__}", "resolved_case": case.to_toml(),
    }  # fmt: skip


def _duration(case: Case, duration: float | None) -> float:
    return number(
        "duration", case.resolved["run"]["duration"] if duration is None else duration, 0, above=True
    )


def _target(output: str | Path | None, overwrite: bool) -> Path | None:
    target = None if output is None else Path(output).expanduser()
    if target is not None and target.exists() and not overwrite:
        raise SeparatrixError(f"{target}: exists; overwrite=True replaces it", CANNOT_CREATE)
    return target


def _axis(name: str, values: Sequence[float]) -> np.ndarray:
    try:
        found = (
            np.linspace(float(values[0]), float(values[1]), count(name, values[2]))
            if isinstance(values, tuple) and len(values) == 3
            else np.array(values, float)
        )
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.ndim != 1 or not found.size or not np.isfinite(found).all():
        raise SeparatrixError(f"{name}: found {values!r}, allowed numbers, or (first, last, count)", USAGE)
    return found


def _machine(case: Case, body: str | None, *start: float | str | None) -> Machine:
    """Return where numbers are in the state of a machine; refuse one with a further state."""
    resolved = case.resolved
    other = [name for name in ("effect", "state", "structure") if name in resolved]
    if not isinstance(resolved["body"].get("driven_mass", {}), dict):
        other.append("two bodies of a pair")
    friction = resolved.get("friction", {})
    other += [
        one["law"]
        for one in (friction, *friction.values())
        if isinstance(one, dict) and one.get("law") in _MEMORY
    ]
    if other:
        raise SeparatrixError(
            f"noise: found {', '.join(other)}, allowed machines without a further state", USAGE
        )
    names = ("x0", "v0", "crank_angle")
    at = case.start(**dict(zip(names, start or (None,) * 3, strict=True)))
    x, v, angle = (at[name] for name in names)
    period = 2 * np.pi / float(case.model.drive_frequency({}))
    if case.model.coordinates:
        return _of_bodies(case, body, (x, v, angle), period)
    if body is not None:
        raise SeparatrixError(f"body: found {body!r} of a machine of one body, allowed None", USAGE)
    mass = float(resolved["body"]["mass"])
    if "motor" not in resolved:
        return Machine(case, np.array([x, v, angle]), (0, 1), (0, 1), mass, period)
    motor = resolved["motor"]
    # a current without inductance follows the speed
    own = (
        np.nan
        if motor.get("inductance") == 0
        else motor.get("start_current", motor.get("start_integral", 0.0))
    )
    state = np.array([x, angle, v, motor["crank_speed"], own], float)
    return Machine(case, state, (0, 2), (0, 2), mass, np.inf)


def _of_bodies(case: Case, body: str | None, start: tuple[float, ...], period: float) -> Machine:
    bodies, names = case.resolved["body"], case.model.coordinates
    watched = case.resolved.get("watch", {}).get("body", names[0])
    body = watched if body is None else body
    if body not in names:
        raise SeparatrixError(f"body: found {body!r}, allowed {', '.join(names)}", USAGE)
    state = [float(bodies[name].get(key, 0.0)) for key in ("x0", "v0") for name in names]
    x, k = names.index(watched), names.index(body)
    state[x], state[len(names) + x] = start[:2]
    return Machine(
        case, np.array([*state, start[2]]), (x, len(names) + x), (k, len(names) + k),
        float(bodies[body]["mass"]), period,
    )  # fmt: skip


def _noise(
    machine: Machine, intensity: float, impulses: tuple[float, float] | None, restitution: float,
    leaves: Sequence[float] | str | None, step: float | None, seed: int,
) -> Noise:  # fmt: skip
    resolved = machine.case.resolved
    intensity, deviation = number("intensity", intensity, 0), number("restitution", restitution, 0)
    if impulses is not None:
        rate, size = numbers("impulses", impulses, "(rate [1/s], deviation [m/s])")
        impulses = (number("impulses: rate", rate, 0, above=True), number("impulses: deviation", size, 0))
    one_body = not machine.case.model.coordinates
    contact = resolved.get("contact", {"law": "none"}) if one_body else {}
    if deviation and not (one_body and machine.turns and contact["law"] == "newton"):
        what = (
            f'contact.law "{contact["law"]}"' if one_body and machine.turns else "several bodies or a motor"
        )
        raise SeparatrixError(f'restitution: found {what}, allowed one body with contact.law "newton"', USAGE)
    at_impact = isinstance(leaves, str)
    if at_impact and leaves != "impact":
        raise SeparatrixError(f'leaves: found "{leaves}", allowed "impact" or (lower, upper)', USAGE)
    if at_impact and not (contact["law"] != "none" if one_body else machine.case.model.contacts):
        raise SeparatrixError(
            'leaves: found "impact" of a body without a contact, allowed (lower, upper)', USAGE
        )
    lower, upper = -np.inf, np.inf
    if leaves is not None and not at_impact:
        lower, upper = numbers("leaves", leaves, '"impact" or (lower, upper)')
    if not lower < upper:
        raise SeparatrixError(f"leaves: found {lower} and {upper}, allowed lower < upper", USAGE)
    step = _step(machine) if step is None else number("step", step, 0, above=True)
    kick = float(np.sqrt(intensity * step)) / machine.mass
    # an expression where it is not drawn
    coefficient = float(contact["restitution"]) if deviation else 0.0
    return Noise(
        kick, impulses, coefficient, deviation, step,
        (float(contact.get("lower", -np.inf)), float(contact.get("upper", np.inf))), (lower, upper),
        at_impact, seed,
    )  # fmt: skip


def _step(machine: Machine) -> float:
    """Return a 64th of the drive period, or of a period that no spring between bodies is faster than."""
    case = machine.case
    fastest = float(case.model.drive_frequency({}))
    bodies = case.resolved["body"]
    # Gershgorin's bound on the squares of the natural frequencies
    for name in case.model.coordinates:
        springs = [
            one for one in case.resolved.get("spring", {}).values() if name in np.atleast_1d(one["between"])
        ]
        stiffness = sum(2 * abs(float(one.get("stiffness", 0.0))) for one in springs)
        fastest = max(fastest, float(np.sqrt(stiffness / bodies[name]["mass"])))
    return 2 * np.pi / fastest / _KICKS
