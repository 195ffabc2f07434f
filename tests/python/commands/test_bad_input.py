# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input: the right exit code, a message that names what and where, and nothing written."""

import os
import re
import time

import h5py
import pytest
from program import CASE, STARTS, listing, run, succeed, write_case

LEVER = """\
law = "crank_lever_rod"
ratio = 1.2
crank = 0.05
pivot_distance = 0.075
lever = 0.225
rod = 0.1
pivot_angle = "-117 deg"
guide_height = 0.4
"""
FOURIER = CASE[CASE.index('law = "fourier"') : CASE.index("[start]")]

# What is replaced in the case, by what, and what the message must name after the file and the line.
BAD_CASES = {
    "unknown_key": (
        "kinetic_coefficient",
        "kinetic_coeficient",
        [
            "friction.kinetic_coeficient",
            "unknown",
            "did you mean 'kinetic_coefficient'",
            "static_coefficient",
        ],
    ),
    "unknown_table": ("[friction]", "[frictoin]", ["frictoin", "unknown", "friction"]),
    "unknown_law": ('law = "coulomb"', 'law = "columb"', ["friction.law", "columb", "coulomb", "viscous"]),
    "repeated_key": ("mass = 1.0", "mass = 1.0\nmass = 1.0", ["key 'mass'", "twice", "line 3"]),
    "repeated_table": ("[start]", "[body]\n[start]", ["table 'body'", "twice", "line 2"]),
    "text_for_number": ("restitution = 0.5", "restitution = true", ["contact.restitution", "true", "number"]),
    "number_for_text": ('law = "newton"', "law = 3", ["contact.law", "3", "newton"]),
    "number_for_list": ("sine = [0.0, 0.02849, -0.02686]", "sine = 0.1", ["drive.sine", "0.1", "list"]),
    "fraction_for_count": ("count = 19", "count = 19.5", ["count", "19.5", "integer"]),
    "unknown_unit": ('upper = "1.1 m"', 'upper = "1.1 yd"', ["contact.upper", "yd", "mm"]),
    "wrong_quantity": ('upper = "1.1 m"', 'upper = "1.1 kg"', ["contact.upper", "kg", "mm"]),
    "no_number": ('upper = "1.1 m"', 'upper = "far"', ["contact.upper", "far", "m"]),
    "restitution": ("restitution = 0.5", "restitution = 1.01", ["contact.restitution", "1.01", "1.0"]),
    "no_mass": ("mass = 1.0", "mass = 0", ["body.mass", "found 0", "more than 0"]),
    "negative": (
        "kinetic_coefficient = 0.2",
        "kinetic_coefficient = -0.2",
        ["friction.kinetic", "-0.2", "0.0"],
    ),
    "missing": ("mass = 1.0", "", ["body.mass", "missing"]),
    "nul": ('title = "Coulomb', 'title = "Cou\\u0000lomb', ["title", "control character"]),
    "nan": ("mass = 1.0", "mass = nan", ["body.mass", "nan", "finite number"]),
    "infinity": ("ratio = 1.2", "ratio = inf", ["drive.ratio", "inf", "finite number"]),
    "barrier": (
        'to = "1.1 m"\ncount',
        'to = "1.2 m"\ncount',
        ["axis[1]", "x0 = 1.2 m", "contact.upper = 1.1 m"],
    ),
    "empty_axis": ("count = 19", "count = 0", ["axis[1].count", "found 0", "from 1"]),
    "axis_of_nothing": ('from = 0\nto = "1.1 m"\ncount = 19', "values = []", ["axis[1]", "values"]),
    "axis_backwards": ("from = -6\n", "from = 7\n", ["axis[2]", "from", "7"]),
    "axis_twice": ('name = "v0"', 'name = "x0"', ["axis[2].name", "x0"]),
    "unknown_axis": ('name = "v0"', 'name = "w0"', ["axis[2].name", "w0", "v0"]),
    "series": ("sine = [0.0, 0.02849, -0.02686]", "sine = [0.0]", ["drive.sine", "cosine"]),
    "window": ("[start]", "[run]\nduration = 1\nwindow = 2\n[start]", ["run.window", "2"]),
    "mechanism": (FOURIER, LEVER, ["drive", "assembled", "crank angle"]),
    "crank": (FOURIER, LEVER.replace("0.075", "0.04"), ["drive", "pivot_distance", "0.04"]),
    "syntax": ("[friction]", "[friction", ["case.toml"]),
}


