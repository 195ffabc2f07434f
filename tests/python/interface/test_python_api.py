# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Python computes what the program computes, to the bit, and reports what is wrong as it does."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import separatrix as sx
import xarray as xr
from program import CASE, succeed, write_case
from separatrix.labelling import axis_values

STACK = {"drive.ratio": (1.1, 1.3, 3), "x0": (0, 1.1, 7), "v0": (-6, 6, 11)}
# What a file states of how it was made, and what names an axis in the table of laws.
MADE = ("checksum",)


@pytest.fixture(autouse=True)
def tools(library: Path, separatrix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program and the library of the build that is tested."""
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))


@pytest.fixture
def case(tmp_path: Path) -> sx.Case:
    """The case of the end-to-end tests."""
    return sx.load(write_case(tmp_path))


def assert_same(one: xr.Dataset, other: xr.Dataset) -> None:
    """All variables with types, dimensions and bits, and their attributes."""
    assert set(one.variables) == set(other.variables)
    for name, variable in other.variables.items():
        mine = one[name]
        assert (mine.dims, mine.dtype) == (variable.dims, variable.dtype), name
        assert mine.values.tobytes() == variable.values.tobytes(), name
        attributes = {key: str(value) for key, value in variable.attrs.items() if key not in MADE}
        own = {key: str(value) for key, value in mine.attrs.items() if key not in MADE}
        if name == "drive_ratio":
            attributes.pop("long_name"), own.pop("long_name")
        assert own == attributes, name


def test_a_map_in_threads_is_that_of_the_program(results: dict[str, Path], case: sx.Case) -> None:
    assert_same(sx.basin(case, threads=3), sx.open_result(results["map"]))
    assert_same(sx.basin(case, STACK, threads=2), sx.open_result(results["stack"]))


@pytest.mark.parametrize("workers", [1, 3])
def test_a_map_in_processes_is_that_of_the_program(
    results: dict[str, Path], case: sx.Case, tmp_path: Path, workers: int
) -> None:
    """Shares, joined, have the bits of one run, and leave nothing behind."""
    output = tmp_path / "map.h5"
    mine = sx.basin(case.with_(grid__tile=[4, 5]), output=output, workers=workers)
    assert_same(mine, sx.open_result(results["map"]))
    assert {path.name for path in tmp_path.iterdir()} <= {"case.toml", "map.h5", "map.h5.part.lock"}


def test_a_map_over_ranks_is_that_of_one(
    results: dict[str, Path], case: sx.Case, mpi_separatrix: Path
) -> None:
    assert_same(sx.basin(case, ranks=2), sx.open_result(results["map"]))


def test_what_the_library_does_not_label_comes_from_the_program(
    results: dict[str, Path], case: sx.Case
) -> None:
    """A map over parameters alone, and a refined one."""
    plane = {"drive.ratio": (0.8, 1.3, 13), "friction.kinetic_coefficient": (0.1, 0.3, 9)}
    result = sx.basin(case, {**plane, "x0": None, "v0": None})
    assert_same(result, sx.open_result(results["plane"]))
    refined = sx.basin(case.with_({"refine.step": 4, "refine.block": 8}))
    assert_same(refined, sx.open_result(results["refined"]))


def test_a_sweep_is_that_of_the_program(results: dict[str, Path], case: sx.Case) -> None:
    assert_same(sx.sweep(case), sx.open_result(results["sweep"]))
    other = sx.sweep(case, "friction.kinetic_coefficient", [0.1, 0.2], directions="up", starts=(0, 0))
    assert other["friction_kinetic_coefficient"].values.tolist() == [0.1, 0.2]
    with pytest.raises(sx.CaseError, match="values are missing"):
        sx.sweep(case, "contact.restitution")


def test_points_are_those_of_the_program(results: dict[str, Path], case: sx.Case, tmp_path: Path) -> None:
    listed = np.genfromtxt(results["points"].parent / "starts.csv", delimiter=",", names=True)
    starts = {name: listed[name] for name in ("x0", "v0", "ratio")}
    theirs = sx.open_result(results["points"])
    for workers in (1, 2):
        assert_same(sx.points(case, starts, workers=workers), theirs)
    assert_same(sx.points(case, xr.Dataset({k: ("n", v) for k, v in starts.items()})), theirs)
    assert sx.points(case, x0=[0.1, 0.2], v0=1.0)["v0"].values.tolist() == [1.0, 1.0]
    for wrong in ({"x0": [0.1]}, {"x0": [0.1], "v0": [1.0], "speed": [1.0]}, np.zeros((3, 4))):
        with pytest.raises(sx.SeparatrixError, match="starts: found"):
            sx.points(case, wrong)


def test_columns_of_a_table_of_starts_count_or_are_named(case: sx.Case) -> None:
    class Table(dict):
        """What a DataFrame is to `points`."""

        to_dict = dict.copy

    starts = {"x0": [0.1, 0.2], "v0": [0.0, 1.0]}
    for name in ("drive.ratio", "drive_ratio", "ratio"):
        assert sx.points(case, Table(starts | {name: [0.5, 0.55]}))["ratio"].values.tolist() == [0.5, 0.55]
    with pytest.raises(sx.SeparatrixError, match="found two columns of the drive ratio"):
        sx.points(case, Table(starts | {"ratio": [1, 1], "drive.ratio": [1, 1]}))
    with pytest.warns(sx.SeparatrixWarning, match="the columns crank_angle, note are not used"):
        sx.points(case, Table(starts | {"crank_angle": [0.0, 1.0], "note": ["a", "b"]}))


def test_wrong_arguments_are_refused_in_one_line(case: sx.Case, results: dict[str, Path]) -> None:
    wrong = (
        (lambda: sx.load(None), "load: found None"),
        (
            lambda: sx.points(case, x0=[1.0, 2.0], v0=[1.0, 2.0, 3.0]),
            "found x0 2, v0 3 values, allowed equally",
        ),
        (lambda: sx.trajectory(case, samples="x"), "samples: found 'x', allowed a number"),
        (lambda: sx.open_result(results["points"]).separatrix.plot(units=None), "units: found None"),
    )
    for call, message in wrong:
        with pytest.raises(sx.SeparatrixError, match=message) as caught:
            call()
        assert "\n" not in str(caught.value)
    assert case.with_({"drive.ratio": np.array(1.3)}).resolved["drive"]["ratio"] == 1.3
    assert sx.open_result(results["points"]).separatrix.plot(units="mm").separatrix_caption


@pytest.mark.parametrize(
    "name",
    ["trajectory_coulomb_1.05", "pair_backlash", "contact_hunt_crossley", "pair_platform", "whole periods"],
)
def test_a_trajectory_is_that_of_the_program(
    name: str, source_dir: Path, separatrix: Path, tmp_path: Path
) -> None:
    path = source_dir / "examples" / f"{name}.toml"
    if name == "whole periods":
        path = write_case(tmp_path)
    succeed(separatrix, "trajectory", path, "-o", "motion.h5", folder=tmp_path)
    theirs, mine = sx.open_result(tmp_path / "motion.h5"), sx.trajectory(path)
    assert_same(mine, theirs)
    left_out = ("Conventions", "case_text", "date_created", "history", "references")
    # counts and peaks that only the program takes
    left_out += ("impacts", "contact_work", "peak_force", "peak_penetration")
    for key, value in theirs.attrs.items():
        if key not in left_out and not key.startswith("provenance_"):
            assert mine.attrs[key] == value, key


def test_a_trajectory_takes_what_is_given_and_the_rest_from_the_case(case: sx.Case) -> None:
    motion = sx.trajectory(case, x0=0.2, duration=2.0, samples=10)
    assert (float(motion.x[0]), float(motion.v[0])) == (0.2, 0.0)
    assert float(motion.time[-1]) == pytest.approx(2.0, abs=motion.attrs["drive_period"] / 10)
    for wrong in ({"duration": -1.0}, {"samples": 1}, {"x0": 2.0}, {"x0": float("nan")}):
        with pytest.raises(sx.SeparatrixError):
            sx.trajectory(case, **wrong)


def test_cases_are_changed_by_the_rules_of_the_program(case: sx.Case) -> None:
    other = case.with_(
        {"contact.restitution": 0.8}, drive__ratio=1.3, start__x0="400 mm"
    )  # fmt: skip
    assert other.parameters["contact.restitution"].value == 0.8
    assert other.resolved["drive"]["ratio"] == 1.3
    assert case.parameters["contact.restitution"].value == 0.5
    assert case.with_(friction={"law": "viscous", "damping": 0.2}).resolved["friction"] == {
        "law": "viscous", "damping": 0.2,
    }  # fmt: skip
    assert case == sx.load(case.name) == sx.Case.from_text(CASE) == sx.Case.from_dict(case.resolved)
    assert case == case.with_(drive__ratio=1.2)
    assert len({case, case.with_(drive__ratio=1.2), other}) == 2
    assert "contact.restitution=0.8" in repr(other)


def test_values_have_units_wherever_a_case_has_them(case: sx.Case) -> None:
    """A text with a unit is the number in SI units; what is neither is one line."""
    assert sx.trajectory(case, "-3 mm", v0=0.5, duration="2 s", samples=4).equals(
        sx.trajectory(case, -0.003, v0=0.5, duration=2.0, samples=4)
    )
    assert sx.points(case, x0=["-3 mm", 0.1], v0=0).x0.values.tolist() == [-0.003, 0.1]
    few = sx.basin(case, x0=("-30 mm", "30 mm", 3), v0=["-1 cm/s", 0.5], progress=False)
    assert few.x0.values.tolist() == [-0.03, 0.0, 0.03]
    assert few.v0.values.tolist() == [-0.01, 0.5]
    assert sx.basin(case, x0=2, v0="5 mm/s", progress=False).v0.values.tolist() == [0.005]
    assert case.in_si("start.crank_angle", "180 deg") == pytest.approx(np.pi)
    assert str(sx.stability(case, "-3 mm", periods=64)) == str(sx.stability(case, -0.003, periods=64))
    calls = (
        lambda value: sx.trajectory(case, value),
        lambda value: sx.trajectory(case, duration=value),
        lambda value: sx.stability(case, value),
        lambda value: sx.points(case, x0=[value], v0=[0.0]),
        lambda value: sx.basin(case, x0=(value, 1.0, 3)),
        lambda value: sx.sweep(case, "drive.ratio", (value, 2.0, 3)),
        lambda value: sx.branches(case, "drive.ratio", value, 2.0),
    )
    for call in calls:
        for value in ("3 mg", "three", {}):
            with pytest.raises(sx.CaseError) as refused:
                call(value)
            assert "found" in str(refused.value)
            assert "\n" not in str(refused.value)


def test_errors_are_those_of_the_program(case: sx.Case, tmp_path: Path) -> None:
    """File, line, key, found, allowed; all problems at once; nothing of the command line."""
    bad = tmp_path / "bad.toml"
    bad.write_text(CASE.replace("restitution = 0.5", "restitutoin = 0.5").replace("mass = 1.0", "mass = -1"))
    with pytest.raises(sx.CaseError) as caught:
        sx.load(bad)
    assert caught.value.code == 65
    assert f"{bad}:3: key 'body.mass': found -1" in str(caught.value)
    assert "did you mean 'restitution'?" in str(caught.value)
    with pytest.raises(
        sx.CaseError, match=r"^contact\.restitution=1\.5: key .*found 1\.5, allowed from 0\.0 to 1"
    ):
        case.with_(contact__restitution=1.5)
    with pytest.raises(sx.CaseError, match=r"case\.toml: axis 'x0': found x0 = 2\.0 m, allowed at most"):
        sx.basin(case, x0=(0, 2, 3))
    with pytest.raises(sx.CaseError, match=r"axis 'contact\.restitutoin'"):
        sx.basin(case, contact__restitutoin=[0.1, 0.2])
    with pytest.raises(sx.CaseError, match="found 1 axes, allowed two or more"):
        sx.basin(case, x0=None)
    with pytest.raises(sx.CaseError, match="cannot be read"):
        sx.load(tmp_path / "none.toml")
    with pytest.raises(sx.CaseError, match="found a count alone"):
        sx.basin(case, crank_angle=7)


def test_nothing_is_overwritten_unasked(case: sx.Case, tmp_path: Path) -> None:
    output = tmp_path / "map.h5"
    output.write_text("mine")
    with pytest.raises(sx.SeparatrixError, match="exists; overwrite=True") as caught:
        sx.basin(case, output=output)
    assert caught.value.code == 73
    assert output.read_text() == "mine"
    for workers in (1, 2):
        assert sx.basin(case, output=output, overwrite=True, workers=workers).sizes["x0"] == 19


def test_who_computes_is_chosen_once(case: sx.Case) -> None:
    for wrong in (
        {"threads": 2, "workers": 2}, {"workers": 2, "ranks": 2}, {"workers": 0}, {"threads": 0},
        {"ranks": 0}, {"threads": 2, "output": "map.h5"},
    ):  # fmt: skip
        with pytest.raises(sx.SeparatrixError, match=r"allowed|choose one"):
            sx.basin(case, **wrong)


def test_long_lists_of_values_reach_the_program(case: sx.Case, separatrix: Path) -> None:
    """The program cuts an override of more than 4096 characters."""
    values = np.sort(np.random.default_rng(3).uniform(0, 1.1, 500))
    quick = case.with_(attractors__sample=2)
    result = sx.basin(quick, x0=values, v0=[0.0], workers=1)
    assert result["x0"].values.tobytes() == values.tobytes()
    assert_same(sx.basin(quick, x0=values, v0=[0.0]), result)


def test_axes_have_the_bits_of_the_program(case: sx.Case) -> None:
    for first, last, count in ((-0.3, 0.7, 101), (0.0, 1.0, 2), (1 / 3, 2 / 3, 13)):
        axes = {"x0": sx.linspace(first, last, count), "v0": [0.0]}
        theirs = sx.basin(case.with_(attractors__sample=1), axes, workers=1)["x0"].values
        mine = axis_values({"from": first, "to": last, "count": count})
        assert mine.tobytes() == theirs.tobytes()


def test_progress_is_reported(case: sx.Case) -> None:
    reported: list[tuple] = []
    sx.basin(case, x0=60, v0=60, progress=lambda *what: reported.append(what))
    assert reported[-1] == ("points", 3600, 3600)
    assert [done for _, done, _ in reported] == sorted(done for _, done, _ in reported)
    silent = sx.basin(case, progress=False)
    assert silent.sizes["x0"] == 19


def test_warnings_of_the_program_are_warnings(source_dir: Path) -> None:
    case = sx.load(source_dir / "examples" / "hammer.toml")
    with pytest.warns(sx.SeparatrixWarning, match="no attractors are looked for"):
        sx.basin(case, {"contact.restitution": [0.4, 0.5], "body.friction": [0.1, 0.2]}, v0=None, x0=None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sx.basin(sx.Case.from_text(CASE))


STOPPED = """\
import sys
import separatrix as sx

case = sx.load(sys.argv[1]).with_(run__duration=20000.0, attractors__sample=4, run__stop="duration")
options = eval(sys.argv[2])
noted = open(sys.argv[3], "w")

def note(things, done, total):
    if things == "points" and done:
        print(done, file=noted, flush=True)

try:
    result = sx.basin(case, x0=(0, 1.1, 40), v0=(-6, 6, 40), progress=note, **options)
    print("whole")
except sx.Interrupted as stop:
    assert isinstance(stop, KeyboardInterrupt) and 0 <= stop.done < 1, stop.done
    print("stopped", stop)
    result = stop.resume()
result.attrs = {}
result.to_netcdf(sys.argv[4], engine="h5netcdf")
"""


@pytest.mark.parametrize(
    "options",
    [
        pytest.param("{'threads': 2}", marks=pytest.mark.long),
        pytest.param("{'workers': 1}", marks=pytest.mark.long),
        "{'workers': 2}",
    ],
)
def test_an_interrupt_stops_and_resume_goes_on(case: sx.Case, tmp_path: Path, options: str) -> None:
    """Ctrl-C as a terminal sends it; the resumed result is that of a run that was not stopped."""
    script = tmp_path / "stopped.py"
    script.write_text(STOPPED)
    noted = tmp_path / "noted"
    files = [tmp_path / "stopped.nc", tmp_path / "whole.nc"]
    command = [sys.executable, script, case.name, options, noted]
    child = subprocess.Popen([*command, files[0]], stdout=subprocess.PIPE, text=True, process_group=0)
    last = time.monotonic() + 60
    while not (noted.exists() and noted.read_text()) and child.poll() is None and time.monotonic() < last:
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):  # done already
        os.killpg(child.pid, signal.SIGINT)
    out = child.communicate(timeout=120)[0]
    assert child.returncode == 0
    if out.startswith("whole"):
        pytest.skip("was done before the interrupt came")
    assert "stopped at" in out
    subprocess.run([*command, files[1]], check=True, capture_output=True, timeout=120)
    one, other = (xr.load_dataset(path, engine="h5netcdf") for path in files)
    assert_same(one, other)


def test_a_run_that_was_stopped_goes_on_in_its_file(case: sx.Case, tmp_path: Path) -> None:
    """What a time limit leaves is taken up with resume=True."""
    slow = case.with_(run__duration=20000.0, attractors__sample=4, run__stop="duration")
    output = tmp_path / "map.h5"
    with pytest.raises(sx.Interrupted, match="resume=True"):
        sx.basin(slow, x0=(0, 1.1, 40), v0=(-6, 6, 40), output=output, workers=1, time_limit=0.4)
    assert not output.exists()
    result = sx.basin(slow, x0=(0, 1.1, 40), v0=(-6, 6, 40), output=output, workers=1, resume=True)
    assert result.sizes["x0"] == 40


def test_the_accessor_knows_the_result(results: dict[str, Path], case: sx.Case) -> None:
    result = sx.open_result(results["map"])
    table = result.separatrix.attractors
    assert table["share"].sum() == pytest.approx((result["attractor"] > 0).mean())
    assert set(table["regime"]) <= {"impact", "non_impact"}
    assert result.separatrix.shares("regime").sum() == pytest.approx(1.0)
    assert result.separatrix.case == case
    motion = result.separatrix.trajectory(0.2, 1.0, duration=3.0, drive__ratio=1.1)
    assert_same(motion, sx.trajectory(case.with_(drive__ratio=1.1), 0.2, 1.0, duration=3.0))
    with pytest.raises(sx.SeparatrixError, match="is a trajectory, not a basin"):
        _ = motion.separatrix.attractors
    with pytest.raises(sx.SeparatrixError, match="is no result"):
        xr.Dataset().separatrix.plot()


@pytest.mark.long
def test_results_draw_the_figures_of_the_command(
    results: dict[str, Path], case: sx.Case, tmp_path: Path
) -> None:
    """From memory as from the file, to the pixel."""
    from separatrix import cli

    assert cli.main([str(results["map"]), "-o", str(tmp_path), "--formats", "png", "--dpi", "100"]) == 0
    opened = sx.open_result(results["map"])
    opened.separatrix.save(tmp_path / "mine", "regime", formats=["png"], dpi=100)
    assert (tmp_path / "mine.png").read_bytes() == (tmp_path / "map_regime.png").read_bytes()
    for kind, names in {"sweep": ("amplitude", "bifurcation"), "points": ("regime",)}.items():
        for name in names:
            assert sx.open_result(results[kind]).separatrix.plot(name) is not None
    motion = sx.trajectory(case)
    assert motion.separatrix.plot("phase")._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(sx.SeparatrixError, match="no figure 'fase'; there are"):
        motion.separatrix.plot("fase")


def test_the_code_of_the_guide_runs(
    source_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every Python block of docs/python.md, one after the other, and the output that it states."""
    guide = (source_dir / "docs" / "python.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", guide, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 4
    (tmp_path / "examples").symlink_to(source_dir / "examples")
    monkeypatch.chdir(tmp_path)
    printed: list[str] = []
    names = {"print": lambda *what: printed.append(" ".join(map(str, what)))}
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), names)
    assert printed == re.findall(r"print\(error\) +# (.*)", guide)
    assert (tmp_path / "bifurcation.png").stat().st_size > 10_000


def test_several_bodies_with_and_without_a_drive(source_dir: Path, separatrix: Path, library: Path) -> None:
    """A belt drives without a period; maps of several bodies are those of the program."""
    belt = sx.trajectory(source_dir / "examples" / "structure_blocks_on_a_belt.toml", duration=20.0)
    assert belt.attrs["drive_ratio"] == 0.0 and (belt.event_kind == 3).any()
    case = sx.load(source_dir / "examples" / "structure_two_masses.toml").with_(
        {"run.duration": 100.0, "attractors.sample": 8}
    )
    found = sx.basin(case, x0=(-1.0, 1.0, 3), v0=(-1.0, 1.0, 3), progress=False)
    assert found.regime.shape == (3, 3)
