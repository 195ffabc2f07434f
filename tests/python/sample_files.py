# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Result files as docs/file-format.md describes them, with made-up contents, for the tests of the figures."""

from pathlib import Path

import h5py
import numpy as np
from separatrix.variables import FORMAT_VERSION

REGIMES = "unresolved non_impact impact sticking mixed chattering at_rest stuck"
REASONS = "not_run settled time_over left_domain not_finite event_budget step_failed step_budget mode_cycle"
EVENTS = (
    "impact_upper impact_lower stick release turning_point chatter_upper chatter_lower barrier_release"
    " touch_upper touch_lower separation impulse"
)
MODES = "slip_plus slip_minus stick upper_barrier lower_barrier held"
AXES = {
    "x0": ("m", "initial position"),
    "v0": ("m/s", "initial velocity"),
    "crank_angle": ("rad", "initial crank angle"),
    "drive_ratio": ("1", "drive frequency over natural frequency"),
    "friction_kinetic_coefficient": ("1", "mu while sliding"),
}
CASE = """
title = "Coulomb friction"
[body]
law = "point_mass"
mass = 1.0
[friction]
law = "coulomb"
kinetic_coefficient = 0.1
static_coefficient = 0.12
[contact]
law = "newton"
restitution = 0.6
upper = 0.8
[drive]
law = "harmonic"
ratio = 1.2
amplitude = 0.1
"""
# impact at the upper barrier, end of a drive period
WORD_IMPACT = 1 | 7 << 3
WORD_QUIET = 7


def write_basin(
    path: Path,
    axes: dict[str, np.ndarray],
    attractor: np.ndarray,
    regime_of: tuple[int, ...] = (0, 1, 2),
    chunks: tuple[int, ...] | None = None,
    fields: dict[str, np.ndarray] | None = None,
) -> Path:
    """Write a basin file from the attractor ids; `regime_of[id]` is the regime of an attractor."""
    regime = np.asarray(regime_of, dtype=np.int8)[attractor]
    impacting = regime == 2
    word = np.where(impacting, WORD_IMPACT, np.where(attractor > 0, WORD_QUIET, 0))
    values = {
        "regime": (regime, "i1", "1"),
        "attractor": (attractor, "i4", "1"),
        "reason": (np.where(attractor > 0, 1, 2), "i1", "1"),
        "period": (np.where(attractor > 0, 1, 0), "i2", "1"),
        "event_word": (word, "f8", "1"),
        "impacts_per_period": (impacting, "f4", "1"),
        "mean_impact_speed": (3.9 * impacting, "f4", "m/s"),
        "amplitude": (0.2 + 0.24 * impacting, "f4", "m"),
        "x_max": (0.5 + 0.3 * impacting, "f4", "m"),
        "x_min": (0.1 - 0.1 * impacting, "f4", "m"),
        "v_max": (2.4 + 2.6 * impacting, "f4", "m/s"),
        "settle_time": (np.where(attractor > 0, 5.0, np.nan), "f4", "s"),
        "grazing_margin": (np.full(attractor.shape, 0.01), "f4", "m"),
    }
    for name, field in (fields or {}).items():
        values[name] = (field, *values[name][1:])
    with _create(path, "basin") as file:
        for name, points in axes.items():
            _scale(file, name, points, *AXES[name])
        for name, (data, kind, unit) in values.items():
            _variable(file, name, data.astype(kind), list(axes), unit, chunks)
        slices = attractor.size // max(
            1, np.prod([len(p) for n, p in axes.items() if n in ("x0", "v0")], dtype=int)
        )
        _catalogue(file, slices, regime_of)
    return path