@pytest.mark.parametrize("name", BAD_CASES)
def test_a_bad_case_is_refused(separatrix, tmp_path, name):
    old, new, words = BAD_CASES[name]
    assert CASE.count(old) == 1
    write_case(tmp_path, CASE.replace(old, new))
    before = listing(tmp_path)
    outcome = run(separatrix, "basin", "case.toml", folder=tmp_path)
    assert outcome.code == 65
    assert outcome.out == ""
    position = re.match(r"separatrix: case\.toml:(\d+)(:\d+)?: \S", outcome.err)
    assert 1 <= int(position[1]) <= CASE.count("\n") + 8
    for word in words:
        assert word in outcome.err
    assert listing(tmp_path) == before


def test_the_line_is_that_of_the_key(separatrix, tmp_path):
    write_case(tmp_path, CASE.replace("restitution = 0.5", "restitution = 2"))
    outcome = run(separatrix, "basin", "case.toml", folder=tmp_path)
    line = CASE.splitlines().index("restitution = 0.5") + 1
    assert outcome.err.startswith(f"separatrix: case.toml:{line}: key 'contact.restitution': found 2")


def test_all_problems_are_reported_at_once(separatrix, tmp_path):
    text = CASE.replace("mass = 1.0", "mass = 0").replace("restitution = 0.5", "restitution = 2")
    write_case(tmp_path, text.replace("sample = 32", "samples = 32"))
    outcome = run(separatrix, "basin", "case.toml", folder=tmp_path)
    for key in ("body.mass", "contact.restitution", "attractors.samples"):
        assert f"key '{key}'" in outcome.err


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("drive.ratio=-1", ["--set drive.ratio=-1", "-1.0", "more than 0.0"]),
        ("drive.rato=1", ["--set drive.rato=1", "unknown", "ratio"]),
        ("drive.ratio", ["--set drive.ratio", "="]),
        ("drive.ratio=", ["--set drive.ratio="]),
        ("axis[3].count=4", ["axis[3]"]),
        ("drive.ratio=one", ["--set drive.ratio=one"]),
    ],
)
def test_a_bad_override_is_refused(separatrix, tmp_path, override, words):
    write_case(tmp_path)
    outcome = run(separatrix, "basin", "case.toml", "--set", override, folder=tmp_path)
    assert outcome.code == 65
    for word in words:
        assert word in outcome.err
    assert list(listing(tmp_path)) == ["case.toml"]


@pytest.mark.parametrize(
    ("command", "change", "words"),
    [
        ("basin", ('[[axis]]\nname = "v0"\nfrom = -6\nto = "6 m/s"\ncount = 31\n', ""), ["axis", "two"]),
        ("sweep", (CASE[CASE.index("[sweep]") :], ""), ["sweep"]),
        ("trajectory", ('x0 = "0.4 m"', 'x0 = "1.2 m"'), ["start.x0", "1.2", "1.1"]),
        ("points", ("mass = 1.0", "mass = -1"), ["body.mass", "-1"]),
    ],
)
def test_a_command_needs_its_part_of_the_case(separatrix, tmp_path, command, change, words):
    assert CASE.count(change[0]) == 1
    write_case(tmp_path, CASE.replace(*change))
    (tmp_path / "starts.csv").write_text(STARTS)
    before = listing(tmp_path)
    more = ["--list", "starts.csv"] if command == "points" else []
    outcome = run(separatrix, command, "case.toml", *more, folder=tmp_path)
    assert outcome.code == 65
    for word in ["case.toml", *words]:
        assert word in outcome.err
    assert listing(tmp_path) == before


