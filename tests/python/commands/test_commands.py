# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every command alone and under mpirun: what it prints, what it writes, how it ends."""

import csv
import json
import os
import re
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import KINDS, STARTS, Outcome, differences, listing, run, succeed, write_case

COMMANDS = ["basin", "sweep", "trajectory", "points", "laws", "info", "verify"]
OPTIONS = [
    "--output",
    "--set",
    "--validate",
    "--dry-run",
    "--force",
    "--resume",
    "--time-limit",
    "--json",
    "--quiet",
]
COLUMNS = ["x0", "v0", "ratio", "x", "v", "impacts", "last_impact_speed", "reason"]
KIND_OF = {"map": "basin", "stack": "basin", "plane": "basin", "refined": "basin"}


def program_without_mpirun(separatrix: Path, *arguments: str, folder: Path) -> Outcome:
    """Run the program where no mpirun and no MPI launcher can be found."""
    environment = {"PATH": "/nonexistent", "OPAL_PREFIX": "/nonexistent"}
    command = [separatrix, *arguments]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=30, env=environment)
    return Outcome(ended.returncode, ended.stdout, ended.stderr)


@pytest.mark.parametrize("command", ["", *COMMANDS])
@pytest.mark.parametrize("option", ["--help", "-h"])
def test_help(separatrix, tmp_path, command, option):
    arguments = [command] * bool(command) + [option]
    outcome = program_without_mpirun(separatrix, *arguments, folder=tmp_path)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith(f"separatrix {command}".rstrip())
    assert max(map(len, outcome.out.splitlines())) <= 120
    for word in COMMANDS if not command else []:
        assert f"  {word} " in outcome.out
    for word in OPTIONS if command in ("", *COMMANDS[:4]) else []:
        # a command lists what belongs to it, and nothing that it refuses
        belongs = not (command == "trajectory" and word in ("--resume", "--time-limit"))
        assert (word in outcome.out) == belongs
    for word in OPTIONS if command in COMMANDS[4:] else []:
        assert f"  {word}" not in outcome.out or word in ("--json", "--quiet")
    assert listing(tmp_path) == {}


def test_version(separatrix, tmp_path):
    outcome = program_without_mpirun(separatrix, "--version", folder=tmp_path)
    assert (outcome.code, outcome.err) == (0, "")
    fields = dict(line.split(" ", 1) for line in outcome.out.splitlines())
    assert list(fields) == ["separatrix", "commit", "compiler", "mpi", "hdf5", "flags"]
    assert re.fullmatch(r"\d+\.\d+\.\d+", fields["separatrix"])
    assert re.fullmatch(r"[0-9a-f]{12}(-dirty)?|unknown", fields["commit"])
    assert "-ffp-contract=off" in fields["flags"]
    assert "fast" not in fields["flags"]
    assert re.match(r"1\.\d+\.\d+", fields["hdf5"])


@pytest.mark.parametrize("option", ["--validate", "--dry-run"])
@pytest.mark.parametrize("kind", KINDS)
def test_validate_and_dry_run_need_no_mpirun_and_write_nothing(separatrix, tmp_path, kind, option):
    write_case(tmp_path)
    (tmp_path / "starts.csv").write_text(STARTS)
    before = listing(tmp_path)
    outcome = program_without_mpirun(separatrix, *KINDS[kind], option, folder=tmp_path)
    assert (outcome.code, outcome.err) == (0, "")
    if option == "--validate":
        assert "case.toml" in outcome.out
        assert "valid" in outcome.out
    elif kind != "trajectory":
        for word in ("points", "tiles", "while it runs", "core"):
            assert word in outcome.out
    assert listing(tmp_path) == before


@pytest.mark.parametrize(
    ("kind", "plan"),
    [("map", "19 x 31 = 589 points"), ("stack", "3 x 7 x 11 = 231 points"), ("sweep", "7 x 6 = 42 points")],
)
def test_a_dry_run_counts_the_points(separatrix, tmp_path, kind, plan):
    write_case(tmp_path)
    assert plan in succeed(separatrix, *KINDS[kind], "--dry-run", folder=tmp_path).out


