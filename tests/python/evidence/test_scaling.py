# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The model of the scheduler obeys the laws of any scheduler and hands out as the program does."""

import re
import subprocess

import numpy as np
import pytest
from program import KINDS, differences, run, succeed

SHAPES = [(1, 1, 50), (2, 1, 50), (5, 2, 333), (16, 4, 17), (64, 8, 1000), (300, 128, 5000), (7, 3, 3)]


@pytest.fixture(scope="module")
def scaling(source_dir, tmp_path_factory):
    """The modules of scripts/evidence/scaling_model, and the compiled model."""
    with pytest.MonkeyPatch.context() as patch:
        for folder in ("scripts/evidence", "scripts/evidence/scaling_model"):
            patch.syspath_prepend(str(source_dir / folder))
        import costs
        import model
    return model, costs, model.Model(tmp_path_factory.mktemp("model"))


@pytest.fixture(scope="module")
def pages(source_dir):
    """The modules that simulate whole jobs and write the page."""
    with pytest.MonkeyPatch.context() as patch:
        for folder in ("scripts/evidence", "scripts/evidence/scaling_model"):
            patch.syspath_prepend(str(source_dir / folder))
        import report
        import simulation
    return report, simulation


def uneven(count: int) -> np.ndarray:
    """Costs over three decades."""
    return 10 ** np.random.default_rng(1).uniform(-3, 0, count)


@pytest.mark.parametrize("option", ["--help", "--fast"])
def test_the_command_line(source_dir, option):
    result = subprocess.run([source_dir / "scripts/evidence/scaling", option], capture_output=True, text=True)
    assert (result.returncode, "--quick" in result.stdout) == (
        (0, True) if option == "--help" else (64, False)
    )
    assert (option in result.stderr) == (option == "--fast")


@pytest.mark.parametrize(("ranks", "per_node", "tiles"), SHAPES)
def test_work_is_conserved_and_nothing_beats_the_bounds(scaling, ranks, per_node, tiles):
    model, _, machine = scaling
    costs = uneven(tiles)
    found = machine.run(model.setting(ranks, per_node), costs)
    assert found.tiles.sum() == tiles
    assert found.busy.sum() == pytest.approx(costs.sum(), rel=1e-12)
    assert found.makespan >= max(costs.sum() / ranks, costs.max()) * (1 - 1e-12)
    assert found.efficiency <= 1 + 1e-12
    assert (found.finish >= found.busy * (1 - 1e-12)).all()


def test_one_rank_is_always_busy(scaling):
    model, _, machine = scaling
    found = machine.run(model.setting(1, 1), uneven(200))
    assert found.efficiency == pytest.approx(1, abs=1e-12)
    assert found.questions.sum() == 0


@pytest.mark.parametrize("ranks", [2, 10, 100])
def test_a_node_waits_at_most_for_one_tile(scaling, ranks):
    # R. L. Graham (1966): a list taken one by one
    model, _, machine = scaling
    costs = uneven(1000)
    found = machine.run(model.setting(ranks, ranks), costs)
    assert found.makespan <= costs.sum() / ranks + costs.max()
    assert found.questions.sum() == 0


def test_equal_tiles_are_shared_ideally(scaling):
    model, _, machine = scaling
    one_node = machine.run(model.setting(64, 64), np.ones(6400))
    assert one_node.efficiency == pytest.approx(1, abs=1e-12)
    eight_nodes = machine.run(model.setting(64, 8), np.ones(6400))
    assert eight_nodes.efficiency > 0.97


def test_every_other_node_asks_until_nothing_is_left(scaling):
    model, _, machine = scaling
    found = machine.run(model.setting(64, 8), uneven(2000))
    by_node = found.questions.reshape(8, 8).sum(axis=1)
    assert by_node[0] == 0
    assert (by_node[1:] >= 2).all()


def test_blocks_of_neighbours_lose_where_the_dear_lie_together(scaling):
    model, _, machine = scaling
    costs = np.ones(20000)
    costs[4000:6000] = 100
    spread = machine.run(model.setting(200, 20), costs)
    neighbours = machine.run(model.setting(200, 20), costs, spread=False)
    assert spread.efficiency > 0.9 > 0.6 > neighbours.efficiency


def test_a_rank_0_that_seldom_looks_delays_the_others(scaling):
    model, _, machine = scaling
    costs = uneven(20000)
    often, seldom = (machine.run(model.setting(200, 20, polls_per_tile=n), costs) for n in (1000, 1))
    assert seldom.makespan > often.makespan


def test_the_same_seed_gives_the_same(scaling):
    model, _, machine = scaling
    first, second = (machine.run(model.setting(64, 8), uneven(2000)) for _ in range(2))
    assert (first.finish == second.finish).all()