BAD_LISTS = {
    "no_v0": ("x0\n0.1\n", ["starts.csv:1", "x0", "v0"]),
    "unknown_column": ("x0,v0,phase\n0,0,0\n", ["starts.csv:1", "phase", "ratio"]),
    "column_twice": ("x0,v0,x0\n0,0,0\n", ["starts.csv:1", "x0", "repeated"]),
    "text": ("x0,v0\n0,0\n0,fast\n", ["starts.csv:3", "v0", "fast", "finite number"]),
    "nan": ("x0,v0\nnan,0\n", ["starts.csv:2", "x0", "nan", "finite number"]),
    "infinite": ("x0,v0\n0,1e999\n", ["starts.csv:2", "v0", "1e999", "finite number"]),
    "nothing": ("x0,v0\n0,\n", ["starts.csv:2", "v0", "finite number"]),
    "two_numbers": ("x0,v0\n0,1 2\n", ["starts.csv:2", "v0", "1 2", "finite number"]),
    "too_few": ("x0,v0,ratio\n0,0\n", ["starts.csv:2", "2 values", "3 columns"]),
    "too_many": ("x0,v0\n0,0,1\n", ["starts.csv:2", "3 values", "2 columns"]),
    "barrier": ("# starts\nx0,v0\n0,0\n\n1.2,0\n", ["starts.csv:5", "x0", "1.2", "1.1"]),
    "ratio": ("x0,v0,ratio\n0,0,0\n", ["starts.csv:2", "ratio", "above 0"]),
    "header_only": ("x0,v0\n", ["starts.csv", "no points", "x0,v0"]),
    "no_header": ("0.1,0.2\n", ["starts.csv:1", "0.1", "x0"]),
    "empty": ("", ["starts.csv", "no points", "x0,v0"]),
    "long_line": ("x0,v0\n0," + "1" * 5000 + "x\n", ["starts.csv:2", "v0"]),
    "zero_byte": ("x0,v0\n0,0\n0,\0\n", ["starts.csv:3", "UTF-8"]),
}


@pytest.mark.parametrize("name", BAD_LISTS)
def test_a_bad_list_is_refused(separatrix, tmp_path, name):
    text, words = BAD_LISTS[name]
    write_case(tmp_path)
    (tmp_path / "starts.csv").write_text(text)
    before = listing(tmp_path)
    outcome = run(
        separatrix, "points", "case.toml", "--list", "starts.csv", "--csv", "o.csv", folder=tmp_path
    )
    assert (outcome.code, outcome.out) == (65, "")
    for word in words:
        assert word in outcome.err
    assert listing(tmp_path) == before


@pytest.mark.parametrize("command", ["basin", "sweep", "trajectory", "points"])
@pytest.mark.parametrize("missing", ["nowhere.toml", "case.toml/case.toml", "folder"])
def test_a_case_that_cannot_be_read(separatrix, tmp_path, command, missing):
    write_case(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "starts.csv").write_text(STARTS)
    before = listing(tmp_path)
    more = ["--list", "starts.csv"] if command == "points" else []
    outcome = run(separatrix, command, missing, *more, folder=tmp_path)
    assert (outcome.code, outcome.out) == (66, "")
    assert outcome.err.count("\n") == 1
    assert missing in outcome.err
    assert listing(tmp_path) == before


@pytest.mark.parametrize("command", ["info", "verify"])
@pytest.mark.parametrize(("path", "code"), [("nowhere.h5", 66), ("folder", 66), ("case.toml", 65)])
def test_a_file_that_cannot_be_read(separatrix, tmp_path, command, path, code):
    write_case(tmp_path)
    (tmp_path / "folder").mkdir()
    outcome = run(separatrix, command, path, folder=tmp_path)
    assert (outcome.code, outcome.out) == (code, "")
    assert outcome.err.count("\n") == 1
    assert path in outcome.err


@pytest.mark.parametrize("path", ["nowhere.csv", "folder"])
def test_a_list_that_cannot_be_read(separatrix, tmp_path, path):
    write_case(tmp_path)
    (tmp_path / "folder").mkdir()
    outcome = run(separatrix, "points", "case.toml", "--list", path, folder=tmp_path)
    assert (outcome.code, outcome.out) == (66, "")
    assert outcome.err.count("\n") == 1
    assert path in outcome.err


