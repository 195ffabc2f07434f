# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole motions and labels by the library have the bits of `trajectory`, `points` and `basin`."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import CASE, succeed
from separatrix import simulate
from separatrix.library import CaseError, Model
from separatrix.simulate import Catalogue, StopFlag, StoppedError, search_slices, trajectory

pytestmark = pytest.mark.usefixtures("library")

EXAMPLES = ["trajectory_stribeck_1.2_impact", "pair_backlash", "hammer", "contact_hunt_crossley", "pair_free"]
# Another machine in each: lanes, Stribeck's layer, no lanes, an effect that has no closed form.
POINTS = {
    "coulomb": (CASE, 1000),
    "stribeck": (
        CASE.replace('"coulomb"', '"coulomb_stribeck"\nstatic_coefficient = 0.3\nstribeck_velocity = 0.05'),
        40,
    ),
    "one_by_one": (CASE + '[integrator]\nlanes = "off"\n', 200),
    "cubic": (CASE + "[effect.cubic_spring]\nstiffness = 10\n[run]\nduration = 5\nwindow = 1\n", 40),
}


def starts_of(count: int) -> np.ndarray:
    """Random starts between the barriers of `CASE`."""
    chance = np.random.default_rng(7)
    return np.column_stack([chance.uniform(0, 1.1, count), chance.uniform(-6, 6, count), np.zeros(count)])


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_motion_is_what_the_program_writes(
    name: str, separatrix: Path, source_dir: Path, tmp_path: Path
) -> None:
    """Samples, events and book of `trajectory`, two bodies and soft barriers included."""
    case = source_dir / "examples" / f"{name}.toml"
    succeed(separatrix, "trajectory", case, "-o", "out.h5", folder=tmp_path)
    model = Model.read(case)
    with h5py.File(tmp_path / "out.h5") as file:
        resolved = Model.from_text(file["provenance"].attrs["resolved_case"], case.parent)
        start = start_of(resolved)
        motion = trajectory(model, start, room=(1, 1))
        columns = dict(motion.samples)
        if "drive" in file:
            columns["drive"] = columns.pop("driver_x")
        columns["potential_energy"] = columns["energy"] - columns["kinetic_energy"]
        for key, item in file.items():
            if not isinstance(item, h5py.Dataset) or item.dtype.names is not None or key == "event":
                continue
            mine = motion.events[key.removeprefix("event_")] if key.startswith("event_") else columns[key]
            np.testing.assert_array_equal(mine, item[()], err_msg=key)
        for key in set(simulate.SUMMARY) - {
            "regime",
            "reason",
            "soft",
            "x",
            "v",
            "trajectory_reason",
            "two_bodies",
        }:
            if key in file.attrs and key != "impacts":
                assert motion.summary[key] == file.attrs[key], key
    assert len(motion.samples["time"]) > 100


def start_of(model: Model) -> tuple[float, float, float]:
    """The start of a resolved case."""
    import tomllib

    start = tomllib.loads(model.to_text({}))["start"]
    return tuple(start[key] for key in ("x0", "v0", "crank_angle"))


@pytest.mark.parametrize("name", POINTS)
def test_the_end_has_the_bits_of_points(name: str, separatrix: Path, tmp_path: Path) -> None:
    """Random starts: state, impacts and reason at the end of the duration, also with another drive ratio."""
    text, count = POINTS[name]
    starts = starts_of(count)
    ratios = np.where(np.arange(count) % 10 == 0, 1.05, 1.2)
    rows = [f"{x!r},{v!r},{r!r}" for x, v, r in zip(*starts.T[:2].tolist(), ratios.tolist(), strict=True)]
    (tmp_path / "case.toml").write_text(text)
    (tmp_path / "starts.csv").write_text("x0,v0,ratio\n" + "\n".join(rows) + "\n")
    succeed(separatrix, "points", "case.toml", "--list", "starts.csv", "-o", "out.h5", folder=tmp_path)
    model = Model.from_text(text)
    with h5py.File(tmp_path / "out.h5") as file:
        expected = {
            key: file[key][()] for key in ("x", "v", "impacts", "last_impact_speed", "regime", "reason")
        }
    for i, start in enumerate(starts):
        values = {} if ratios[i] == 1.2 else {"drive.ratio": ratios[i]}
        summary = trajectory(model, start, values, samples_per_period=-1).summary
        assert [summary[key] for key in expected] == [column[i] for column in expected.values()]


def labels_of_file(path: Path) -> tuple[dict[str, np.ndarray], np.ndarray, Model, h5py.File]:
    """Variables of a map over x0 and v0, its starts, and its case."""
    file = h5py.File(path)
    x0, v0 = np.meshgrid(file["x0"][()], file["v0"][()], indexing="ij")
    starts = np.column_stack([x0.ravel(), v0.ravel(), np.zeros(x0.size)])
    model = Model.from_text(file["provenance"].attrs["resolved_case"])
    return {key: file[key][()] for key in simulate.LABEL_VARIABLES}, starts, model, file


