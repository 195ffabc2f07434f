# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimators of measures on sets whose values are known, and on published maps."""

import numpy as np
import pytest
from scipy import stats
from separatrix.measuring import areas, balls, convergence, entropy, tipping, uncertainty, wada
from separatrix.measuring.sampling import Region, share_interval
from synthetic_sets import annulus, cantor, carpet, ellipse, grebogi, grid_of, half_plane, newton

UNIT = Region.of((0, 0), (1, 1))
WIDE = Region.of((-1.2, -1.2), (1.2, 1.2))


@pytest.mark.parametrize(
    ("labels", "centre", "radius"),
    [
        (ellipse((0.7, 0.3)), (0.0, 0.0), 0.3),
        (half_plane((0.6, 0.8), 0.5), (0.0, 0.0), 0.5),
        (annulus(0.4, 1.0), (0.7, 0.0), 0.3),
        (newton, (1.0, 0.0), 0.6220462510530),
    ],
    ids=["ellipse", "half plane", "annulus", "newton"],
)
def test_the_largest_ball_touches_the_boundary(labels, centre, radius) -> None:
    """Semi-minor axis, distance of the line, half the width; 0.622 is Attractors.jl's of Newton's map."""
    ball = balls.largest_ball(labels, np.array(centre), 1, 3.0)
    assert ball.settled and ball.inner <= ball.outer
    assert ball.inner == pytest.approx(radius, abs=1e-9)
    assert ball.outer == pytest.approx(radius, abs=1e-9)
    assert ball.label != 1


def test_a_ball_in_more_dimensions() -> None:
    labels = ellipse((0.9, 0.3, 0.6), (0.0, 0.0, 0.0))
    assert balls.largest_ball(labels, np.zeros(3), 1, 2.0).inner == pytest.approx(0.3, rel=1e-4)
    alone = half_plane((1.0,), 0.25)
    assert balls.largest_ball(alone, np.zeros(1), 1, 2.0).inner == pytest.approx(0.25, abs=1e-12)


def test_a_ball_without_a_foreign_start_is_open() -> None:
    ball = balls.largest_ball(lambda points: np.ones(len(points), int), np.zeros(2), 1, 2.0)
    assert ball.inner == 2.0 and np.isinf(ball.outer)


def test_a_barrier_is_no_boundary_of_a_ball() -> None:
    def labels(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] > 0.1, -1, np.where(points[:, 1] > 0.5, 2, 1))

    assert balls.largest_ball(labels, np.zeros(2), 1, 2.0).inner == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize(
    ("labels", "radius"), [(annulus(0.4, 1.0), 0.3), (ellipse((0.7, 0.3)), 0.3)], ids=["annulus", "ellipse"]
)
def test_the_largest_inscribed_ball(labels, radius) -> None:
    grid, axes = grid_of(labels, WIDE.lower, WIDE.upper, 81)
    ball, bound = balls.inscribed_ball(labels, grid, axes, 1, WIDE)
    assert ball.inner == pytest.approx(radius, abs=2e-6)
    assert radius <= bound < radius + 0.04


def test_the_window_and_a_square_hole_bound_an_inscribed_ball() -> None:
    def hole(points: np.ndarray) -> np.ndarray:
        return np.where(np.abs(points).max(axis=1) < 0.5, 1, 2)

    grid, axes = grid_of(hole, WIDE.lower, WIDE.upper, 82)
    assert balls.inscribed_ball(hole, grid, axes, 1, WIDE)[0].inner == pytest.approx(0.5, abs=1e-6)
    everything = half_plane((1.0, 0.0), 9.0)
    grid, axes = grid_of(everything, WIDE.lower, WIDE.upper, 11)
    ball, _ = balls.inscribed_ball(everything, grid, axes, 1, WIDE)
    assert ball.inner == pytest.approx(1.2, abs=1e-9) and np.isinf(ball.outer)


