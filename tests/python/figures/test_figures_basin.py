# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of maps: every point at its position in its colour, reduced or not."""

import re
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
from figure_probes import V0, X0, colour_at, draw, legend_texts
from matplotlib.colors import to_rgb
from sample_files import write_basin
from separatrix import reduce, style
from separatrix.figures import basin
from separatrix.labels import share_texts


@pytest.mark.parametrize("order", [("x0", "v0"), pytest.param(("v0", "x0"), marks=pytest.mark.long)])
@pytest.mark.parametrize("descending", [pytest.param(False, marks=pytest.mark.long), True])
def test_each_point_has_its_colour_at_its_position(tmp_path: Path, order: tuple, descending: bool) -> None:
    axes = {"x0": X0[::-1] if descending else X0, "v0": V0}
    attractor = np.random.default_rng(3).integers(1, 4, (7, 4))
    shown = attractor if order == ("x0", "v0") else attractor.T
    path = write_basin(tmp_path / "b.h5", {name: axes[name] for name in order}, shown, regime_of=(0, 1, 2, 3))
    figure = draw(path)
    for i, x in enumerate(axes["x0"]):
        for j, v in enumerate(axes["v0"]):
            expected = to_rgb(style.ATTRACTORS[attractor[i, j] - 1])
            assert colour_at(figure, x, v) == pytest.approx(expected, abs=0.01)


def test_cells_reach_half_way_to_their_neighbours(tmp_path: Path) -> None:
    np.testing.assert_allclose(basin.cell_edges(np.array([0.0, 1.0, 3.0])), [-0.5, 0.5, 2.0, 4.0])
    np.testing.assert_allclose(basin.cell_edges(np.array([2.0])), [1.5, 2.5])
    figure = draw(write_basin(tmp_path / "b.h5", {"x0": X0, "v0": V0}, np.ones((7, 4), int)))
    figure.canvas.draw()
    assert figure.axes[0].get_xlim() == pytest.approx((-1.15, 0.95))
    assert figure.axes[0].get_ylim() == pytest.approx((-8.0, 8.0))


def test_a_reduced_map_keeps_positions_and_extent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(basin, "majority_plane", lambda *a: reduce.majority_plane(*a, target=10))
    x, v = np.linspace(0, 1, 41), np.linspace(0, 2, 23)
    attractor = np.where(x[:, None] + 0 * v > 0.6, 2, 1)
    attractor[:, v > 1.5] = 3
    figure = draw(write_basin(tmp_path / "b.h5", {"x0": x, "v0": v}, attractor, regime_of=(0, 1, 2, 3)))
    assert figure.axes[0].get_xlim() == pytest.approx((-0.0125, 1.0125))
    for point, identity in (((0.2, 0.5), 1), ((0.9, 0.5), 2), ((0.2, 1.9), 3), ((0.99, 1.95), 3)):
        assert colour_at(figure, *point) == pytest.approx(to_rgb(style.ATTRACTORS[identity - 1]), abs=0.01)
    assert "5 by 3 points" in figure.separatrix_caption


def test_panels_show_their_own_slice(tmp_path: Path) -> None:
    attractor = np.ones((7, 4, 3), int)
    attractor[6, 0, 1] = 2
    axes = {"x0": X0, "v0": V0, "drive_ratio": np.array([1.1, 1.2, 1.3])}
    figure = draw(write_basin(tmp_path / "b.h5", axes, attractor))
    titles = [ax.get_title() for ax in figure.axes]
    assert [re.search(r"= (\S+)", title).group(1) for title in titles] == ["1.1", "1.2", "1.3"]
    colours = [colour_at(figure, X0[6], V0[0], panel) for panel in range(3)]
    assert colours[1] == pytest.approx(to_rgb(style.ATTRACTORS[1]), abs=0.01)
    assert colours[0] == colours[2] == pytest.approx(to_rgb(style.ATTRACTORS[0]), abs=0.01)


def test_too_many_slices_are_thinned_and_reported(tmp_path: Path) -> None:
    axes = {"x0": X0, "v0": V0, "drive_ratio": np.linspace(1, 2, 5), "crank_angle": np.linspace(0, 6, 5)}
    figure = draw(write_basin(tmp_path / "b.h5", axes, np.ones((7, 4, 5, 5), int)))
    assert len(figure.axes) == basin.MOST_PANELS
    assert "12 of 25 slices shown" in figure.separatrix_caption


@pytest.mark.parametrize("axes", [{"x0": X0}, {"drive_ratio": X0 + 2, "v0": V0}, {"x0": X0, "v0": V0[:1]}])
def test_maps_over_other_axes_are_drawn(tmp_path: Path, axes: dict) -> None:
    attractor = np.ones([len(points) for points in axes.values()], int)
    attractor[0] = 2
    figure = draw(write_basin(tmp_path / "b.h5", axes, attractor))
    first = next(iter(axes))
    middle = np.mean(figure.axes[0].get_ylim())
    assert colour_at(figure, axes[first][0], middle) == pytest.approx(to_rgb(style.ATTRACTORS[1]), abs=0.01)
    assert colour_at(figure, axes[first][1], middle) == pytest.approx(to_rgb(style.ATTRACTORS[0]), abs=0.01)


