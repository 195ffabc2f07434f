# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of docs/validation.md: what the cases of examples/validation/ give."""

from collections.abc import Callable

import numpy as np
import separatrix as sx
from evidence_rows import Row
from scipy.optimize import brentq
from separatrix import open_result, table
from separatrix.library import Model
from stroboscopic import OFFSETS, WEIGHTS, Map, Orbit, doubling, fold, follow
from validation_program import CASES, Labels, Program, row

CYCLE, FAMILY_OF_CYCLES = 1, 5
NEWTON = (
    "`examples/validation/{}.toml`, Newton's method on the library's map (`scripts/evidence/stroboscopic.py`)"
)


def budd_dux(program: Program) -> list[Row]:
    """Unstable orbits, doubling, fold and saddle of the undamped impact oscillator."""
    model, how = program.models["budd_dux"], NEWTON.format("budd_dux")

    def at(sigma: float) -> Map:
        return Map(model, {"contact.upper": sigma})

    (loose,) = at(0.0).orbits((-3, 0), (-2, 2), 1)
    node, saddle = at(-0.4).orbits((-3, -0.4), (-2, 2), 1)
    path = follow(at, 0.0, -0.06, loose.point, 6)
    double, doubled = doubling(at, -0.06, -0.08, path[-1][1].point)
    path = follow(at, -0.4, -1.9, node.point)
    meeting, _ = fold(at, path[-1][0], path[-1][1].point, 1e-4)
    (slow,) = Map(model, {"contact.upper": 0.0, "drive.ratio": 2.0}).orbits((-20, 0), (-20, 20), 1)
    map_modulus = program.catalogue("budd_dux")["multiplier"].ravel()[0]
    numbers = {
        "dux.speed": loose.impact_speed[0],
        "dux.phase": loose.impact_phase[0],
        "dux.large": loose.multipliers[0].real,
        "dux.small": loose.multipliers[1].real,
        "dux.doubling": double,
        "dux.doubling_speed": doubled.impact_speed[0],
        "dux.fold": -meeting,
        "dux.node": node.impact_speed[0],
        "dux.node_modulus": abs(node.multipliers[0]),
        "dux.saddle": saddle.impact_speed[0],
        "dux.saddle_phase": saddle.impact_phase[0],
        "dux.saddle_large": saddle.multipliers[0].real,
        "dux.saddle_small": saddle.multipliers[1].real,
        "dux.resonant": slow.impact_speed[0],
        "dux.resonant_trace": np.trace(slow.matrix),
    }
    rows = [row(key, value, how) for key, value in numbers.items()]
    rows.append(
        row(
            "dux.node_catalogue",
            float(abs(map_modulus)),
            "`separatrix basin examples/validation/budd_dux.toml`",
        )
    )
    return rows


def chaos(program: Program) -> list[Row]:
    """The chaos of the undamped impact oscillator with the wall at its rest position."""
    exponent = largest_exponent(Map(program.models["budd_dux"], {"contact.upper": 0.0}))
    case = sx.load(CASES / "budd_dux.toml").with_(contact__upper=0.0)
    found = sx.stability(case)
    duration = found.periods * 2 * np.pi / program.models["budd_dux"].drive_frequency({})
    lost = 2 * np.log(0.8) * found.impacts / duration
    return [
        row(
            "dux.exponent",
            exponent,
            "`examples/validation/budd_dux.toml`, 200 pairs of neighbouring motions of the library",
        ),
        row("dux.sum", found.sum_found - lost, "`separatrix stability examples/validation/budd_dux.toml`"),
    ]


def largest_exponent(stroboscopic: Map, count: int = 200, periods: int = 300, apart: float = 1e-8) -> float:
    """Largest Lyapunov exponent per second: how pairs of motions part, after 100 drive periods (Benettin)."""
    random = np.random.default_rng(1)
    one = np.column_stack([random.uniform(-2, 0, count), random.uniform(-2, 2, count)])
    other, total = one - [apart, 0], 0.0
    for period in range(periods + 100):
        one, other = np.split(stroboscopic.image(np.concatenate([one, other])), 2)
        # a chatter that is completed leaves no difference at all
        distance = np.maximum(np.linalg.norm(other - one, axis=1), 1e-14)
        if period >= 100:
            total += float(np.mean(np.log(distance / apart)))
        direction = np.where(distance[:, None] > 1e-14, (other - one) / distance[:, None], [-1.0, 0.0])
        # the neighbour stays on the free side of the barrier
        other = one - apart * np.where(direction[:, :1] > 0, direction, -direction)
    return total / (periods * stroboscopic.duration)