@pytest.mark.parametrize("option", ["--validate", "--dry-run"])
def test_a_plan_takes_as_much_work_for_a_large_map(separatrix, build_dir, tmp_path, option):
    """Work is counted in allocations: the values of an axis are one, whatever their number."""
    counter = build_dir / "bin/tests/libcounted_allocations.so"
    if not counter.is_file():
        pytest.skip(f"{counter} has not been built")
    write_case(tmp_path)
    counts = []
    for values in (200, 200_000):
        axes = [part for axis in (1, 2) for part in ("--set", f"axis[{axis}].count={values}")]
        subprocess.run(
            [separatrix, *KINDS["map"], *axes, option],
            cwd=tmp_path,
            env={**os.environ, "LD_PRELOAD": str(counter), "ALLOCATIONS": "count"},
            capture_output=True,
            check=True,
        )
        counts.append(int((tmp_path / "count").read_text()))
    assert counts[1] < 1.5 * counts[0], counts


def test_a_dry_run_of_a_sweep_counts_all_that_is_written(separatrix, tmp_path):
    write_case(tmp_path)
    for way, directions, holds in (("both", "up and down", 14), ("down", "down", 7)):
        words = [*KINDS["sweep"], "--set", f"sweep.directions='{way}'", "--set", "sweep.starts=[0, 0]"]
        plan = succeed(separatrix, *words, "--dry-run", folder=tmp_path).out
        match = re.fullmatch(r"7 values of drive.ratio, (.*): (\d+) holds, ([\d.]+) kB; about (.*)\n", plan)
        assert match
        assert match.groups()[:2] == (directions, str(holds))
        assert match[4].endswith("; no many starts")
        assert (
            f"running drive.ratio {directions} over"
            in succeed(separatrix, *words, "-o", f"{way}.h5", folder=tmp_path).out
        )
        with h5py.File(tmp_path / f"{way}.h5") as file:
            names = ["drive_ratio", *(key for key, item in file.items() if getattr(item, "ndim", 0) > 1)]
            written = sum(file[key].nbytes for key in names)
        assert float(match[3]) == pytest.approx(written / 1000, rel=5e-3)
    whole = succeed(separatrix, *KINDS["sweep"], "--dry-run", folder=tmp_path).out
    assert "14 holds" in whole
    assert "many starts: 7 x 6 = 42 points" in whole


@pytest.mark.parametrize("kind", KINDS)
def test_every_command_under_mpirun(mpi_separatrix, tmp_path, results, kind):
    write_case(tmp_path)
    (tmp_path / "starts.csv").write_bytes((results["map"].parent / "starts.csv").read_bytes())
    more = ["--csv", "table.csv"] if kind in ("points", "trajectory") else []
    outcome = succeed(mpi_separatrix, *KINDS[kind], *more, folder=tmp_path, ranks=2)
    name = f"case.{KINDS[kind][0]}.h5"
    assert differences(results[kind], tmp_path / name) == []
    assert outcome.out.count(f"wrote {name}") == 1
    assert sorted(listing(tmp_path)) == sorted([name, "case.toml", "starts.csv", *more[1:]])


@pytest.mark.parametrize(
    "arguments",
    [["laws"], ["info", "map.h5"], ["verify", "map.h5", "--sample", "20"], ["--version"], ["--help"]],
)
def test_what_is_not_shared_is_printed_once(mpi_separatrix, results, arguments):
    folder = results["map"].parent
    alone = succeed(mpi_separatrix, *arguments, folder=folder)
    assert succeed(mpi_separatrix, *arguments, folder=folder, ranks=2) == alone


def test_the_default_output_is_the_case_in_this_folder(separatrix, tmp_path):
    (tmp_path / "cases").mkdir()
    write_case(tmp_path / "cases", name="some.case.toml")
    succeed(separatrix, "trajectory", "cases/some.case.toml", folder=tmp_path)
    succeed(separatrix, "basin", "cases/some.case.toml", folder=tmp_path)
    written = ["some.case.basin.h5", "some.case.trajectory.h5"]
    assert sorted(listing(tmp_path)) == ["cases/some.case.toml", *written]