COMMANDS = {
    "basin": ["basin", "case.toml"],
    "sweep": ["sweep", "case.toml"],
    "sweep_without_starts": ["sweep", "case.toml", "--set", "sweep.starts=[0, 0]"],
    "trajectory": ["trajectory", "case.toml"],
    "points": ["points", "case.toml", "--list", "starts.csv"],
}


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("output", ["none/out.h5", "case.toml/out.h5", "folder"])
def test_an_output_that_cannot_be_created(separatrix, tmp_path, name, output):
    write_case(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "starts.csv").write_text(STARTS)
    before = listing(tmp_path)
    outcome = run(separatrix, *COMMANDS[name], "-o", output, folder=tmp_path)
    assert (outcome.code, outcome.out) == (73, "")
    assert outcome.err.count("\n") == 1
    assert output in outcome.err
    assert listing(tmp_path) == before


@pytest.mark.parametrize("name", COMMANDS)
def test_a_folder_is_not_replaced_even_with_force(separatrix, tmp_path, name):
    write_case(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "starts.csv").write_text(STARTS)
    before = listing(tmp_path)
    outcome = run(separatrix, *COMMANDS[name], "-o", "folder", "--force", folder=tmp_path)
    assert (outcome.code, outcome.out) == (73, "")
    assert "'folder'" in outcome.err
    assert listing(tmp_path) == before


@pytest.mark.parametrize("name", COMMANDS)
def test_an_existing_output_is_only_replaced_with_force(separatrix, tmp_path, name):
    write_case(tmp_path)
    (tmp_path / "starts.csv").write_text(STARTS)
    output = f"case.{COMMANDS[name][0]}.h5"
    (tmp_path / output).write_text("something dear")
    before = listing(tmp_path)
    outcome = run(separatrix, *COMMANDS[name], folder=tmp_path)
    assert (outcome.code, outcome.out) == (73, "")
    assert f"'{output}' exists" in outcome.err
    assert "--force" in outcome.err
    assert listing(tmp_path) == before
    succeed(separatrix, *COMMANDS[name], "--force", folder=tmp_path)
    after = listing(tmp_path)
    assert after[output].startswith(b"\x89HDF")
    assert after.keys() == before.keys()