def graze_of(model: Model, name: str, low: float, high: float, height: float, **fixed: float) -> float:
    """The value of a parameter at which the highest point of the free motion is at a height."""
    others = {key.replace("__", "."): value for key, value in fixed.items()}

    def excess(value: float) -> float:
        free = Map(model, {**others, name: value, "contact.upper": height + 1e3})
        return free.highest(settled_free(free))[1] - height

    return brentq(excess, low, high, xtol=1e-13, rtol=1e-14)


def settled_free(free: Map) -> np.ndarray:
    """The section point of a linear motion without impacts: one step of Newton's method is exact."""
    return free.orbit(np.zeros(2)).point


def coco(program: Program) -> list[Row]:
    """Graze, folds and doublings of COCO's impact oscillator."""
    model, how = program.models["impact_coco"], NEWTON.format("impact_coco")
    numbers = {f"coco.curve.{w}": graze_of(model, "drive.amplitude", 1e-3, 10, 1.0, drive__ratio=w)
               for w in (0.5, 0.8, 0.95, 1.05, 1.3, 1.9)}  # fmt: skip
    numbers["coco.graze"] = graze_of(model, "drive.amplitude", 1e-3, 10, 1.0)
    orbit = Map(model).orbits((-3, 1), (-3, 3), 1)[0]
    meeting, met = located_fold(model, 1.0, (0.11, 0.0999), 1e-7)
    numbers |= {
        "coco.speed": orbit.impact_speed[0],
        "coco.phase": orbit.impact_phase[0],
        "coco.real": orbit.multipliers[0].real,
        "coco.imaginary": abs(orbit.multipliers[0].imag),
        "coco.determinant": np.linalg.det(orbit.matrix),
        "coco.fold": meeting,
        "coco.fold_speed": met.impact_speed[0],
    }
    for w in (0.8, 0.95):
        numbers[f"coco.doubling.{w}"] = located_doubling(model, w)
    numbers["coco.fold.1.05"] = located_fold(model, 1.05, (1.0, 0.1), 1e-5)[0]
    numbers["coco.fold.1.9"] = located_fold(model, 1.9, (6.0, 2.0), 1e-5)[0]
    for n in (1, 2):

        def leverage(w: float) -> float:
            """How the velocity at the start of a flight moves the position at its end."""
            still = {"drive.ratio": w, "drive.amplitude": 0.0}
            return float(Map(model, still).matrix(np.zeros(2), 0.1)[0, 1])

        numbers[f"coco.resonant.{n}"] = brentq(leverage, 2 / n - 0.02, 2 / n + 0.02, xtol=1e-14)
    numbers |= tangency(model, meeting, numbers["coco.resonant.2"])
    rows = [row(key, value, how) for key, value in numbers.items()]
    return [*rows, *swept(program)]


def located_doubling(model: Model, w: float) -> float:
    """The amplitude of the period doubling of the orbit with one impact, run down from 1.5."""

    def at(amplitude: float) -> Map:
        # a section half a turn on, because the impact passes crank angle 0 on the way
        return Map(model, {"drive.ratio": w, "drive.amplitude": amplitude}, angle=np.pi)

    orbit = at(1.5).orbits((-4, 1), (-4, 4), 1)[0]
    branch = follow(at, 1.5, 0.4, orbit.point, 110)
    signs = [np.linalg.det(item.matrix + np.eye(2)) > 0 for _, item in branch]
    k = signs.index(False)
    return doubling(at, branch[k - 1][0], branch[k][0], branch[k - 1][1].point)[0]


def located_fold(model: Model, w: float, ends: tuple[float, float], step: float) -> tuple[float, Orbit]:
    """The amplitude of the fold at which the orbit with one impact ends, and the orbit there."""

    def at(amplitude: float) -> Map:
        return Map(model, {"drive.ratio": w, "drive.amplitude": amplitude}, step=step)

    wide = Map(model, {"drive.ratio": w, "drive.amplitude": ends[0]})
    size = 4 * max(1.0, ends[0])
    branch = follow(at, *ends, wide.orbits((-size, 1), (-size, size), 1, 40)[0].point)
    return fold(at, branch[-1][0], branch[-1][1].point, step)