@pytest.mark.parametrize("option", [["-o", "out.h5"], ["--output", "out.h5"], ["--output=out.h5"]])
def test_the_output_has_the_name_asked_for(separatrix, tmp_path, option):
    write_case(tmp_path)
    succeed(separatrix, "trajectory", "case.toml", *option, folder=tmp_path)
    assert sorted(listing(tmp_path)) == ["case.toml", "out.h5"]


def test_set_changes_the_case(separatrix, tmp_path):
    write_case(tmp_path)
    settings = [
        'start.x0="500 mm"',
        "drive.ratio=1.05",
        'friction={law="viscous", damping=0.2}',
        "axis[1].count=5",
    ]
    options = [word for setting in settings for word in ("--set", setting)]
    succeed(separatrix, "trajectory", "case.toml", *options, folder=tmp_path)
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        assert file["x"][0] == 0.5
        assert file.attrs["drive_ratio"] == 1.05
        resolved = file["provenance"].attrs["resolved_case"]
    for line in ('law = "viscous"', "damping = 0.2", "count = 5"):
        assert line in resolved
    assert "kinetic_coefficient" not in resolved


@pytest.mark.parametrize("kind", KINDS)
def test_the_log_in_json(separatrix, results, tmp_path, kind):
    outcome = succeed(
        separatrix, *KINDS[kind], "--json", "-o", tmp_path / "o.h5", folder=results["map"].parent
    )
    events = [json.loads(line) for line in outcome.out.splitlines()]
    assert all({"event", "seconds", "message"} <= event.keys() for event in events)
    assert "written" in [event["event"] for event in events]
    seconds = [event["seconds"] for event in events]
    assert seconds == sorted(seconds)
    if kind == "map":
        shares = {event["regime"]: event for event in events if event["event"] == "share"}
        assert sum(share["points"] for share in shares.values()) == 19 * 31
        assert sum(share["percent"] for share in shares.values()) == pytest.approx(100, abs=1e-9)
    if kind == "sweep":
        limits = {event["name"]: event for event in events if event["event"] == "limit"}
        assert 0 < limits["impacts_start_up"]["upper"] - limits["impacts_start_up"]["lower"] <= 1e-3


@pytest.mark.parametrize("option", ["-q", "--quiet"])
@pytest.mark.parametrize("kind", KINDS)
def test_quiet_prints_nothing(separatrix, results, tmp_path, kind, option):
    folder = results["map"].parent
    outcome = succeed(separatrix, *KINDS[kind], option, "-o", tmp_path / "o.h5", folder=folder)
    assert outcome.out == ""
    assert differences(results[kind], tmp_path / "o.h5") == []


def test_laws(separatrix, tmp_path):
    laws = json.loads(succeed(separatrix, "laws", "--json", folder=tmp_path).out)
    text = succeed(separatrix, "laws", folder=tmp_path).out
    names = {(law["family"], law["law"]) for law in laws}
    expected = {
        *(("friction", name) for name in ("coulomb", "viscous", "coulomb_stribeck")),
        *(("drive", name) for name in ("fourier", "crank_lever_rod", "harmonic")),
        *(("contact", "newton"), ("restoring", "linear"), ("body", "point_mass")),
    }
    assert expected <= names
    for law in laws:
        kind, _, name = law["law"].rpartition(":")
        assert (f"[{kind}.NAME]" if kind else name) in text
        assert law["meaning"] in text
        assert law["source"] or law["law"] in ("none", "expression") or kind
        for parameter in law["parameters"]:
            assert parameter["unit"]
            assert parameter["meaning"]
            assert (
                parameter["lower"] is None
                or parameter["upper"] is None
                or parameter["lower"] < parameter["upper"]
            )
            assert parameter["name"] in text