def write_sweep(path: Path, ratios: np.ndarray, starts: int = 6, samples: int = 8) -> Path:
    """Write a sweep with the regions of a vibro-impact system: impacts up to 1.35 upwards, 1.12 downwards."""
    impact = np.stack([(ratios > 0.87) & (ratios < 1.35), (ratios > 0.87) & (ratios < 1.12)])
    quiet = 0.05 + 0.11 / (0.12 + np.abs(ratios - 1.0))
    x_max = np.where(impact, 0.8, np.minimum(quiet, 0.79) * np.ones((2, 1)))
    x_min = -np.where(impact, 0.3 * ratios, 0.8 * np.minimum(quiet, 0.6))
    both = (ratios > 1.12) & (ratios < 1.35)
    branch = np.stack([np.where(both, k % 2, impact[0]) for k in range(starts)], axis=1).astype(bool)
    with _create(path, "sweep") as file:
        file.attrs["barrier_upper"] = 0.8
        _scale(file, "direction", np.arange(2, dtype="i1"), "1", "direction of the sweep")
        _scale(file, "drive_ratio", ratios, *AXES["drive_ratio"])
        _scale(file, "sample", np.arange(samples, dtype="i4"), "1", "stroboscopic sample")
        _scale(file, "start", np.arange(starts, dtype="i4"), "1", "start")
        dims = ["direction", "drive_ratio"]
        for name, data, unit in (
            ("x_max", x_max, "m"),
            ("x_min", x_min, "m"),
            ("amplitude", (x_max - x_min) / 2, "m"),
            ("v_max", 2.4 + 2.6 * impact, "m/s"),
            ("mean_impact_speed", impact * (2.0 + 3.0 * (ratios - 0.87)), "m/s"),
            ("impacts_per_period", 1.0 * impact, "1"),
            ("regime", (1 + impact).astype("i1"), "1"),
            ("period", np.ones(impact.shape, "i2"), "1"),
            ("event_word", np.where(impact, float(WORD_IMPACT), WORD_QUIET), "1"),
            ("reason", np.full(impact.shape, 2, "i1"), "1"),
        ):
            _variable(file, name, data, dims, unit)
        wave = 0.05 * np.cos(np.pi * np.arange(samples)) * (impact & (ratios > 1.2))[..., None]
        for name, unit in (("section_x", "m"), ("section_v", "m/s")):
            _variable(file, name, 0.5 * x_max[..., None] + wave, [*dims, "sample"], unit)
        upper = np.where(branch, 0.8, np.minimum(quiet, 0.79)[:, None])
        lower = -np.where(branch, 0.3 * ratios[:, None], 0.8 * np.minimum(quiet, 0.6)[:, None])
        for name, data, unit in (
            ("x_max", upper.astype("f4"), "m"),
            ("x_min", lower.astype("f4"), "m"),
            ("amplitude", ((upper - lower) / 2).astype("f4"), "m"),
            ("v_max", (2.4 + 2.6 * branch).astype("f4"), "m/s"),
            ("mean_impact_speed", (3.0 * branch).astype("f4"), "m/s"),
            ("impacts_per_period", branch.astype("f4"), "1"),
            ("regime", (1 + branch).astype("i1"), "1"),
            ("reason", np.ones(branch.shape, "i1"), "1"),
            ("attractor", (1 + branch).astype("i4"), "1"),
            ("period", np.ones(branch.shape, "i2"), "1"),
            ("event_word", np.where(branch, float(WORD_IMPACT), WORD_QUIET), "1"),
        ):
            _variable(file, f"branch_{name}", data, ["drive_ratio", "start"], unit)
        _variable(file, "start_x0", np.linspace(-0.5, 0.7, starts), ["start"], "m")
        _variable(file, "start_v0", np.zeros(starts), ["start"], "m/s")
        _limits(file)
    return path