def tangency(model: Model, meeting: float, resonance: float) -> dict[str, float]:
    """How the fold leaves the curve of grazes: with the square of the distance from the resonance."""
    far = resonance + 9 * (1 - resonance)
    grazes = graze_of(model, "drive.amplitude", 1e-3, 10, 1.0, drive__ratio=far)
    near = 0.1 - meeting
    distant = grazes - located_fold(model, far, (grazes + 0.01, grazes - 0.01), 1e-6)[0]
    return {
        "coco.tangency": near / (1 - resonance) ** 2,
        "coco.ninefold": distant / near,
        "coco.order": float(np.log(distant / near) / np.log(9)),
        "coco.window": near,
    }


def swept(program: Program) -> list[Row]:
    """The same graze and fold as `sweep` brackets them, within 1e-9."""
    with open_result(program.run("sweep", "impact_coco")) as result:
        limits = table(result, "limits")
        names, lows, highs = (limits[key].values for key in ("name", "lower", "upper"))
        found = {str(name): (low + high) / 2 for name, low, high in zip(names, lows, highs, strict=True)}
    how = "`separatrix sweep examples/validation/impact_coco.toml`, middle of the bracket"
    names = {"coco.sweep_graze": "impacts_start_up", "coco.sweep_fold": "impacts_stop_down"}
    return [row(key, found.get(name, np.nan), how) for key, name in names.items()]


def den_hartog(program: Program) -> list[Row]:
    """Dry friction: amplitude without stick, and where stick begins."""
    command = "`separatrix basin examples/validation/dry_friction.toml"
    amplitude = program.catalogue("dry_friction")["amplitude"].ravel()[0]
    rows, onsets = [row("hartog.amplitude", amplitude, f"{command}`")], {}
    plain = ("friction.static_coefficient=1.0",)
    bare = ('friction={law="coulomb", kinetic_coefficient=1}',)
    for name, settings in {"": (), "plain_": plain, "undamped_": bare}.items():
        for side, ends in {"low": (0.6, 0.9), "high": (1.45, 1.1)}.items():
            onset = onsets[name, side] = stick_onset(program, ends, settings)
            words = "".join(f" --set '{item}'" for item in settings)
            rows.append(
                row(
                    f"hartog.{name}{side}",
                    onset,
                    f"{command}{words}` over drive ratios, refined to the change of regime",
                )
            )
    low = f"drive.ratio={onsets['', 'low']!r}"
    onset = program.catalogue("dry_friction", low)["amplitude"].ravel()[0]
    return [*rows, row("hartog.onset_amplitude", onset, f"{command} --set {low}`")]


def stick_onset(
    program: Program, ends: tuple[float, float], settings: tuple[str, ...], count: int = 11
) -> float:
    """The drive ratio between one with stick and one without at which stick begins."""
    stuck, free = ends
    while abs(free - stuck) > 1e-11:
        low, high = min(stuck, free), max(stuck, free)
        ratios = f"{{name='drive.ratio', from={low!r}, to={high!r}, count={count}}}"
        axes = f"axis=[{ratios}, {{name='x0', from=0, to=0, count=1}}]"
        with open_result(
            program.run("basin", "dry_friction", axes, "attractors.sample=4", *settings)
        ) as result:
            values, sticks = result["drive_ratio"].values, result["regime"].values.ravel() == 3
        if stuck > free:
            values, sticks = values[::-1], sticks[::-1]
        last = int(np.flatnonzero(sticks)[-1])
        stuck, free = float(values[last]), float(values[last + 1])
    return (stuck + free) / 2


def family(program: Program) -> list[Row]:
    """The family of orbits that dry friction alone leaves marginal: they turn where the section is taken."""
    rows = []
    for key, ratio in {"family.multiplier": 0.5, "family.quarter": 0.25}.items():
        x = 1 / (1 - ratio**2)
        here = Map(program.models["dry_friction_family"], {"drive.ratio": ratio})
        along = here.image(np.column_stack([x + 1e-3 * OFFSETS, np.zeros(4)]))
        how = f"`examples/validation/dry_friction_family.toml`, library, along the family at x = {x:.4f}"
        rows.append(row(key, float(WEIGHTS @ along[:, 0]) / 1e-3, how))
    axes = [f"axis[{i}].count=7" for i in (1, 2)]
    kinds = program.catalogue("dry_friction_family", *axes)["kind"].ravel()
    how = "`separatrix basin examples/validation/dry_friction_family.toml`, 7 x 7 starts"
    rows.append(row("family.catalogue", float(np.isin(kinds, (CYCLE, FAMILY_OF_CYCLES)).sum()), how))
    rows.append(row("family.kind", float((kinds == FAMILY_OF_CYCLES).sum()), how))
    return rows