def test_legend_names_what_occurs_with_its_share(tmp_path: Path) -> None:
    attractor = np.ones((7, 4), int)
    attractor[:, 0] = 2
    attractor[0, 3] = 0
    path = write_basin(tmp_path / "b.h5", {"x0": X0, "v0": V0}, attractor)
    assert legend_texts(draw(path)) == [
        "no attractor (3.57 %)",
        "attractor 1: non-impact, period 1 (71.43 %)",
        "attractor 2: impact, period 1 (25.00 %)",
    ]
    regimes = legend_texts(draw(path, "regime"))
    assert regimes == ["unresolved (3.57 %)", "non-impact (71.43 %)", "impact (25.00 %)"]
    assert [text.split(" (")[0] for text in legend_texts(draw(path, "event_word"))] == [
        "no cycle known",
        "no events",
        "word R.",
    ]


def test_the_colour_of_an_attractor_does_not_depend_on_the_others_present(tmp_path: Path) -> None:
    path = write_basin(tmp_path / "b.h5", {"x0": X0, "v0": V0}, np.full((7, 4), 3), regime_of=(0, 1, 2, 3))
    assert colour_at(draw(path), X0[2], V0[2]) == pytest.approx(to_rgb(style.ATTRACTORS[2]), abs=0.01)


def test_the_rarest_of_many_attractors_are_one_class(tmp_path: Path) -> None:
    x, v = np.linspace(0, 1, 13), np.linspace(0, 1, 14)
    attractor = np.maximum(np.arange(13)[:, None], np.arange(14))
    path = write_basin(tmp_path / "b.h5", {"x0": x, "v0": v}, attractor, regime_of=(0, *[1] * 13))
    texts = legend_texts(draw(path))
    assert len(texts) == 12
    assert texts[-1].startswith("3 others")
    assert "attractor 13" in texts[-2]


@pytest.mark.parametrize(
    "counts", [[1], [1, 1, 1], [0, 5], [1, 10**9], [7, 11, 13, 17, 19, 23], [333, 333, 334]]
)
def test_printed_shares_add_up_to_100(counts: list) -> None:
    parts = [0.0 if text.startswith("<") else float(text.removesuffix(" %")) for text in share_texts(counts)]
    assert sum(parts) == pytest.approx(100.0, abs=1e-9)
    for part, count in zip(parts, counts, strict=True):
        assert part == pytest.approx(100 * count / sum(counts), abs=0.01)


def test_a_rare_class_is_not_printed_as_zero() -> None:
    assert share_texts([1, 10**9])[0] == "< 0.01 %"


def majority_by_hand(values: np.ndarray, f: int, g: int) -> np.ndarray:
    rows, columns = range(0, values.shape[0], f), range(0, values.shape[1], g)
    blocks = [[values[i : i + f, j : j + g].ravel() for j in columns] for i in rows]
    # of equally frequent labels bincount().argmax() takes the smallest
    return np.array([[np.bincount(block).argmax() for block in row] for row in blocks])


@pytest.mark.parametrize("shape", [(97, 64), (64, 97), (30, 200)])
@pytest.mark.parametrize("plane", [(0, 1), (1, 0)])
@pytest.mark.parametrize("chunks", [None, (16, 24)])
def test_majority_equals_that_of_each_block(
    tmp_path: Path, shape: tuple, plane: tuple, chunks: tuple | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reduce, "SLAB_BYTES", 700)
    values = np.random.default_rng(5).integers(0, 5, shape).astype("i2")
    with h5py.File(tmp_path / "m.h5", "w") as file:
        dataset = file.create_dataset("label", data=values, chunks=chunks)
        found = reduce.majority_plane(dataset, plane, (), target=20)
    image = values if plane == (0, 1) else values.T
    np.testing.assert_array_equal(found.image, majority_by_hand(image, *found.factors))
    assert max(found.image.shape) <= 20
    assert found.counts == {k: int((values == k).sum()) for k in range(5)}


def test_a_slice_of_more_axes_is_the_right_one(tmp_path: Path) -> None:
    values = np.random.default_rng(6).integers(0, 3, (4, 5, 6, 7)).astype("i1")
    with h5py.File(tmp_path / "m.h5", "w") as file:
        file["label"] = values
        found = reduce.majority_plane(file["label"], (3, 1), (2, 4))
    np.testing.assert_array_equal(found.image, values[2, :, 4, :].T)


def test_scalars_reduce_to_mean_or_smallest_of_the_finite(tmp_path: Path) -> None:
    values = np.random.default_rng(7).normal(size=(12, 9))
    values[:4, :3] = np.nan
    values[5, 5] = np.inf
    with h5py.File(tmp_path / "m.h5", "w") as file:
        file["t"] = values
        mean = reduce.scalar_plane(file["t"], (0, 1), (), target=3).image
        low = reduce.scalar_plane(file["t"], (0, 1), (), target=3, smallest=True).image
    assert mean.shape == (3, 3)
    assert np.isnan(mean[0, 0])
    assert np.isnan(low[0, 0])
    block = values[4:8, 3:6][np.isfinite(values[4:8, 3:6])]
    assert mean[1, 1] == pytest.approx(block.mean())
    assert low[1, 1] == block.min()


def test_memory_is_bounded_by_the_slab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reduce, "SLAB_BYTES", 2**18)
    values = np.random.default_rng(8).integers(0, 4, (4096, 2048), dtype="i1")
    with h5py.File(tmp_path / "m.h5", "w") as file:
        dataset = file.create_dataset("label", data=values, chunks=(128, 128))
        tracemalloc.start()
        found = reduce.majority_plane(dataset, (0, 1), (), target=256)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < values.nbytes / 2
    np.testing.assert_array_equal(found.image[:5], majority_by_hand(values[:80], *found.factors))