def write_trajectory(path: Path, samples: int = 4001, impacting: bool = True) -> Path:
    """Write a motion that bounces off the upper barrier at 0.8 m once a second, or one below it."""
    time = np.linspace(0.0, 20.0, samples)
    size = 0.5 * (1 - 0.6 * np.exp(-time / 3.0))
    slope = 0.5 * 0.2 * np.exp(-time / 3.0)
    turn = np.sin(np.pi * time)
    x = 0.8 - size * np.abs(turn) if impacting else 0.3 + size * 0.5 * turn
    v = -size * np.pi * np.cos(np.pi * time) * np.sign(turn) - slope * np.abs(turn)
    v = v if impacting else 0.5 * (size * np.pi * np.cos(np.pi * time) + slope * turn)
    hits = np.arange(1.0, 20.0) if impacting else np.zeros(0)
    speed = 0.5 * (1 - 0.6 * np.exp(-hits / 3.0)) * np.pi
    with _create(path, "trajectory") as file:
        file.attrs.update(
            drive_period=1.0, drive_ratio=1.2, barrier_upper=0.8, window=4.0, amplitude=0.25, x_max=0.8,
            x_min=0.3, v_max=1.57, impacts=np.int32(4 * impacting), impacts_per_period=1.0 * impacting,
            mean_impact_speed=1.57 * impacting, regime=np.int8(1 + impacting), reason=np.int8(1),
        )  # fmt: skip
        _scale(file, "time", time, "s", "time")
        for name, data, unit in (
            ("x", x, "m"),
            ("v", v, "m/s"),
            ("drive", 0.1 * np.cos(2 * np.pi * time), "m"),
        ):
            _variable(file, name, data, ["time"], unit)
        _variable(file, "mode", np.ones(samples, "i1"), ["time"], "1")
        _scale(file, "event", np.arange(hits.size, dtype="i4"), "1", "event")
        _variable(file, "event_kind", np.ones(hits.size, "i1"), ["event"], "1")
        for name, data, unit in (
            ("event_time", hits, "s"),
            ("event_x", np.full(hits.size, 0.8), "m"),
            ("event_v_before", speed, "m/s"),
            ("event_v_after", -speed, "m/s"),
        ):
            _variable(file, name, data, ["event"], unit)
    return path


def write_points(path: Path, number: int = 300) -> Path:
    """Write points of which those with a large position impact."""
    generator = np.random.default_rng(1)
    x0, v0 = generator.uniform(-1, 1, number), generator.uniform(-3, 3, number)
    impact = x0 + 0.2 * np.sin(3 * v0) > 0.2
    with _create(path, "points") as file:
        _scale(file, "point", np.arange(number, dtype="i4"), "1", "point")
        for name, data, unit in (
            ("x0", x0, "m"),
            ("v0", v0, "m/s"),
            ("ratio", np.full(number, 1.2), "1"),
            ("x", 0.5 * x0, "m"),
            ("v", 0.5 * v0, "m/s"),
            ("last_impact_speed", 3.0 * impact, "m/s"),
            ("impacts", (20 * impact).astype("i4"), "1"),
            ("regime", (1 + impact).astype("i1"), "1"),
            ("reason", np.ones(number, "i1"), "1"),
        ):
            _variable(file, name, data, ["point"], unit)
    return path


def write_boundary(path: Path, stack: Path) -> Path:
    """Write a boundary with a saddle for the first and the last slice of a stack over drive.ratio, x0, v0."""
    with h5py.File(stack) as source, h5py.File(path, "w") as file:
        file.attrs.update(dict(source.attrs) | {"kind": "boundary", "map": stack.name, "axes": "x0 v0"})
        file.attrs["map_identity"] = source["provenance"].attrs["case_identity"]
        source.copy("provenance", file)
        ratios = source["drive_ratio"][[0, -1]]
    file = h5py.File(path, "a")
    turn = 2 * np.pi * np.arange(40) / 40
    round_it = {"x0": 0.55 + 0.3 * np.cos(turn), "v0": 3 * np.sin(turn)}
    with file:
        for name, values in round_it.items():
            file[name] = np.tile(values, 2)
        for name, value in (("across", 0), ("below", 1), ("above", 2)):
            file[name] = np.full(80, value, "i4")
        for name, values in (
            ("first", [0, 40]), ("points", [40, 40]), ("closed", [1, 1]), ("label_one", [1, 0]),
            ("label_two", [2, 2]), ("piece_name", [1, 1]), ("piece_saddle", [1, 2]),
        ):  # fmt: skip
            file[name] = np.array(values, "i4")
        file["piece_name"].attrs.update(
            flag_values=np.array([0, 1], "i1"), flag_meanings="not_known stable_set"
        )
        file["piece_drive_ratio"] = ratios
        group = file.create_group("saddles")
        for name, values in (("period", [1, 1]), ("event_word", [float(WORD_IMPACT)] * 2), ("saddle", [1, 2]),
                             ("boundary_points", [40, 40])):  # fmt: skip
            group[name] = np.array(values)
        group["multipliers"] = np.array([[3.0, 0.1], [4.0, 0.2]])
        group["multipliers_imag"] = np.zeros((2, 2))
        group["x"], group["v"], group["drive_ratio"] = np.array([0.85, 0.25]), np.zeros(2), ratios
    return path


