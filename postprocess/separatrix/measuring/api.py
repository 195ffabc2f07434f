# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`measures` of a map and `tipping` between two maps."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.errors import USAGE, SeparatrixError
from separatrix.measuring import boundaries, integrity, phases
from separatrix.measuring.maps import Slice, indices_of, slice_of
from separatrix.measuring.report import Measure, Measures
from separatrix.measuring.sampling import share_interval
from separatrix.measuring.tipping import Tipping, tipping_matrix
from separatrix.open import open_result, table
from separatrix.progress import Progress, Report
from separatrix.variables import is_start

__all__ = ["EACH", "NAMES", "USUAL", "WHOLE", "measures", "tipping"]

#: Measures of one basin.
EACH: dict[str, Callable[[Slice, int], Measure | list[Measure]]] = {
    "global_integrity": integrity.global_integrity,
    "local_integrity": integrity.local_integrity,
    "integrity_factor": integrity.integrity_factor,
    "basin_stability": integrity.basin_stability,
    "convergence_time": integrity.convergence_time,
    "local_integrity_over_phases": phases.local_integrity_over_phases,
    "critical_impulse": phases.critical_impulse,
    "safe_basin": phases.safe_basin,
}
#: Measures of a map as a whole.
WHOLE: dict[str, Callable[[Slice], Measure | list[Measure]]] = {
    "basin_entropy": boundaries.basin_entropy,
    "uncertainty_exponent": boundaries.uncertainty_exponent,
    "wada_merging": boundaries.wada_merging,
    "wada_grid": boundaries.wada_grid,
}
NAMES = (*EACH, *WHOLE)
_OVER_PHASES = ("local_integrity_over_phases", "critical_impulse", "safe_basin")
USUAL = tuple(name for name in NAMES if name not in (*_OVER_PHASES, "uncertainty_exponent"))
#: Crank angles where none are asked for.
PHASES = 32


def measures(
    result: xr.Dataset | str | Path,
    names: Sequence[str] | str | None = None,
    *,
    attractors: Sequence[int] | int | None = None,
    slice: Mapping[str, float] | None = None,
    frequency: float | None = None,
    deviation: Mapping[str, float] | None = None,
    starts: int = 20000,
    phases: int | None = None,
    seed: int = 1,
    threads: int | None = None,
    new_starts: bool = True,
    progress: bool | Report | None = None,
) -> Measures:
    """Return measures of the basins of a map, each with its definition, an interval, and what limits it.

    Parameters
    ----------
    result
        The result of `basin`, or its file.
    names
        Which, by name; "all"; None: those that take seconds. `separatrix.measuring.api.NAMES` has all.
    attractors
        Numbers of the attractors whose basins are measured; None: all.
    slice
        Values of the parameters of the map, by name; the nearest of the map.
    frequency
        Velocities are divided by it [rad/s] to be compared with positions; None: the natural frequency of the
        machine, without one that of its drive.
    deviation
        Basin stability for a normal density about the motion: standard deviations of `x0` and `v0` [m, m/s].
    starts
        New starts of each share.
    phases
        Crank angles, evenly over a turn, of the measures over phases; where it is given they are among the
        usual ones. 32 if not given.
    seed
        Of all that is drawn. Results depend on it, and not on `threads`.
    threads
        Threads of this process; None: one for each core.
    new_starts
        False: everything is read from the map; what needs new starts is not known.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> found = sx.measures(result, "integrity_factor", attractors=1)
    >>> found["integrity_factor"].unit
    'm'
    """
    chosen = _chosen(names, phases)
    if phases is not None and phases < 2:
        raise SeparatrixError(f"phases: found {phases}, allowed 2 or more", USAGE)
    if starts < 100:
        raise SeparatrixError(f"starts: found {starts}, allowed 100 or more", USAGE)
    result = open_result(result) if isinstance(result, str | Path) else result
    if not isinstance(result, xr.Dataset):
        raise SeparatrixError(
            f"measures: found {type(result).__name__}, allowed the result of basin, or its file", USAGE
        )
    if result.separatrix.kind == "basin" and "sample" in result.get("attractor", xr.DataArray()).dims:
        if "basin_stability" not in chosen and names is not None:
            raise SeparatrixError(
                f"measures: found {', '.join(chosen)}, allowed of starts drawn at random is basin_stability",
                USAGE,
            )
        return _of_sample(result, slice, attractors)
    found = slice_of(result, slice, frequency, threads, new_starts)
    found.seed, found.starts, found.phases = seed, starts, phases or PHASES
    owns = _owns(found, attractors)
    work = [(name, own) for name in chosen if name in EACH for own in owns]
    work += [(name, None) for name in chosen if name in WHOLE]
    answers: list[Measure] = []
    with Progress(progress) as report:
        for number, (name, own) in enumerate(work):
            answers += _one(found, name, own, deviation)
            report("measures", number + 1, len(work))
    about = dict(found.about)
    about["new starts"] = found.machine.counted if found.machine else 0
    about["seed"] = seed
    return Measures(answers, about)


