# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of maps of machines: `sx.measures`, `sx.measures_along`, `sx.tipping`, the command."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import separatrix as sx
from separatrix.measuring.api import _OVER_PHASES, NAMES, _chosen
from separatrix.measuring.cli import main
from separatrix.measuring.maps import slice_of


@pytest.fixture(autouse=True)
def tools(library: Path, separatrix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program and the library of the build that is tested."""
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))


@pytest.fixture(scope="module")
def case(source_dir: Path) -> sx.Case:
    return sx.load(source_dir / "examples" / "basin_coulomb.toml")


@pytest.fixture
def crank(case: sx.Case, library: Path):
    """The crank-driven mass: two basins."""
    return sx.basin(case, x0=60, v0=60)


def test_the_integrity_of_the_crank_driven_mass(crank) -> None:
    found = sx.measures(crank, ["global_integrity", "local_integrity", "integrity_factor"], starts=2000)
    shares = [found["global_integrity", number] for number in (1, 2)]
    assert sum(one.value for one in shares) == pytest.approx(1, abs=1e-9)
    assert all(one.lower <= one.value <= one.upper for one in shares)
    local, factor = found["local_integrity", 1], found["integrity_factor", 1]
    assert local.value == pytest.approx(0.197004, abs=1e-6)
    assert local.upper - local.lower < 1e-9
    assert local.value < factor.value <= factor.upper
    assert "9.42477" in str(found) and "limited:" in str(found)


def test_the_nearest_foreign_start_is_one(crank) -> None:
    """It goes to the other motion, and a start a little nearer to its own; by maps of one point."""
    one = sx.measures(crank, "local_integrity", attractors=1)[0]
    x, v = one.details["nearest_foreign_start"]
    (cx, cv), radius = one.details["centre"], one.value
    assert np.hypot(x - cx, (v - cv) / (3 * np.pi)) == pytest.approx(radius, rel=1e-9)
    near = [cx + (x - cx) * (1 - 1e-7), cv + (v - cv) * (1 - 1e-7)]
    case = crank.separatrix.case
    regimes = [sx.basin(case, x0=[a], v0=[b]).separatrix.decoded("regime").item() for a, b in ((x, v), near)]
    assert regimes == ["impact", "non_impact"]


@pytest.mark.long
def test_results_do_not_depend_on_threads(crank) -> None:
    names = ["global_integrity", "basin_stability", "basin_entropy", "convergence_time"]
    one, other = (sx.measures(crank, names, threads=threads, starts=500) for threads in (1, 3))
    assert [item.as_dict() for item in one] == [item.as_dict() for item in other]


def test_bounds_from_the_map_alone_hold_values_of_new_starts(crank) -> None:
    names = ["global_integrity", "integrity_factor", "local_integrity", "basin_stability"]
    rough, fine = sx.measures(crank, names, new_starts=False), sx.measures(crank, names, starts=2000)
    for name in names[:2]:
        for number in (1, 2):
            assert rough[name, number].lower <= fine[name, number].value <= rough[name, number].upper
    assert not rough["local_integrity", 1].known and not rough["basin_stability", 1].known
    assert "needs" in rough["local_integrity", 1].limits[-1]


def test_measures_over_phases(crank) -> None:
    found = sx.measures(crank, ["local_integrity_over_phases", "critical_impulse"], attractors=1, phases=4)
    ball, impulse = found
    fixed = sx.measures(crank, "local_integrity", attractors=1)[0]
    assert ball.value <= fixed.value
    assert ball.details["radius"][0] == pytest.approx(fixed.value, rel=1e-6)
    # an impulse leaves the ball before it leaves the basin: in the same units
    assert impulse.value >= ball.value * 3 * np.pi * (1 - 1e-9)
    assert len(impulse.details["up"]) == 4


@pytest.mark.long
def test_the_safe_basin_lies_in_the_basin(case) -> None:
    coarse = sx.basin(case, x0=16, v0=16)
    found = sx.measures(coarse, ["safe_basin", "global_integrity"], attractors=2, phases=4, starts=400)
    safe, factor, whole = found
    assert 0 < safe.value < whole.value
    assert max(safe.details["share_at_each"]) > safe.value
    assert factor.value > 0


def test_measures_are_refused_with_words(crank, tmp_path: Path) -> None:
    for wrong, message in (
        ({"names": "gim"}, "found 'gim', allowed all, global_integrity"),
        ({"attractors": 7}, "attractors: found 7, allowed 1, 2"),
        ({"phases": 1}, "phases: found 1, allowed 2 or more"),
        ({"slice": {"drive.ratio": 1.0}}, "slice: found drive.ratio, allowed x0, v0"),
        ({"frequency": -1.0}, "frequency: found -1.0, allowed > 0"),
        ({"deviation": {"x0": 1.0}, "names": "basin_stability"}, "deviation: found x0, allowed x0 and v0"),
    ):
        with pytest.raises(sx.SeparatrixError, match=message):
            sx.measures(crank, **wrong)
    with pytest.raises(sx.SeparatrixError, match="no such file"):
        sx.measures(tmp_path / "none.h5")


def test_a_map_along_a_line_has_no_areas(case) -> None:
    with pytest.raises(sx.SeparatrixError, match="axis x0 of the map has one value"):
        sx.measures(sx.basin(case, x0=[0.2], v0=12), ["global_integrity"])


@pytest.mark.parametrize("asked", ["all", ["all"]])
def test_all_measures_can_be_asked_for(asked) -> None:
    assert _chosen(asked, None) == NAMES


def test_a_window_without_boundary(case) -> None:
    inside = sx.basin(case, x0=(0.3, 0.36, 6), v0=(-3.1, -2.9, 6))
    names = [name for name in NAMES if name not in _OVER_PHASES]
    found = sx.measures(inside, names, starts=200)
    (label,) = np.unique(inside["attractor"])
    assert found["global_integrity", int(label)].value == 1
    assert not found["uncertainty_exponent"].known
    assert not found["wada_grid"].known
    assert "not known" in str(found)


def test_starts_drawn_at_random_have_shares(source_dir: Path) -> None:
    text = (source_dir / "examples" / "basin_coulomb.toml").read_text()
    text = text[: text.index("# The paper does not print the ranges")] + (
        '[[sample]]\nname = "x0"\nfrom = 0\nto = 1.1\n[[sample]]\nname = "v0"\nfrom = -6\nto = 6\n'
        "[grid]\nsamples = 300\n"
    )
    result = sx.basin(sx.Case.from_text(text))
    found = sx.measures(result)
    assert sum(one.value for one in found) == pytest.approx(1)
    one = found["basin_stability", 1]
    assert abs(one.value - 0.3395) < 4 * np.sqrt(0.3395 * 0.6605 / 300)
    assert one.lower < one.value < one.upper


def test_measures_along_a_parameter_go_on(case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shares over the drive ratio; stopped after two values, the rest gives the same bits."""
    where = {"axes": {"x0": 20, "v0": 20}, "starts": 200, "names": ["global_integrity", "local_integrity"]}
    whole = sx.measures_along(case, "drive.ratio", [0.9, 1.2, 1.3, 1.4], **where)
    assert whole["exists"].shape == (4, whole.sizes["basin"])
    assert np.nansum(whole["global_integrity"].values, axis=1) == pytest.approx(np.ones(4), abs=1e-9)
    # the impacting motion ends at 1.3416
    ends = whole["global_integrity"].sel(basin=1).values
    assert ends[-1] == 1 or np.isnan(whole["global_integrity"].values[-1]).any()
    output = tmp_path / "along.h5"

    def stop(things: str, done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sx.measures_along(case, "drive.ratio", [0.9, 1.2, 1.3, 1.4], output=output, progress=stop, **where)
    assert not output.exists()
    kept = sx.measures_along(case, "drive.ratio", [0.9, 1.2, 1.3, 1.4], output=output, resume=True, **where)
    assert kept.separatrix.kind == "measures"
    for name in whole.data_vars:
        assert np.array_equal(kept[name].values, whole[name].values, equal_nan=True)
    assert [path.name for path in tmp_path.iterdir()] == ["along.h5"]
    assert kept.separatrix.plot() is not None
    with pytest.raises(sx.SeparatrixError, match="exists; overwrite=True"):
        sx.measures_along(case, "drive.ratio", [1.2], output=output, **where)
    kept.close()


def test_an_attractor_that_is_not_there_has_no_numbers(case) -> None:
    where = {"axes": {"x0": 12, "v0": 12}, "new_starts": False, "progress": False}
    found = sx.measures_along(case, "drive.ratio", [1.2, 1.4], attractors=2, **where)
    shares = found["global_integrity"].sel(basin=2).values
    assert 0 < shares[0] < 1
    assert np.isnan(shares[1])
    with pytest.raises(sx.SeparatrixError, match="attractors: found 9"):
        sx.measures_along(case, "drive.ratio", [1.2], attractors=9, **where)


def test_shares_of_random_starts_along_a_parameter_are_those_of_each_value(source_dir: Path) -> None:
    text = (source_dir / "examples" / "basin_coulomb.toml").read_text()
    sample = (
        '[[sample]]\nname = "x0"\nfrom = 0\nto = 1.1\n[[sample]]\nname = "v0"\nfrom = -6\nto = 6\n'
        '[grid]\nsamples = 60\n[[axis]]\nname = "drive.ratio"\nvalues = [0.9, 1.2, 1.4]\n'
    )
    head = text[: text.index("[[axis]]")]
    result = sx.basin(sx.Case.from_text(head + sample), progress=False)
    found = sx.measures_along(result, progress=False)["basin_stability"]
    for number, ratio in enumerate((0.9, 1.2, 1.4)):
        labels = result["attractor"].isel(drive_ratio=number).values
        for basin in found["basin"].values:
            share = found.isel(drive_ratio=number).sel(basin=basin).item()
            counted = np.mean(labels == basin)
            assert share == pytest.approx(counted) if counted else not share > 0, (ratio, basin)


def test_a_tipping_matrix_of_two_maps(crank, case) -> None:
    same = sx.tipping(crank, crank)
    assert np.array_equal(same.shares[:, :-1], np.eye(2))
    other = sx.basin(case.with_(drive__ratio=1.25), x0=60, v0=60)
    assert np.allclose(sx.tipping(crank, other).shares.sum(axis=1), 1)
    with pytest.raises(sx.SeparatrixError, match="not the same starts"):
        sx.tipping(crank, sx.basin(case, x0=10, v0=10))


def test_the_command(case, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = tmp_path / "map.h5"
    sx.basin(case, x0=20, v0=20, output=path).close()
    assert (
        main(
            [
                str(path),
                "--measures",
                "global_integrity,local_integrity",
                "--attractor",
                "1",
                "--starts",
                "200",
            ]
        )
        == 0
    )
    printed = capsys.readouterr().out
    assert (
        "local integrity of attractor 1" in printed and "limited:" in printed and "not known" not in printed
    )
    output = tmp_path / "out.json"
    asked = [str(path), "--measures", "global_integrity", "--starts", "200", "--json", "-o", str(output)]
    assert main(asked) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(output.read_text())
    assert main(asked) == 73
    assert main([str(path), str(path), "--tipping"]) == 0
    assert "before" in capsys.readouterr().out
    assert main([str(path), "--measures", "gim"]) == 64
    assert main([str(path), "--along"]) == 64
    assert main([str(tmp_path / "no.h5")]) == 66
    capsys.readouterr()


def test_the_scale_and_the_numbers_of_a_slice(case) -> None:
    """Of a map over a parameter: the labels are those of the map, the frequency that of the machine there."""
    result = sx.basin(case, {"restoring.stiffness": [80.0, 88.82643960980423]}, x0=20, v0=20)
    found = slice_of(result, {"restoring.stiffness": 80.0})
    assert found.scale[1] == pytest.approx(np.sqrt(80.0))
    assert np.array_equal(found.machine.labels(found.points).reshape(found.grid.shape), found.grid)
    with pytest.raises(sx.SeparatrixError, match="has 2 values of restoring_stiffness; choose one"):
        sx.measures(result)


def test_an_angle_goes_round(source_dir: Path) -> None:
    """A pendulum: no edge of the window at half a turn, and the same labels a turn on."""
    pendulum = sx.load(source_dir / "examples" / "basin_pendulum.toml")
    result = sx.basin(pendulum, x0=(-np.pi, 2.8, 18), v0=(-1.0, 1.0, 3))
    found = slice_of(result)
    assert np.isfinite(found.region.turns[0]) and found.unit == "rad"
    if found.machine is not None:
        here = np.array([[0.3, 0.2], [0.3 + 2 * np.pi, 0.2]])
        one, other = found.machine.labels(here)
        assert one == other


def test_the_command_is_installed(separatrix: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "separatrix.measuring.cli", "--version"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith("separatrix-measures ")


def test_rare_impulses_have_an_exponential_law_and_frequent_ones_do_worse(crank) -> None:
    rare = sx.survival(crank, 1, rate=0.02, deviation=1.0, motions=400, horizon=1000)
    assert rare["survival"].values[0] == 1
    # the law's band and the band of the motions meet at every time
    assert np.all(rare["survival_lower"] <= rare["law_upper"])
    assert np.all(rare["law_lower"] <= rare["survival_upper"])
    assert np.all(np.diff(rare["survival"].values) <= 0)
    often = sx.survival(crank, 1, rate=1.0, deviation=1.0, motions=400, horizon=20)
    # as many impulses, but they meet motions that have not settled
    assert often["survival_upper"].values[-1] < rare["survival"].values[-1]
    assert often.separatrix.plot() is not None
    with pytest.raises(sx.SeparatrixError, match="found attractor 9, allowed 1, 2"):
        sx.survival(crank, 9, rate=1.0, deviation=1.0)
    with pytest.raises(sx.SeparatrixError, match="rate > 0"):
        sx.survival(crank, 1, rate=0.0, deviation=1.0)


@pytest.mark.parametrize("horizon", [0.0, -1.0, np.inf, np.nan])
def test_survival_needs_a_duration(crank, horizon: float) -> None:
    with pytest.raises(sx.SeparatrixError, match="allowed a duration above 0"):
        sx.survival(crank, 2, rate=0.1, deviation=0.5, motions=20, horizon=horizon)


def test_survival_does_not_depend_on_threads(crank) -> None:
    one, other = (
        sx.survival(crank, 2, rate=0.5, deviation=2.0, motions=100, threads=threads) for threads in (1, 3)
    )
    assert np.array_equal(one["survival"].values, other["survival"].values)