def _create(path: Path, kind: str) -> h5py.File:
    file = h5py.File(path, "w", libver=("earliest", "v110"))
    file.attrs.update(
        Conventions="CF-1.10", title=f"A {kind} costing 1 $", source="Separatrix 0.1.0", history="by a test",
        references="", format="separatrix", format_version=np.int32(FORMAT_VERSION), kind=kind,
        date_created="2026-01-01T00:00:00Z", complete=np.int32(1),
    )  # fmt: skip
    group = file.create_group("provenance")
    group.attrs.update(case_text=CASE, resolved_case=CASE)
    group.attrs.update(version="0.1.0", commit="0123456789abcdef", ranks=np.int32(2), wall_seconds=1.5)
    return file


def _scale(file: h5py.Group, name: str, points: np.ndarray, unit: str, long_name: str) -> None:
    file[name] = np.asarray(points)
    file[name].make_scale(name)
    file[name].attrs.update(units=unit, long_name=long_name)


def _variable(
    file: h5py.Group, name: str, data: np.ndarray, dims: list[str], unit: str, chunks: tuple | None = None
) -> None:
    dataset = file.create_dataset(name, data=data, chunks=chunks, compression="gzip" if chunks else None)
    dataset.attrs.update(units=unit, long_name=name.replace("_", " "))
    for axis, dim in enumerate(dims):
        dataset.dims[axis].attach_scale(file[dim])
    base = name.removeprefix("branch_")
    for coded, meanings, first in (
        ("regime", REGIMES, 0), ("reason", REASONS, 0), ("event_kind", EVENTS, 1), ("mode", MODES, 1),
    ):  # fmt: skip
        if base == coded:
            dataset.attrs["flag_values"] = np.arange(
                first, first + len(meanings.split()), dtype=dataset.dtype
            )
            dataset.attrs["flag_meanings"] = meanings


def _catalogue(file: h5py.File, slices: int, regime_of: tuple[int, ...]) -> None:
    group = file.create_group("catalogue")
    rows = [(index, identity) for index in range(slices) for identity in range(1, len(regime_of))]
    _scale(group, "entry", np.arange(len(rows), dtype="i4"), "1", "entry")
    regime = np.array([regime_of[identity] for _, identity in rows])
    columns = {
        "slice": [index for index, _ in rows], "attractor": [identity for _, identity in rows],
        "regime": regime, "period": np.ones(len(rows)),
        "event_word": np.where(regime == 2, WORD_IMPACT, WORD_QUIET),
    }  # fmt: skip
    kinds = {"slice": "i4", "attractor": "i4", "regime": "i1", "period": "i2", "event_word": "f8"}
    for name, data in columns.items():
        _variable(group, name, np.asarray(data).astype(kinds[name]), ["entry"], "1")
    for name, unit in (
        ("x", "m"), ("v", "m/s"), ("multiplier", "1"), ("capture_radius", "1"), ("amplitude", "m"),
        ("x_max", "m"), ("x_min", "m"), ("v_max", "m/s"), ("impacts_per_period", "1"),
        ("mean_impact_speed", "m/s"),
        ("grazing_margin", "m"),
    ):  # fmt: skip
        _variable(group, name, np.full(len(rows), 0.5), ["entry"], unit)
    _variable(group, "count", np.ones(len(rows), "i8"), ["entry"], "1")


def _limits(file: h5py.File) -> None:
    group = file.create_group("limits")
    names = ["impacts_start_up", "impacts_stop_up", "impacts_start_down", "impacts_stop_down"]
    _scale(group, "limit", np.arange(4, dtype="i4"), "1", "limit")
    _variable(group, "name", np.arange(4, dtype="i1"), ["limit"], "1")
    group["name"].attrs.update(flag_values=np.arange(4, dtype="i1"), flag_meanings=" ".join(names))
    middle = np.array([0.871, 1.351, 1.121, 0.869])
    _variable(group, "lower", middle - 0.002, ["limit"], "1")
    _variable(group, "upper", middle + 0.002, ["limit"], "1")
    for end, seen in (("lower", middle - 0.004), ("upper", middle - 0.003)):
        _variable(group, f"observed_{end}", seen, ["limit"], "1")