def test_labels_have_the_bits_of_basin(results: dict[str, Path]) -> None:
    """All variables of all points, by four threads at once with one catalogue."""
    expected, starts, model, file = labels_of_file(results["map"])
    with file:
        catalogue = Catalogue(model).search()
        entries = {key: file["catalogue"][key][()] for key in ("x", "v", "period", "multiplier", "regime")}
    for key, column in entries.items():
        assert [one.numbers[key] for one in catalogue.attractors] == list(column), key
    parts = np.array_split(np.arange(len(starts)), 16)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda part: catalogue.labels(starts[part]), parts))
    for key, values in expected.items():
        mine = np.concatenate([one[key] for one in found])
        np.testing.assert_array_equal(mine, values.ravel(), err_msg=key)
        assert mine.dtype == values.dtype


def test_slices_are_numbered_as_basin_does(results: dict[str, Path]) -> None:
    """Labels of a stack of maps: neighbours are asked and branches keep their numbers."""
    expected, starts, model, file = labels_of_file(results["stack"])
    with file:
        ratios = file["drive_ratio"][()]
    catalogues = search_slices(model, [{"drive.ratio": ratio} for ratio in ratios], (len(ratios),))
    for i, catalogue in enumerate(catalogues):
        found = catalogue.labels(starts)
        for key, values in expected.items():
            np.testing.assert_array_equal(found[key], values[i].ravel(), err_msg=key)


def test_motions_from_several_threads_are_the_same() -> None:
    """One handle, four threads, the same bits as one."""
    model = Model.from_text(CASE)
    starts = starts_of(12)
    alone = [trajectory(model, start).samples["x"] for start in starts]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda start: trajectory(model, start).samples["x"], starts))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, other)


def test_stops_when_asked() -> None:
    """The flag ends a labelling soon, and a search before its first start."""
    model = Model.from_text(CASE + '[integrator]\nlanes = "off"\nflight = "adaptive"\n')
    catalogue = Catalogue(model)
    flag = StopFlag()
    catalogue.search(np.array([[0.4, 0.0, 0.0]]))
    timer = threading.Timer(0.1, flag.set)
    timer.start()
    began = time.monotonic()
    with pytest.raises(StoppedError, match="stopped after"):
        catalogue.labels(starts_of(100000), flag)
    assert time.monotonic() - began < 20
    with pytest.raises(StoppedError, match="searching"):
        catalogue.search(stop=flag)
    assert len(catalogue.attractors) == 1


def test_starts_that_are_not_allowed() -> None:
    """Beyond a barrier: no label, and no motion."""
    model = Model.from_text(CASE)
    found = Catalogue(model).search().labels(np.array([[1.2, 0, 0], [0.4, 0, 0], [np.nan, 0, 0]]))
    assert found["reason"].tolist() == [0, 1, 0]
    with pytest.raises(
        CaseError, match=r"found x0 = 1.2 m, allowed at most the barrier contact.upper = 1.1 m"
    ):
        trajectory(model, (1.2, 0, 0))
    with pytest.raises(CaseError, match="not finite"):
        trajectory(model, (np.nan, 0, 0))
    with pytest.raises(CaseError, match="duration"):
        trajectory(model, (0.4, 0, 0), duration=-1)
    with pytest.raises(CaseError, match="samples in all"):
        trajectory(model, (0.4, 0, 0), duration=1e6, samples_per_period=10**6)
    with pytest.raises(CaseError, match="contact.restitution"):
        trajectory(model, (0.4, 0, 0), {"contact.restitution": 2.0})


@pytest.mark.parametrize("soft", [False, True])
def test_a_pair_starts_between_its_stops(source_dir: Path, soft: bool) -> None:
    """At a stop is between them; soft ones may be pressed."""
    text = (source_dir / "examples" / "pair_backlash.toml").read_text()
    if soft:
        text = text.replace('"newton"', '"hunt_crossley_exact"\nstiffness = 1e5')
    model = Model.from_text(text)
    for stop in (0.1, -0.1):
        assert trajectory(model, (stop, 0.0, 0), duration=0.1, samples_per_period=-1).summary["reason"] != 65
        if soft:
            pressed = trajectory(model, (1.01 * stop, 0.0, 0), duration=0.1).samples
            assert pressed["contact_force"][0] * stop < 0
            continue
        with pytest.raises(CaseError, match=f"found x0 = {1.01 * stop:.3f}.* allowed"):
            trajectory(model, (1.01 * stop, 0.0, 0), duration=0.1)


def test_starts_that_are_not_allowed_of_several_threads() -> None:
    """None is taken for an allowed one, and nothing breaks, however many threads are refused at once."""
    catalogue = Catalogue(Model.from_text(CASE))
    beyond = np.tile([5.0, 0.0, 0.0], (1000, 1))
    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(catalogue.labels, [beyond] * 100):
            assert not found["reason"].any() and not found["attractor"].any()