def _one(found: Slice, name: str, own: int | None, deviation: Mapping[str, float] | None) -> list[Measure]:
    if own is None:
        answer = WHOLE[name](found)
    elif name == "basin_stability" and deviation:
        if set(deviation) != set(found.names):
            raise SeparatrixError(
                f"deviation: found {', '.join(deviation)}, allowed {' and '.join(found.names)}", USAGE
            )
        if not all(value > 0 for value in deviation.values()):
            raise SeparatrixError("deviation: allowed > 0", USAGE)
        answer = integrity.basin_stability(found, own, np.array([deviation[key] for key in found.names]))
    else:
        answer = EACH[name](found, own)
    return answer if isinstance(answer, list) else [answer]


def _chosen(names: Sequence[str] | str | None, phases: int | None) -> tuple[str, ...]:
    if names is None:
        return USUAL if phases is None else (*USUAL, *_OVER_PHASES)
    given = [names] if isinstance(names, str) else list(names)
    if "all" in given:
        return NAMES
    for name in given:
        if name not in NAMES:
            raise SeparatrixError(f"measures: found '{name}', allowed all, {', '.join(NAMES)}", USAGE)
    return tuple(given)


def _owns(found: Slice, wanted: Sequence[int] | int | None) -> list[int]:
    # an attractor whose basin lies between the points of the map has one nevertheless
    present = sorted({int(label) for label in np.unique(found.grid) if label > 0} | set(found.entries))
    if wanted is None:
        return present
    given = [wanted] if isinstance(wanted, int) else list(wanted)
    for one in given:
        if one not in present:
            raise SeparatrixError(
                f"attractors: found {one}, allowed "
                f"{', '.join(map(str, present)) or 'none: the map has none'}",
                USAGE,
            )
    return given


def _of_sample(
    result: xr.Dataset, chosen: Mapping[str, float] | None, wanted: Sequence[int] | int | None
) -> Measures:
    """Of starts drawn at random: the shares, which are basin stability under the density of the case."""
    indices = indices_of(result, dict(chosen or {})) if chosen else {}
    asked = None if wanted is None else {wanted} if isinstance(wanted, int) else set(wanted)
    catalogue = table(result, "catalogue")
    definition = (
        "basin stability: the probability that a start drawn from the density of the case ends in the basin"
    )
    dims = [str(name) for name in result["attractor"].dims if not is_start(str(name))]
    shape = [result.sizes[name] for name in dims]
    found = []
    count = result.sizes["sample"]
    for row in range(catalogue.sizes.get("entry", 0)):
        hits = int(catalogue["count"].values[row])
        at = np.unravel_index(int(catalogue["slice"].values[row]), shape) if shape else ()
        number = int(catalogue["attractor"].values[row])
        at = dict(zip(dims, map(int, at), strict=True))
        if any(at.get(name, i) != i for name, i in indices.items()) or (asked and number not in asked):
            continue
        where = {name: float(result[name].values[i]) for name, i in at.items()}
        found.append(
            Measure(
                "basin_stability",
                definition,
                "1",
                number,
                hits / count,
                *share_interval(hits, count),
                "95 %, Clopper and Pearson",
                {"density": "that of [[sample]]", "starts": count, **where},
            )
        )
    return Measures(found, {"map": str(result.attrs.get("title", "")), "starts": count})


def tipping(before: xr.Dataset | str | Path, after: xr.Dataset | str | Path) -> Tipping:
    """Return which share of each basin of one map lies in each basin of another of the same starts.

    The machine has changed between the two at once (a jump of a parameter); numbers are those of either map's
    own catalogue.

    Examples
    --------
    >>> case = sx.load("examples/basin_coulomb.toml")
    >>> before = sx.basin(case, x0=20, v0=20)
    >>> after = sx.basin(case.with_({"drive.ratio": 1.21}), x0=20, v0=20)
    >>> sx.tipping(before, after).shares.shape
    (2, 3)
    """
    one, other = (open_result(item) if isinstance(item, str | Path) else item for item in (before, after))
    for result in (one, other):
        if result.separatrix.kind != "basin" or "attractor" not in result:
            raise SeparatrixError(
                "tipping: found no map of attractors, allowed are two results of basin", USAGE
            )
    dims = one["attractor"].dims
    same = dims == other["attractor"].dims and all(
        one.sizes[name] == other.sizes[name] and np.array_equal(one[name].values, other[name].values)
        for name in dims
    )
    if not same:
        raise SeparatrixError("tipping: the two maps have not the same starts", USAGE)
    return tipping_matrix(one["attractor"].values, other["attractor"].values)