def soft(program: Program) -> list[Row]:
    """Soft walls: the free motion, its graze, and the chaos beside it."""
    entries, command = (
        program.catalogue("soft_impact"),
        "`separatrix basin examples/validation/soft_impact.toml`",
    )
    free = entries["impacts_per_period"].ravel() == 0
    others = entries["kind"].ravel()[~free]
    model, rig = program.models["soft_impact"], program.models["soft_impact_rig"]
    rows = [
        row("soft.amplitude", float(entries["amplitude"].ravel()[free][0]), command),
        row("soft.chaos", float(np.sum(others == 3)), command),
        row("soft.graze", graze_of(model, "drive.ratio", 0.42, 0.6, 0.63), NEWTON.format("soft_impact")),
    ]
    for a in (0.7, 0.9):

        def excess(w: float, a: float = a) -> float:
            values = {"drive.ratio": w, "drive.amplitude": a / 1.26 * w**2, "contact.upper": 20.0}
            here = Map(rig, values)
            return here.highest(settled_free(here))[1] - 1

        w = brentq(excess, 0.6, 0.95, xtol=1e-13)
        rows.append(row(f"rig.{a}", w, NEWTON.format("soft_impact_rig")))
    return rows


def followed(program: Program) -> list[Row]:
    """Folds, doublings, grazes and onsets of stick as the command `branches` finds and locates them."""
    found, how = {}, {}

    def follow_over(
        keys: dict[str, Callable[[Labels], float]],
        case: str,
        parameter: str,
        ends: tuple[float, float],
        *settings: str,
    ) -> None:
        labels = program.labels(case, parameter, ends, *settings)
        words = "".join(f" --set '{item}'" for item in settings)
        for key, pick in keys.items():
            found[f"{key}.branches"] = float(pick(labels))
            how[f"{key}.branches"] = (
                f"`separatrix branches examples/validation/{case}.toml --parameter {parameter}{words}`"
            )

    def graze(labels: Labels) -> float:
        return labels.at("GR", "GR-fold")[0]

    dux = {
        "dux.doubling": lambda labels: labels.at("PD", impacts=1)[-1],
        "dux.fold": lambda labels: -labels.at("SN", impacts=1)[0],
    }
    follow_over(dux, "budd_dux", "contact.upper", (-2.0, 0.1))
    coco_keys = {"coco.graze": graze, "coco.fold": lambda labels: labels.at("SN", impacts=1)[0]}
    follow_over(coco_keys, "impact_coco", "drive.amplitude", (0.05, 1.2))
    for w, name, high in (
        (0.8, "doubling", 1.0),
        (0.95, "doubling", 1.0),
        (1.05, "fold", 1.0),
        (1.9, "fold", 6.0),
    ):
        label = "PD" if name == "doubling" else "SN"
        keys = {
            f"coco.curve.{w}": graze,
            f"coco.{name}.{w}": lambda labels, label=label: labels.at(label, impacts=1)[-1],
        }
        follow_over(keys, "impact_coco", "drive.amplitude", (0.05, high), f"drive.ratio={w}")
    plain = "friction.static_coefficient=1.0"
    bare = 'friction={law="coulomb", kinetic_coefficient=1}'
    for name, settings in {"": (), "plain_": (plain,), "undamped_": (bare,)}.items():
        keys = {
            f"hartog.{name}low": lambda labels: labels.at("stick_onset")[0],
            f"hartog.{name}high": lambda labels: labels.at("stick_onset")[-1],
        }
        follow_over(keys, "dry_friction", "drive.ratio", (0.62, 1.45), *settings)
    follow_over({"soft.graze": graze}, "soft_impact", "drive.ratio", (0.42, 0.6))
    return [row(key, value, how[key]) for key, value in found.items()]


COMPUTED = (budd_dux, chaos, coco, den_hartog, family, soft, followed)