@pytest.mark.parametrize("name", ["points", "trajectory"])
@pytest.mark.parametrize(("csv", "force"), [("dear.csv", False), ("none/o.csv", True), ("folder", True)])
def test_a_table_that_cannot_be_created(separatrix, tmp_path, name, csv, force):
    write_case(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "starts.csv").write_text(STARTS)
    (tmp_path / "dear.csv").write_text("something dear")
    before = listing(tmp_path)
    outcome = run(separatrix, *COMMANDS[name], "--csv", csv, *["--force"] * force, folder=tmp_path)
    assert (outcome.code, outcome.out) == (73, "")
    assert csv in outcome.err
    assert listing(tmp_path) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["command", "basin", "verify", "--help"]),
        (["basins", "case.toml"], ["basins", "basin", "sweep"]),
        (["basin"], ["basin", "missing", "--help"]),
        (["basin", "case.toml", "more.toml"], ["more.toml"]),
        (["basin", "case.toml", "--fast"], ["--fast", "--help"]),
        (["basin", "case.toml", "-o"], ["-o", "value"]),
        (["basin", "case.toml", "--force=yes"], ["--force", "value"]),
        (["basin", "case.toml", "--force", "--resume"], ["--force", "--resume"]),
        (["basin", "case.toml", "--time-limit", "0"], ["--time-limit", "0", "above 0"]),
        (["basin", "case.toml", "--time-limit", "1h"], ["--time-limit", "1h", "seconds"]),
        (["basin", "case.toml", "--time-limit", "1-5"], ["--time-limit", "1-5", "seconds"]),
        (["basin", "case.toml", "--ranks-per-node", "0"], ["--ranks-per-node", "0", "from 1"]),
        (["basin", "case.toml", "--list", "starts.csv"], ["--list", "points"]),
        (["basin", "case.toml", "--csv", "o.csv"], ["--csv", "points"]),
        (["basin", "case.toml", "--csv", ""], ["--csv"]),
        (["points", "case.toml"], ["--list"]),
        (
            ["points", "case.toml", "--list", "starts.csv", "--csv", "starts.csv", "--force"],
            ["--csv", "starts.csv"],
        ),
        (["points", "case.toml", "--list", "starts.csv", "--csv", "o", "-o", "o"], ["--csv", "o"]),
        (["basin", "case.toml", "-o", "case.toml", "--force"], ["-o", "case.toml"]),
        (["verify", "case.h5", "--sample", "-3"], ["--sample", "-3", "from 1"]),
        (["verify", "case.h5", "--max-changes", "101"], ["--max-changes", "101", "from 0.0 to 100.0"]),
        (["verify", "case.h5", "--sample", "99999999999"], ["--sample", "99999999999"]),
        (["laws", "case.toml"], ["laws", "case.toml"]),
    ],
)
def test_bad_usage(separatrix, tmp_path, arguments, words):
    write_case(tmp_path)
    (tmp_path / "starts.csv").write_text(STARTS)
    before = listing(tmp_path)
    outcome = run(separatrix, *arguments, folder=tmp_path)
    assert (outcome.code, outcome.out) == (64, "")
    assert outcome.err.count("\n") == 1
    for word in words:
        assert word in outcome.err
    assert listing(tmp_path) == before


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["basin", "bad.toml"], 65, "restitution"),
        (["basin", "nowhere.toml"], 66, "nowhere.toml"),
        (["sweep", "case.toml", "-o", "none/out.h5"], 73, "none/out.h5"),
        (["points", "case.toml", "--list", "nowhere.csv"], 66, "nowhere.csv"),
        (["trajectory", "case.toml", "-o", "case.toml/x"], 73, "case.toml/x"),
        (["basins", "case.toml"], 64, "basins"),
        (["info", "nowhere.h5"], 66, "nowhere.h5"),
        (["verify", "bad.toml"], 65, "is a text"),
    ],
)
def test_errors_are_printed_once_whatever_the_number_of_ranks(
    mpi_separatrix, tmp_path, arguments, code, message
):
    write_case(tmp_path)
    write_case(tmp_path, CASE.replace("restitution = 0.5", "restitution = 2"), "bad.toml")
    before = listing(tmp_path)
    started = time.monotonic()
    outcome = run(mpi_separatrix, *arguments, folder=tmp_path, ranks=3)
    assert time.monotonic() - started < 20
    assert outcome.code == code
    assert outcome.out == ""
    assert len(outcome.messages) == 1
    assert message in outcome.messages[0]
    assert listing(tmp_path) == before


def test_all_problems_are_reported_at_once_where_one_is_a_wrong_law(separatrix, tmp_path):
    """What can be checked without the law is checked; the rest is no problem."""
    case = CASE.replace('law = "coulomb"', 'law = "columb"').replace(
        "sine = [0.0, 0.02849, -0.02686]", "sine = [0.0]"
    )
    case += "[run]\nduration = 1\nwindow = 2\n[refine]\nstep = 4\nblock = 6\n"
    axis = '[[axis]]\nname = "friction.kinetic_coefficient"\nvalues = [0.1, 0.2]\n[sweep]'
    write_case(tmp_path, case.replace("[sweep]", axis))
    outcome = run(separatrix, "basin", "case.toml", folder=tmp_path)
    assert outcome.code == 65
    keys = re.findall(r"key '([^']*)'", outcome.err)
    assert keys == ["friction.law", "drive.sine", "run.window", "refine.block"]