@pytest.mark.parametrize("kind", KINDS)
def test_info(separatrix, results, kind):
    folder = results["map"].parent
    text = succeed(separatrix, "info", f"{kind}.h5", folder=folder).out
    facts = json.loads(succeed(separatrix, "info", f"{kind}.h5", "--json", folder=folder).out)
    assert facts["kind"] == KIND_OF.get(kind, kind)
    assert f"kind: {facts['kind']}" in text
    assert facts["complete"] == 1
    with h5py.File(results[kind]) as file:
        for variable in facts["variables"]:
            assert list(file[variable["name"]].shape) == variable["shape"]
        codes = "branch_reason" if kind == "sweep" else "reason"
        if codes in file:
            shares = facts[codes]
            assert sum(share["points"] for share in shares.values()) == file[codes].size
            assert sum(share["percent"] for share in shares.values()) == pytest.approx(100, abs=1e-9)
    if kind == "map":
        assert len(facts["catalogue"]) == 2


@pytest.mark.parametrize("kind", KINDS)
def test_verify(separatrix, results, kind):
    folder = results["map"].parent
    text = succeed(separatrix, "verify", f"{kind}.h5", "--sample", 10, folder=folder).out
    facts = json.loads(
        succeed(separatrix, "verify", f"{kind}.h5", "--sample", 10, "--json", folder=folder).out
    )
    assert facts["kind"] == KIND_OF.get(kind, kind)
    assert f"checksums of {facts['datasets']} datasets agree" in text
    if kind != "trajectory":
        assert facts["rerun"] == 10
        assert facts["differing"] == 0
        assert facts["label_flips"] == 0
        # Some of the lists' starts come close to a barrier without touching it, which magnifies rounding.
        assert facts["x_deviation"] < 1e-6


def test_verify_reports_that_no_point_had_settled(separatrix, tmp_path):
    """A deviation of 0 m would be one that nobody has looked at."""
    write_case(tmp_path)
    small = [word for number in (1, 2) for word in ("--set", f"axis[{number}].count=2")]
    keys = ("contact.restitution=1", "friction.kinetic_coefficient=0", "friction.static_coefficient=0")
    lossless = [word for key in (*keys, "run.duration=27", "run.extension=1") for word in ("--set", key)]
    succeed(separatrix, "basin", "case.toml", "-o", "map.h5", *small, *lossless, folder=tmp_path)
    output = succeed(separatrix, "verify", "map.h5", folder=tmp_path).out
    assert "none had settled: impact counts and states are not compared" in output
    facts = json.loads(succeed(separatrix, "verify", "map.h5", "--json", folder=tmp_path).out)
    assert facts["compared"] == 0


def test_verify_runs_each_point_of_a_small_map_once(separatrix, tmp_path):
    write_case(tmp_path)
    small = [word for number in (1, 2) for word in ("--set", f"axis[{number}].count=3")]
    succeed(separatrix, "basin", "case.toml", "-o", "map.h5", *small, folder=tmp_path)
    for sample, points in ((200, "  all 9 points"), (9, "  all 9 points"), (8, "  8 points")):
        text = succeed(separatrix, "verify", "map.h5", "--sample", sample, folder=tmp_path).out
        assert f"{points} run again: 0 differ" in text
        assert ("95 % confidence" in text) == (sample == 8)


