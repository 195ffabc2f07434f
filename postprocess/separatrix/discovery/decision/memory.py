# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction with memory in force records: how much of the force each law leaves, in training and held out.

The laws are compared with the machine of the case, and with any force of speed, direction and position. Their
parameters are fitted to the training records alone. This names no effect of the catalogue: it reports what a
law of memory would close, and which laws cannot be distinguished.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from separatrix.discovery.fitting.forces import dry_friction, force_needed
from separatrix.discovery.fitting.memory_laws import dahl, dead_band, lugre, slip
from separatrix.discovery.measured.driven import Driven
from separatrix.discovery.policy import FIT, SEARCH

_MASS, _DAMPING = "body.mass", "friction.damping"
_FRICTION = (_DAMPING, "friction.kinetic_coefficient", "effect.coulomb.force", "effect.viscous.damping")


@dataclass
class _Run:
    """A record: motion, what the base machine leaves [N], its weights, columns of its free parameters."""

    motion: Driven
    pieces: list[tuple[int, int]]
    left: np.ndarray
    force: np.ndarray
    sigma: np.ndarray
    columns: np.ndarray
    bounds: np.ndarray

    @property
    def moves(self) -> np.ndarray:
        """Samples that are compared."""
        return self.motion.moves

    @property
    def beside(self) -> np.ndarray:
        """Columns that every law has beside it: of the machine, dry and viscous friction, an offset."""
        return np.column_stack([self.columns, np.ones(self.left.size)])


@dataclass
class Law:
    """A law as fitted: residuals of each record in both uses, and its parameters."""

    name: str
    parameters: list[dict]
    chi2: float
    left: dict[str, list[np.ndarray]]


def memory_of(findings) -> dict | None:
    """What laws of memory close in force records, as an entry of the verdict.

    None for other records, and where nothing is missing or an effect is named.
    """
    base, decision = findings.base, findings.decision
    predicted = decision.predicted
    if decision.accepted or decision.outcome == "none" or findings.context.options.compare != "force":
        return None
    if "effect.dahl.stiffness" in base.problem.model.parameters:
        return None
    if any(getattr(one, "driven", None) is None for one in base.problem.prepared):
        return None
    runs = {"training": _runs(base.problem, base.fit.values)}
    if predicted is not None:
        runs["held_out"] = _runs(predicted.problem, predicted.fit.values)
    if not all(run.moves.any() for group in runs.values() for run in group):
        return None
    laws = [_base(runs), _without(runs), *_with_memory(runs)]
    return _reported(runs, laws)


def _runs(problem, values: np.ndarray) -> list[_Run]:
    found = []
    for number, prepared in enumerate(problem.prepared):
        motion, record = prepared.driven, prepared.record

        def needed(chosen: np.ndarray, number=number, motion=motion, record=record) -> np.ndarray:
            machine = problem.machine_values(number, chosen)
            return force_needed(problem.model, machine, motion, record.force, record.pieces)

        force, machine = needed(values), problem.machine_values(number, values)
        columns, bounds = [np.sign(motion.v), motion.v], []
        # friction may vanish, not drive
        bounds += [(-dry_friction(problem.model, machine), np.inf), (-machine.get(_DAMPING, 0.0), np.inf)]
        for j, one in enumerate(problem.free):
            if one.path == _MASS:
                columns.append(motion.a)
                bounds.append(
                    tuple(float(one.numbers(end)[_MASS]) - machine[_MASS] for end in (one.lower, one.upper))
                )
            elif one.path in problem.model.parameters and one.path not in _FRICTION:
                step = (
                    FIT.force_step
                    * one.size
                    * (1 if values[j] + FIT.force_step * one.size <= one.upper else -1)
                )
                columns.append((needed(values + step * (np.arange(values.size) == j)) - force) / step)
                # a positive number is fitted by its logarithm, and the force is linear in the number
                bounds.append(
                    (-1.0, np.inf) if one.positive else (one.lower - values[j], one.upper - values[j])
                )
        found.append(
            _Run(
                motion, record.pieces, record.force - force, record.force,
                prepared.deviation(slice(None)) * np.ones(force.size),
                np.array(columns).reshape(len(columns), -1).T, np.array(bounds).reshape(-1, 2),
            )
        )  # fmt: skip
    return found


def _base(runs: dict) -> Law:
    return Law("base", [], np.inf, {use: [run.left for run in group] for use, group in runs.items()})