def test_a_map_needs_nothing_that_only_a_sweep_does(separatrix, tmp_path):
    """Not the ranges of its starts, nor that the start suits what it sweeps."""
    axes = (
        CASE[CASE.index("[[axis]]") : CASE.index("[sweep]")]
        .replace('"x0"', '"crank_angle"')
        .replace("1.1 m", "6 rad")
    )
    case = (
        CASE[: CASE.index("[[axis]]")] + axes + "[sweep]\nparameter = 'contact.upper'\nfrom = 0.3\nto = 1\n"
    )
    write_case(tmp_path, case)
    succeed(separatrix, "basin", "case.toml", "--validate", folder=tmp_path)
    succeed(separatrix, "trajectory", "case.toml", "--validate", folder=tmp_path)
    outcome = run(separatrix, "sweep", "case.toml", "--validate", folder=tmp_path)
    assert outcome.code == 65
    assert "'sweep.x0': missing" in outcome.err
    assert "'sweep.count': found no count or step" in outcome.err
    # a typing error is one for every command
    write_case(tmp_path, case + "stpe = 0.1\n")
    assert run(separatrix, "basin", "case.toml", "--validate", folder=tmp_path).code == 65


def test_the_driving_body_of_a_pair_moves_its_stops(separatrix, source_dir, tmp_path):
    """A start is within the stops for every position of the driving body, along an axis too."""
    axes = "".join(
        f'\n[[axis]]\nname = "{name}"\nfrom = {low}\nto = {high}\ncount = 3\n'
        for name, low, high in (("body.driver_x0", -0.04, 0.1), ("v0", 0, 1))
    )
    case = tmp_path / "case.toml"
    case.write_text((source_dir / "examples" / "pair_backlash.toml").read_text() + axes)
    assert run(separatrix, "basin", case, "--dry-run", folder=tmp_path).code == 0
    for setting in ("axis[1].to=0.3", "axis[1].from=-0.2"):
        outcome = run(separatrix, "basin", case, "--dry-run", "--set", setting, folder=tmp_path)
        assert outcome.code == 65
        assert "start.x0" in outcome.err
        assert "body.driver_x0" in outcome.err


STRANGE = {
    "empty": (b"", "is empty", 74),
    "bytes": (bytes(range(256)), "is no HDF5 file", 74),
    "text": (b"hello\n", "is a text", 65),
    "hdf5": (None, "is not a file of Separatrix", 74),
    "folder": (None, "is a folder", 66),
    "pipe": (None, "is not a regular file", 66),
    "missing": (None, "there is no file", 66),
}


@pytest.mark.parametrize("content", STRANGE)
def test_what_is_no_result_is_called_what_it_is(separatrix, tmp_path, content):
    """Every command that reads results names the file and the reason."""
    written, reason, code = STRANGE[content]
    path = tmp_path / "strange.h5"
    if content == "folder":
        path.mkdir()
    elif content == "pipe":
        os.mkfifo(path)
    elif content == "hdf5":
        with h5py.File(path, "w") as file:
            file["values"] = [1.0, 2.0]
    elif written is not None:
        path.write_bytes(written)
    before = listing(tmp_path)
    commands = [["info", path.name], ["verify", path.name], ["boundary", path.name, "-o", "b.h5"]]
    commands += [["merge", "whole.h5", path.name]]
    # A text or nothing is a case.
    if content in ("bytes", "hdf5"):
        commands += [["stability", path.name]]
    for words in commands:
        outcome = run(separatrix, *words, folder=tmp_path)
        assert outcome.code == code, outcome
        assert reason in outcome.err, outcome
        assert path.name in outcome.err
    assert listing(tmp_path) == before


@pytest.mark.parametrize("command", ["basin", "sweep", "trajectory", "stability", "points", "branches"])
def test_an_empty_case_lacks_its_first_key(separatrix, tmp_path, command):
    path = write_case(tmp_path, "", "empty.toml")
    (tmp_path / "starts.csv").write_text(STARTS)
    more = {"points": ["--list", "starts.csv"], "branches": ["--parameter", "drive.ratio"]}.get(command, [])
    outcome = run(separatrix, command, path, *more, folder=tmp_path)
    assert outcome.code == 65
    assert f"{path}: key 'body.mass': missing" in outcome.err