def test_the_distances_of_a_map_go_round_an_angle() -> None:
    turning = Region.of((0.0, 0.0), (2 * np.pi, 1.0), (2 * np.pi, np.inf))
    axes = [np.linspace(0, 2 * np.pi, 41), np.linspace(0, 1, 11)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    labels = np.where(points[:, 0] > 6.0, 2, 1)
    nearest = balls.nearest_of_map(points, labels, np.array([0.1, 0.5]), 1, turning)
    assert np.linalg.norm(nearest - [0.1, 0.5]) < 0.2


def test_a_share_is_that_of_the_area() -> None:
    labels, area = ellipse((0.7, 0.3)), np.pi * 0.21
    grid, axes = grid_of(labels, WIDE.lower, WIDE.upper, 61)
    share = areas.global_share(labels, grid, axes, 1, 20000)
    assert share.lower < area / 2.4**2 < share.upper and share.upper - share.lower < 2e-3
    alone = areas.global_share(None, grid, axes, 1, 0)
    assert alone.lower < area / 2.4**2 < alone.upper


def test_a_share_without_any_crossed_cell_is_not_beyond_doubt() -> None:
    """A basin smaller than a cell lies between the points: the interval of its share has a width."""
    labels, area = ellipse((0.02, 0.02)), np.pi * 0.02**2 / 2.4**2
    grid, axes = grid_of(labels, WIDE.lower, WIDE.upper, 20)
    share = areas.global_share(labels, grid, axes, 1, 2000)
    assert share.value == 0 and share.lower == 0 < area < share.upper < 0.02
    other = areas.global_share(labels, grid, axes, 2, 2000)
    assert other.lower < 1 - area < other.upper == other.value == 1


def test_the_interval_of_a_share_allows_for_what_a_coarse_grid_misses() -> None:
    """Discs smaller than the cells: their area lies within the interval on every grid, whose width falls."""
    random = np.random.default_rng(5)
    centres = np.empty((0, 2))
    while len(centres) < 60:
        one = random.uniform(-1.15, 1.15, 2)
        if np.linalg.norm(centres - one, axis=1).min(initial=1) > 0.1:
            centres = np.vstack([centres, one])

    def labels(points: np.ndarray) -> np.ndarray:
        near = np.linalg.norm(points[:, None] - centres, axis=2).min(axis=1)
        return np.where(near < 0.05, 1, 2)

    truth = len(centres) * np.pi * 0.05**2 / 2.4**2
    widths = []
    for count in (8, 9, 20, 60, 240):
        grid, axes = grid_of(labels, WIDE.lower, WIDE.upper, count)
        for starts in (0, 2000):
            share = areas.global_share(labels, grid, axes, 1, starts)
            assert share.lower < truth < share.upper
        widths.append(share.upper - share.lower)
    assert widths[-1] < 0.02 < widths[0]
    tiny, axes = grid_of(labels, WIDE.lower, WIDE.upper, 2)
    assert areas.global_share(None, tiny, axes, 2, 0).upper == 1


def test_the_interval_of_a_share_has_its_confidence() -> None:
    labels, area = ellipse((0.7, 0.3)), np.pi * 0.21 / 2.4**2
    inside = 0
    for seed in range(200):
        share, refused = areas.basin_stability(labels, 1, areas.uniform(WIDE), 500, seed)
        inside += share.lower <= area <= share.upper
        assert refused == 0
    assert inside >= stats.binom.ppf(1e-4, 200, 0.95)


def test_a_normal_density_and_draws_that_are_no_starts() -> None:
    def labels(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 1] > 0, -1, np.where(np.linalg.norm(points, axis=1) < 1, 1, 2))

    share, refused = areas.basin_stability(labels, 1, areas.normal(np.zeros(2), np.array([1.0, 1.0])), 40000)
    assert share.lower < 1 - np.exp(-0.5) < share.upper
    assert refused == pytest.approx(0.5, abs=0.02)


def test_labels_not_known_widen_the_interval() -> None:
    def labels(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] < 0.4, 1, np.where(points[:, 0] < 0.5, 0, 2))

    share, _ = areas.basin_stability(labels, 1, areas.uniform(UNIT), 10000)
    assert share.lower < 0.4 < 0.5 < share.upper
    assert share.not_known == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize(
    ("labels", "region", "exponent", "apart"),
    [
        (cantor, Region.of((0.0,), (1.0,)), 1 - np.log(2) / np.log(3), 0.005),
        (cantor, UNIT, 1 - np.log(2) / np.log(3), 0.005),
        (carpet, UNIT, 2 - np.log(8) / np.log(3), 0.005),
        (half_plane((0.6, 0.8), 0.7), UNIT, 1.0, 0.02),
    ],
    ids=["stripes on a line", "stripes", "carpet", "line"],
)
def test_uncertainty_exponents(labels, region, exponent, apart) -> None:
    found = uncertainty.uncertainty_exponent(labels, region, starts=4000, batches=16)
    assert found.value == pytest.approx(exponent, abs=apart)
    assert found.upper - found.lower < 0.03