def _without(runs: dict) -> Law:
    """Any function of speed with direction, one of position, and friction linear in position."""
    motions = [run.motion for run in runs["training"]]
    fast = max(np.max(np.abs(one.v)) for one in motions)
    x = np.concatenate([one.x for one in motions])
    count = SEARCH.memory_knots
    knots = np.linspace(x.min(), x.max(), count), fast * np.linspace(0, 1, count) ** 2

    def columns(run: _Run) -> np.ndarray:
        v, at = run.motion.v, run.motion.x
        speed = _hats(np.abs(v), knots[1])
        parts = [
            speed * (v > 0)[:, None],
            speed * (v < 0)[:, None],
            _hats(at, knots[0]),
            (at * np.sign(v))[:, None],
        ]
        return np.column_stack([run.columns, *parts])

    return _fit("without memory", runs, columns, 0)[0]


def _hats(at: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Piecewise linear functions, one for each knot, constant beyond the last."""
    return np.column_stack([np.interp(at, knots, one) for one in np.eye(knots.size)])


def _with_memory(runs: dict) -> list[Law]:
    """The best of each law."""
    range_of_motion = max(np.ptp(run.motion.x) for run in runs["training"])
    lengths = range_of_motion * np.geomspace(2e-3, 1.0, 28)
    fast = np.sqrt(np.mean(np.concatenate([run.motion.v for run in runs["training"]]) ** 2))
    found = [_of_one_length("dahl", runs, lengths, dahl, {})]
    found.append(_slips(runs, lengths[::2]))
    for name, law, choices in (
        ("dead_band", dead_band, [{"share": one} for one in (0.2, 0.35, 0.5, 0.65, 0.8)]),
        ("lugre", lugre, [{"excess": r, "speed": one * fast} for r in (0.25, 0.75) for one in (0.1, 0.4)]),
    ):
        tried = [_of_one_length(name, runs, lengths, law, choice) for choice in choices]
        found.append(min(tried, key=lambda one: one.chi2))
    return found


def _of_one_length(name: str, runs: dict, lengths: np.ndarray, law, chosen: dict) -> Law:
    """A law of one length, which is sought on a grid and then on a finer one about the best."""
    for _ in range(2):
        table = {
            id(run): law(run.motion, run.pieces, lengths, *chosen.values())
            for group in runs.values()
            for run in group
        }
        tried = [
            _fit(
                name,
                runs,
                lambda run, k=k, table=table: np.column_stack([run.beside, table[id(run)][:, k]]),
                1,
            )
            for k in range(lengths.size)
        ]
        best = min(range(lengths.size), key=lambda k: tried[k][0].chi2)
        fitted, size, length = tried[best][0], tried[best][1][-1], float(lengths[best])
        ratio = lengths[1] / lengths[0]
        lengths = length * np.geomspace(1 / ratio, ratio, 9)
    units = {"share": "1", "excess": "1", "speed": "m/s"}
    fitted.parameters = [_parameter("force", size, "N"), _parameter("length", length, "m")] + [
        _parameter(key, value, units[key]) for key, value in chosen.items()
    ]
    return fitted


def _slips(runs: dict, lengths: np.ndarray) -> Law:
    """Springs that slip, in parallel."""
    fitted, sizes = _fit(
        "maxwell_slip", runs,
        lambda run: np.column_stack([run.beside, slip(run.motion, run.pieces, lengths)]),
        lengths.size,
    )  # fmt: skip
    sizes = sizes[-lengths.size :]
    kept = np.flatnonzero(sizes > 0.01 * max(sizes.sum(), 1e-300))
    fitted.parameters = [
        one
        for n, k in enumerate(kept, start=1)
        for one in (_parameter(f"force {n}", sizes[k], "N"), _parameter(f"length {n}", lengths[k], "m"))
    ]
    return fitted


def _parameter(name: str, value: float, unit: str) -> dict:
    return {"name": name, "value": float(value), "unit": unit}


def _fit(name: str, runs: dict, columns, positive: int) -> tuple[Law, np.ndarray]:
    """Least squares on training records; the last `positive` columns are not negative, nor is damping."""
    training = runs["training"]
    tables = [columns(run) for run in training]
    rows = [np.column_stack([a, run.left])[run.moves] / run.sigma[run.moves, None]
            for a, run in zip(tables, training, strict=True)]  # fmt: skip
    upper = np.linalg.qr(np.concatenate(rows), mode="r")
    matrix, right = upper[:, :-1], upper[:, -1]
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    count = scale.size
    low, high = np.full(count, -np.inf), np.full(count, np.inf)
    bounds = training[0].bounds
    low[: len(bounds)], high[: len(bounds)] = bounds.T
    if positive:
        low[count - positive :] = 0.0
    whole = np.vstack([matrix / scale, SEARCH.memory_ridge * np.linalg.norm(right) * np.eye(count)])
    found = lsq_linear(
        whole, np.append(right, np.zeros(count)),
        (np.minimum(low * scale, -1e-12), np.maximum(high * scale, 1e-12)),
        method="bvls",
    ).x / scale  # fmt: skip
    chi2 = float(np.sum((matrix @ found - right) ** 2))
    left = {use: [run.left - columns(run) @ found for run in group] for use, group in runs.items()}
    return Law(name, [], chi2, left), found


def _blocks(runs: list[_Run], left: list[np.ndarray]) -> np.ndarray:
    """chi^2 of each stroke: what a law leaves is correlated within one."""
    found = []
    for run, rest in zip(runs, left, strict=True):
        squares = np.where(run.moves, rest / run.sigma, 0.0) ** 2
        found += [squares[a:b].sum() for piece in run.pieces for a, b, *_ in run.motion.strokes(*piece)]
    return np.array(found)


def _size(runs: list[_Run], left: list[np.ndarray]) -> dict:
    """What a law leaves: in N, as a share of the scatter of the force, chi^2 of a sample."""
    rest = np.concatenate([one[run.moves] for run, one in zip(runs, left, strict=True)])
    force = np.concatenate([run.force[run.moves] for run in runs])
    newtons = float(np.sqrt(np.mean(rest**2)))
    return {
        "left": newtons,
        "share": newtons / max(float(np.std(force)), 1e-300),
        "chi2": float(_blocks(runs, left).sum() / rest.size),
    }


def _closed(after: dict, before: dict) -> float:
    """Share of a gap that is closed; negative where it has grown."""
    return 1 - max(after["chi2"] - 1, 0.0) / max(before["chi2"] - 1, 1e-300)


def _beats(runs: list[_Run], one: list[np.ndarray], other: list[np.ndarray]) -> bool:
    """Whether a law leaves less than another by more than chance, stroke by stroke."""
    more = _blocks(runs, other) - _blocks(runs, one)
    more = more[more != 0]
    error = np.std(more, ddof=1) * np.sqrt(more.size) if more.size > 1 else np.inf
    return bool(more.sum() > SEARCH.memory_odds * error)


def _reported(runs: dict, laws: list[Law]) -> dict:
    """The laws with what they leave, and those that close most of the gap."""
    sizes = {law.name: {use: _size(runs[use], law.left[use]) for use in runs} for law in laws}
    base, without, *memories = laws
    use = "held_out" if "held_out" in runs else "training"
    best = min(memories, key=lambda one: sizes[one.name][use]["chi2"])

    def closes(law: Law, before: Law) -> bool:
        return all(
            _closed(sizes[law.name][one], sizes[before.name][one]) >= SEARCH.memory_closed for one in runs
        ) and _beats(runs[use], law.left[use], before.left[use])

    gap = all(one["chi2"] > SEARCH.memory_gap for one in sizes["base"].values())
    names = []
    if gap and closes(best, base) and closes(best, without):
        names = [best.name]
        for law in memories:
            near = sizes[law.name][use]["left"] < SEARCH.memory_alike * sizes[best.name][use]["left"]
            # what leaves only noise is as good as the best
            noise = all(one["chi2"] < SEARCH.memory_gap for one in sizes[law.name].values())
            if law is not best and (near or noise or not _beats(runs[use], best.left[use], law.left[use])):
                names.append(law.name)
    listed = [
        {"name": law.name, "parameters": law.parameters, **sizes[law.name]}
        | {"closed": {one: _closed(sizes[law.name][one], sizes["base"][one]) for one in runs}}
        for law in laws
    ]
    return {"laws": listed, "names": names, "text": _text(names, sizes, "held_out" in runs)}


def _text(names: list[str], sizes: dict, held_out: bool) -> str:
    """In words what remains, and which laws cannot be distinguished."""
    if not names:
        return "no law of friction with memory closes most of the gap beyond what forces without memory do"
    uses = {"training": "in training"} | ({"held_out": "held out"} if held_out else {})
    left = " and ".join(
        f"{100 * sizes[names[0]][use]['share']:.3g} % of the force ({sizes[names[0]][use]['left']:.3g} N; "
        f"the machine of the case {100 * sizes['base'][use]['share']:.3g} %) {where}"
        for use, where in uses.items()
    )
    laws = " or ".join(one.replace("_", " ") for one in names)
    doubt = "; which of these is not known from these records" if len(names) > 1 else ""
    return f"friction with memory closes most of the gap: {laws} leaves {left}{doubt}"