@pytest.mark.parametrize("ranks", [0, 2])
def test_points_to_a_table_and_back(mpi_separatrix, tmp_path, ranks):
    write_case(tmp_path)
    (tmp_path / "starts.csv").write_text(STARTS)
    command = ["points", "case.toml", "--list", "starts.csv", "--csv", "out.csv", "-o", "out.h5"]
    succeed(mpi_separatrix, *command, folder=tmp_path, ranks=ranks)
    with (tmp_path / "out.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == COLUMNS
    assert len(rows) == 5
    asked = [list(map(float, line.split(","))) for line in STARTS.splitlines()[1:]]
    assert [[float(row[name]) for name in COLUMNS[:3]] for row in rows] == asked
    with h5py.File(tmp_path / "out.h5") as file:
        names = dict(zip(file["reason"].attrs["flag_values"], text_of(file["reason"]).split(), strict=True))
        for name in COLUMNS[:-1]:
            assert [float(row[name]) for row in rows] == file[name][()].tolist()
        assert [row["reason"] for row in rows] == [names[code] for code in file["reason"][()]]
    for i, row in enumerate(rows):
        # A little longer, because samples stop short of the end.
        options = [
            f"start.x0={row['x0']}",
            f"start.v0={row['v0']}",
            f"drive.ratio={row['ratio']}",
            "run.duration=50.001",
        ]
        options = [word for option in options for word in ("--set", option)]
        succeed(mpi_separatrix, "trajectory", "case.toml", *options, "-o", f"{i}.h5", folder=tmp_path)
        with h5py.File(tmp_path / f"{i}.h5") as file:
            impacts = np.isin(file["event_kind"][()], [1, 2]) & (file["event_time"][()] <= 50)
            last = np.argmin(abs(file["time"][()] - 50))
            assert int(row["impacts"]) == impacts.sum()
            assert float(row["last_impact_speed"]) == pytest.approx(
                abs(file["event_v_before"][impacts][-1]), abs=1e-10
            )
            assert file["time"][last] == pytest.approx(50, abs=1e-12)
            assert file["x"][last] == pytest.approx(float(row["x"]), abs=1e-11)
            assert file["v"][last] == pytest.approx(float(row["v"]), abs=1e-10)
            assert file.attrs["reason"] == row["reason"]


def text_of(item: h5py.Dataset) -> str:
    """The meanings of the codes of a variable."""
    return str(item.attrs["flag_meanings"])


def test_a_list_in_another_order_and_without_ratio(separatrix, tmp_path):
    write_case(tmp_path)
    (tmp_path / "a.csv").write_text("x0,v0,ratio\n0.4,1,1.2\n0.5,-1,1.2\n")
    (tmp_path / "b.csv").write_bytes(
        b"# no ratio: that of the case\r\n v0 , x0\r\n\r\n1,0.4\r\n-1.0E0, .5\r\n"
    )
    for name in "ab":
        command = [
            "points",
            "case.toml",
            "--list",
            f"{name}.csv",
            "--csv",
            f"{name}_out.csv",
            "-o",
            f"{name}.h5",
        ]
        succeed(separatrix, *command, folder=tmp_path)
    assert (tmp_path / "a_out.csv").read_text() == (tmp_path / "b_out.csv").read_text()


def test_the_events_of_a_trajectory_as_a_table(separatrix, tmp_path):
    write_case(tmp_path)
    succeed(separatrix, "trajectory", "case.toml", "--csv", "events.csv", folder=tmp_path)
    with (tmp_path / "events.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["kind", "time", "x", "v_before", "v_after"]
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        for name in ("time", "x", "v_before", "v_after"):
            assert [float(row[name]) for row in rows] == file[f"event_{name}"][()].tolist()


def test_a_sweep_reports_what_it_gave_up(separatrix, tmp_path):
    """A trajectory that ran out of events is neither a motion with impacts nor one without."""
    write_case(tmp_path)
    more = ["--set", "integrator.event_budget=3", "--set", "attractors.sample=1", "-o", "out.h5"]
    output = succeed(separatrix, *KINDS["sweep"], *more, "--partial", folder=tmp_path).out
    assert "given up: 56 of 56 holds and starts" in output
    assert "run up: given up from 0.800000 to 1.40000 as event_budget" in output
    assert "run down: given up from 0.800000 to 1.40000 as event_budget" in output
    assert "ended as event_budget: 42 points" in output
    assert "many starts" not in output
    assert "neither start nor stop" not in output
    plain = succeed(separatrix, *KINDS["sweep"], "-o", "plain.h5", folder=tmp_path).out
    assert "given up" not in plain
    assert "many starts" in plain
    assert sum(map(int, re.findall(r"ended as \w+: (\d+) points", plain))) == 42


def test_a_sweep_without_a_contact_speaks_of_no_impacts_only(separatrix, tmp_path):
    """Without impacts is not `non_impact`: on a belt the body also sticks, as the regimes show."""
    case = """
        body.m = {mass = 2}
        spring.k = {between = ["m"], stiffness = 50, damping = 0.2}
        friction.b = {between = ["m"], force = 3, static_force = 5, velocity = 0.3}
        run.duration = 10
        attractors.sample = 4
        sweep = {parameter = "friction.b.velocity", from = 0.1, to = 0.3, count = 2, starts = [2, 2]}
        axis = [{name = "x0", from = -0.3, to = 0.3, count = 2}, {name = "v0", from = -1, to = 1, count = 2}]
    """
    (tmp_path / "belt.toml").write_text(case)
    output = succeed(separatrix, "sweep", "belt.toml", "-o", "belt.h5", folder=tmp_path).out
    assert "no impacts throughout" in output
    assert "many starts: without impacts from 0.100000 to 0.300000" in output
    assert "neither start nor stop" not in output
    assert "non-impact" not in output


def test_more_slices_than_fit_are_refused(separatrix, tmp_path):
    """The numbers of all attractors are exchanged in one piece, which counts to 2**31 - 1."""
    write_case(tmp_path)
    axes = (
        "axis=[{name='x0', from=0, to=1, count=2}, {name='drive.ratio', from=0.8, to=1.4, count=9000},"
        " {name='friction.kinetic_coefficient', from=0.1, to=0.3, count=9000}]"
    )
    ended = run(separatrix, "basin", "case.toml", "--validate", "--set", axes, folder=tmp_path)
    assert ended.code == 65
    assert "'axis.count': found 81000000" in ended.err
    assert "allowed at most 74051160" in ended.err


def boundary(separatrix, folder):
    """The x0 at v0 = 0 between 0.4 and 0.8 m up to which a start leads to impacts, to the last bit."""
    low, high = 0.4, 0.8
    while high - low > 4e-16:
        values = np.unique(np.linspace(low, high, 300))
        rows = [f"{float(value)!r},0" for value in values]
        (folder / "line.csv").write_text("\n".join(["x0,v0", *rows]))
        arguments = ["points", "case.toml", "--list", "line.csv", "--force", "-o", "line.h5"]
        succeed(separatrix, *arguments, folder=folder)
        with h5py.File(folder / "line.h5") as file:
            first = int(np.argmax(file["regime"][:] == 1))
        low, high = float(values[first - 1]), float(values[first])
        if values.size < 300:
            break
    return high


@pytest.mark.long
def test_verify_fails_where_labels_would_change(separatrix, tmp_path):
    """Starts on both sides of a basin boundary, nearer to it than rounding carries."""
    write_case(tmp_path)
    edge = boundary(separatrix, tmp_path)
    near = [edge + k * float(np.spacing(edge)) for k in range(-40, 41)]
    line = ["--set", f"axis[1]={{name='x0', values={near!r}}}", "--set", "axis[2]={name='v0', values=[0]}"]
    succeed(separatrix, "basin", "case.toml", *line, "-o", "near.h5", folder=tmp_path)
    outcome = run(separatrix, "verify", "near.h5", "--json", folder=tmp_path)
    facts = json.loads(outcome.out)
    assert facts["labels_changing"] == facts["label_flips"] > 0.01 * facts["rerun"]
    assert outcome.code == 77
    flips = f"{facts['label_flips']} of {facts['rerun']} labels rerun would change"
    assert len(outcome.messages) == 1
    assert all(part in outcome.messages[0] for part in ("warning", "near.h5", flips, "--max-changes"))
    succeed(separatrix, "verify", "near.h5", "--max-changes", "100", folder=tmp_path)
    share = 100 * facts["label_flips"] / facts["rerun"]
    succeed(separatrix, "verify", "near.h5", "--max-changes", share + 0.01, folder=tmp_path)
    assert run(separatrix, "verify", "near.h5", "--max-changes", share - 0.01, folder=tmp_path).code == 77