def test_costs_get_the_spread_and_keep_their_order_and_neighbours(scaling):
    _, costs, _ = scaling
    measured = uneven(100)
    for spread in (1, 10, 1000):
        tiles = costs.tiles_for(measured, 1000, spread, 0.25)
        assert costs.spread_of(tiles) == pytest.approx(spread)
        assert tiles.mean() == pytest.approx(0.25)
        assert (np.diff(tiles.reshape(100, 10)) == 0).all()
        if spread > 1:
            assert (np.argsort(tiles[::10]) == np.argsort(measured)).all()


def test_the_page_has_its_whole_jobs_at_the_top(source_dir, pages):
    report, _ = pages
    page = (source_dir / "docs/scaling.md").read_text()
    assert report.with_jobs_at_top(page) == page
    kept = report.read_jobs(page)
    assert len(kept.jobs[10_000]) == 8 and 0 < kept.start < kept.search


def test_whole_jobs_with_another_search(pages):
    _, simulation = pages
    work = 100 * 0.024
    jobs = {10_000: [work / (work + 3 + rest) for rest in range(8)]}
    changed = simulation.jobs_after(jobs, 0.024, 3, 1)
    assert changed[10_000][0] == pytest.approx(work / (work + 1))
    back = simulation.jobs_after(changed, 0.024, 1, 3)
    assert back[10_000] == pytest.approx(jobs[10_000])
    search = simulation.Search(41.0, 2.0, 41, 1024)
    assert simulation.Before(0.5, search, "").seconds == pytest.approx(0.5 + 100 + 2)


@pytest.mark.parametrize("count", [1, 2, 3, 10, 49, 64, 1000])
def test_the_order_meets_each_tile_once(scaling, count):
    assert sorted(scaling[0].handed_out(count)) == list(range(count))


def tile_times(path) -> np.ndarray:
    return np.genfromtxt(path, delimiter=",", names=True)


def test_the_model_hands_out_in_the_order_of_the_program(scaling, separatrix, results, tmp_path):
    command = [*KINDS["map"], "--set", "grid.tile=[2, 7]", "-o", tmp_path / "map.h5"]
    succeed(separatrix, *command, "--tile-times", tmp_path / "t.csv", folder=results["map"].parent)
    assert differences(results["map"], tmp_path / "map.h5") == []
    rows = tile_times(tmp_path / "t.csv")
    assert (rows["tile"][np.argsort(rows["begin"])] == 1 + scaling[0].handed_out(len(rows))).all()


@pytest.mark.parametrize(("kind", "ranks"), [("map", 3), ("sweep", 2), ("points", 2)])
def test_tile_times_have_every_tile_once(mpi_separatrix, results, tmp_path, kind, ranks):
    command = [*KINDS[kind], "-o", tmp_path / "out.h5", "--ranks-per-node", 1]
    if kind == "map":
        command += ["--set", "grid.tile=[2, 7]"]
    table = tmp_path / "t.csv"
    succeed(mpi_separatrix, *command, "--tile-times", table, folder=results[kind].parent, ranks=ranks)
    rows = tile_times(table)
    assert sorted(rows["tile"]) == list(range(1, len(rows) + 1))
    assert set(rows["rank"]) <= set(range(ranks))
    assert (rows["end"] >= rows["begin"]).all()
    assert ((rows["questions"] > 0) == (rows["rank"] > 0)).all()
    again = run(mpi_separatrix, *command, "--tile-times", table, folder=results[kind].parent, ranks=ranks)
    assert again.code == 73


@pytest.mark.parametrize(
    "words", [["trajectory", "case.toml"], ["basin", "case.toml", "-o", "t.csv"], ["basin", "t.csv"]]
)
def test_tile_times_of_no_tiles_or_over_another_file_are_refused(separatrix, results, words):
    outcome = run(separatrix, *words, "--tile-times", "t.csv", folder=results["map"].parent)
    assert outcome.code == 64
    assert "--tile-times" in outcome.err


@pytest.mark.parametrize(("points", "largest_tile"), [(400, 1024), (100_000, 32768)])
def test_the_list_of_tiles_is_bounded(separatrix, source_dir, tmp_path, points, largest_tile):
    axes = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={points}")]
    case = source_dir / "examples" / "basin_coulomb.toml"
    plan = run(separatrix, "basin", case, "--dry-run", *axes, folder=tmp_path).out
    tiles = int(re.search(r"points in (\d+) tiles", plan).group(1))
    assert points**2 / largest_tile <= tiles <= 2**20


def test_the_bare_scheduler_shares_all_tiles(build_dir, mpi_separatrix, tmp_path):
    program = build_dir / "bin" / "tests" / "scheduler_replay"
    if not program.is_file():
        pytest.skip(f"{program} has not been built")
    (tmp_path / "costs.txt").write_text("0.002\n" * 100)
    command = ["mpirun", "-n", "4", str(program), str(tmp_path / "costs.txt"), "2", "4"]
    text = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout
    rows = np.genfromtxt(text.splitlines(), delimiter=",", names=True)
    assert rows["tiles"].sum() == 100
    assert rows["busy"].sum() >= 0.2
    assert rows["questions"][:2].sum() == 0
    assert rows["questions"][2:].sum() > 0