@pytest.mark.parametrize(
    ("labels", "region", "low", "high"),
    [
        (newton, Region.of((-1, -1), (1, 1)), 0.55, 0.65),
        (grebogi, Region.of((0.0, -0.5), (2 * np.pi, 0.5)), 0.19, 0.30),
    ],
    ids=["newton", "grebogi"],
)
def test_uncertainty_exponents_of_peers(labels, region, low, high) -> None:
    """Newton's method d = 1.42; the map of Grebogi and others "about 0.2"."""
    found = uncertainty.uncertainty_exponent(labels, region, (1e-1, 1e-7), starts=400)
    assert found.lower < high and found.upper > low
    assert found.upper - found.lower < 0.05


def test_no_boundary_has_no_exponent() -> None:
    found = uncertainty.uncertainty_exponent(lambda points: np.ones(len(points), int), UNIT, starts=100)
    assert np.isnan(found.value)


def test_the_entropy_of_smooth_boundaries() -> None:
    """1/2, 0.43951, 0.39609 in one, two, three dimensions, as Attractors.jl has them; then by sampling."""
    assert [round(entropy.smooth_entropy(None, d), 5) for d in (1, 2, 3)] == [0.5, 0.43951, 0.39609]
    found = entropy.basin_entropy(half_plane((1.0, 0.1), 0.55), UNIT, 0.2, 12000, 500)
    assert found.boundary[0] - found.smooth == pytest.approx(0, abs=0.008)
    assert found.boundary[1] < found.smooth < found.boundary[2]
    assert entropy.smooth_entropy(20000, 2) == pytest.approx(0.43951, abs=0.002)


def test_square_boxes_are_biased() -> None:
    """What others count on grids: mean binary entropy of k/n for a boundary along the grid."""
    for n, expected in ((5, 0.58671), (10, 0.54576), (20, 0.52369), (40, 0.51211)):
        k = np.arange(1, n) / n
        assert np.mean(-k * np.log(k) - (1 - k) * np.log(1 - k)) == pytest.approx(expected, abs=1e-5)


def test_smooth_boundaries_are_called_rough_at_the_stated_level() -> None:
    random, false = np.random.default_rng(3), 0
    for seed in range(1000):
        if seed % 2:
            smooth = ellipse((random.uniform(0.3, 0.6),) * 2, tuple(random.uniform(-0.2, 0.2, 2)))
        else:
            smooth = half_plane((1.0, random.uniform(-0.4, 0.4)), random.uniform(-0.2, 0.2))
        found = entropy.basin_entropy(smooth, Region.of((-1, -1), (1, 1)), 0.05, 1000, 20, seed)
        false += found.probability < 0.05
    low, high = stats.binom.ppf([0.0005, 0.9995], 1000, 0.05)
    assert low <= false <= high


def test_a_fractal_boundary_is_called_rough() -> None:
    found = entropy.basin_entropy(carpet, UNIT, 0.02, 1000, 100)
    assert found.probability < 1e-6
    assert found.boundary[1] > found.smooth


@pytest.mark.parametrize("width", [0.002, 0.05, 0.3])
def test_labels_that_are_not_known_widen_the_entropy(width: float) -> None:
    """Discs on the boundary are left out first, so that the rest does not stand for all."""
    whole = half_plane((1.0, 0.1), 0.55)

    def labels(points: np.ndarray) -> np.ndarray:
        near = np.abs(points @ np.array([1.0, 0.1]) - 0.55) < width
        return np.where(near, 0, whole(points))

    truth = entropy.basin_entropy(whole, UNIT, 0.05, 2000, 100)
    found = entropy.basin_entropy(labels, UNIT, 0.05, 2000, 100)
    for measured, discs, right in (
        (found.all_discs, found.discs, truth.all_discs[0]),
        (found.boundary, found.mixed, truth.boundary[0]),
    ):
        _, low, high = found.bounds(measured, discs)
        assert 0 <= low < right < high <= np.log(3)
    assert found.unsure and not truth.unsure
    assert truth.bounds(truth.all_discs, truth.discs) == truth.all_discs


def test_the_slope_of_the_entropy_is_the_exponent() -> None:
    found = [entropy.basin_entropy(cantor, UNIT, 0.03 * 3.0**-k, 4000, 100) for k in range(5)]
    slope, low, high = entropy.exponent(found)
    assert slope == pytest.approx(0.36907, abs=0.05)
    assert low < slope < high


def test_merging_detects_shared_boundaries() -> None:
    """Stripes 1 2 3 1 2 3 ... share none of their boundaries farther than a stripe; three blocks do."""
    stripes = np.tile(np.repeat(np.tile([1, 2, 3], 10), 1), (30, 1))
    distances, shares = wada.merging(stripes)
    assert shares[1] == 0
    blocks = np.repeat([1, 2, 3], 20)[None, :] * np.ones((30, 1), int)
    distances, shares = wada.merging(blocks)
    assert shares[2] == 1 and distances[-1] >= 19
    assert wada.merging(np.where(blocks == 3, 1, blocks))[0].size == 0


def test_merging_of_an_angle_does_not_depend_on_where_it_is_cut() -> None:
    sectors = np.repeat(np.repeat([1, 2, 3], [25, 10, 25])[:, None], 8, axis=1)
    distances, shares = wada.merging(sectors, (True, False))
    for shift in (7, 20, 41):
        again = wada.merging(np.roll(sectors, shift, axis=0), (True, False))
        np.testing.assert_array_equal(again[0], distances)
        np.testing.assert_array_equal(again[1], shares)


def test_the_grid_method_finds_the_boundary_of_newtons_map() -> None:
    grid, axes = grid_of(newton, (-1.5, -1.5), (1.5, 1.5), 40)
    found = wada.grid_method(newton, grid, axes)
    assert found.shares[-1][0] > 0.95
    assert np.all(np.diff([share for share, _, _ in found.shares]) >= 0)


def test_cells_beside_starts_without_a_label_are_of_no_boundary() -> None:
    grid = np.array([[1, 1, 2], [1, 0, -1], [3, 0, 0]])
    assert areas.cells_of_two_basins(grid).tolist() == [[False, True], [True, False]]
    assert not areas.cells_of_two_basins(np.where(grid == 1, 1, 0)).any()


def test_three_smooth_basins_are_not_wada() -> None:
    def sectors(points: np.ndarray) -> np.ndarray:
        return 1 + (np.mod(np.arctan2(points[:, 1], points[:, 0]), 2 * np.pi) // (2 * np.pi / 3)).astype(int)

    grid, axes = grid_of(sectors, (-1, -1), (1, 1), 40)
    assert wada.grid_method(sectors, grid, axes).shares[-1][0] < 0.1


def test_times_are_conditional() -> None:
    """A linear decay: ln(r0/r)/rate, whose mean and quantiles are known."""
    random = np.random.default_rng(1)
    times = -np.log(random.uniform(0, 1, 20000))
    found = convergence.convergence_times(np.append(times, np.nan))
    assert found.count == 20000
    assert found.mean[1] < 1 < found.mean[2]
    for q, value, low, high in found.quantiles:
        assert low <= value <= high and low < -np.log(1 - q) < high


def test_a_tipping_matrix_is_one_for_equal_maps_and_its_rows_sum_to_one() -> None:
    random = np.random.default_rng(2)
    before, after = random.integers(0, 4, (50, 50)), random.integers(0, 3, (50, 50))
    assert np.array_equal(tipping.tipping_matrix(before, before).shares[:, :-1], np.eye(3))
    found = tipping.tipping_matrix(before, after)
    assert np.allclose(found.shares.sum(axis=1), 1)
    assert found.before == (1, 2, 3) and found.after == (1, 2)
    assert np.all((found.lower <= found.shares) & (found.shares <= found.upper))


def test_shares_of_nothing() -> None:
    assert share_interval(0, 0) == (0.0, 1.0)
    low, high = share_interval(0, 100)
    assert low == 0 and high == pytest.approx(1 - 0.025 ** (1 / 100))
