# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What was given up is no result: code 78 where it is all that there is, a line where there is more."""

import ast
import re
from pathlib import Path

import h5py
import pytest
import separatrix as sx
from program import FOLD, run, succeed
from separatrix import cli
from separatrix.errors import GivenUpError
from separatrix.given_up import GIVEN_UP_REASONS
from separatrix.measuring import cli as measures
from separatrix.variables import REASONS

CASE = (
    FOLD.partition("[[axis]]")[0].replace("amplitude = 0.099985", "amplitude = 0.2").replace("600", "60")
    + """\
[attractors]
sample = 2
[[axis]]
name = "x0"
from = -2
to = 1
count = 3
[[axis]]
name = "v0"
from = -2
to = 2
count = 2
[sweep]
from = 0.9
to = 1.1
count = 2
starts = [2, 1]
x0 = [-1, 0.5]
v0 = [0, 0]
samples = 4
"""
)
COMMANDS = {
    "trajectory": (["trajectory", "case.toml"], "the motion was given up: event_budget"),
    "points": (["points", "case.toml", "--list", "list.csv"], "all 2 points were given up"),
    "basin": (["basin", "case.toml"], "all 6 points were given up"),
    "sweep": (["sweep", "case.toml"], "all 8 holds and starts were given up"),
    "stability": (["stability", "case.toml", "--periods", "64"], "the motion was given up: event_budget"),
    "branches": (
        ["branches", "case.toml", "--parameter", "drive.ratio", "--searches", "1"],
        "the motions of 48 of 48 starts were given up",
    ),
    "record": (["trajectory", "case.toml", "--record", "r.csv"], "no record was written"),
}
WRITTEN = ("trajectory", "points", "basin", "sweep")


@pytest.fixture(scope="module")
def folder(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The case, with a budget that no motion can keep, and a file of every kind."""
    path = tmp_path_factory.mktemp("given_up")
    (path / "case.toml").write_text(CASE + "[integrator]\nevent_budget = 1\n")
    (path / "list.csv").write_text("x0,v0\n0,0\n0.5,1\n")
    for name in WRITTEN:
        words = [*COMMANDS[name][0], "--partial", "-o", f"{name}.h5"]
        assert "given up" in succeed(separatrix, *words, folder=path).out
    return path


@pytest.mark.parametrize("name", COMMANDS)
def test_a_run_that_was_given_up_is_an_error(name: str, separatrix: Path, folder: Path) -> None:
    """Code 78, with the reason; what there is has been written."""
    words, message = COMMANDS[name]
    output = ["-o", f"{name}.again.h5"] if name != "stability" else []
    outcome = run(separatrix, *words, *output, folder=folder)
    assert outcome.code == 78, outcome
    assert message in outcome.err
    if name in WRITTEN:
        assert (folder / f"{name}.again.h5").is_file()


@pytest.mark.parametrize("name", [*WRITTEN, "boundary"])
def test_what_reads_such_a_file_reports_it(name: str, separatrix: Path, folder: Path, capsys) -> None:
    """`verify`, `boundary` and the figures end with the same code, unless they are asked to go on."""
    if name == "boundary":
        assert run(separatrix, "boundary", "basin.h5", folder=folder).code == 78
        assert measures.main([str(folder / "basin.h5")]) == 78
        return
    assert run(separatrix, "verify", f"{name}.h5", folder=folder).code == 78
    succeed(separatrix, "verify", f"{name}.h5", "--partial", folder=folder)
    assert cli.main([str(folder / f"{name}.h5"), "--formats", "svg"]) == 78
    assert "given up" in capsys.readouterr().err
    assert not list(folder.glob(f"{name}*.svg"))
    if name == "trajectory":
        assert cli.main([str(folder / f"{name}.h5"), "--formats", "svg", "--partial"]) == 0
        assert "given up after" in (folder / "trajectory_history.svg").read_text()


def test_some_given_up_points_are_counted(separatrix: Path, folder: Path) -> None:
    """The others are results: code 0, and a line."""
    # the first start moves without an event, the other one has many impacts
    (folder / "two.csv").write_text("x0,v0\n0,0\n0.9,5\n")
    settings = ["--set", "integrator.event_budget=6", "--set", "run.duration=7", "--set", "drive.amplitude=0"]
    settings += ["--set", "run.window=1"]
    words = ["points", "case.toml", "--list", "two.csv", "-o", "two.h5", *settings]
    assert "given up: 1 of 2 points" in succeed(separatrix, *words, folder=folder).out
    with h5py.File(folder / "two.h5") as file:
        assert file["reason"][()].tolist() == [2, 5]


def test_a_motion_that_leaves_the_domain_was_not_given_up(separatrix: Path, folder: Path) -> None:
    """That it leaves is what was asked: `run.domain` gives the bounds."""
    settings = ["--set", "integrator.event_budget=1000", "--set", "run.domain=0.01"]
    output = succeed(separatrix, "trajectory", "case.toml", *settings, "-o", "left.h5", folder=folder).out
    assert "ended before the end: left_domain" in output


def test_python_raises_with_what_there_is(library: Path, folder: Path) -> None:
    case = sx.load(folder / "case.toml")
    with pytest.raises(GivenUpError, match="event_budget after") as caught:
        sx.trajectory(case)
    assert caught.value.code == 78
    assert caught.value.result.attrs["reason"] == "event_budget"
    assert sx.trajectory(case, partial=True).sizes == caught.value.result.sizes
    with pytest.raises(GivenUpError, match="all 6 points") as caught:
        sx.basin(case, progress=False)
    assert (caught.value.result["reason"] == 5).all()
    # in this process, without a second look by the program
    with pytest.raises(GivenUpError, match="all 6 points") as caught:
        sx.basin(case.with_({"attractors.second_look": 0}), progress=False)
    assert (caught.value.result["reason"] == 5).all()


def test_the_table_of_exit_codes_is_that_of_the_code(source_dir: Path) -> None:
    """docs/user-guide.md has every code of the program and of the Python commands, and no other."""
    page = (source_dir / "docs" / "user-guide.md").read_text()
    page = page[page.index("### Exit codes") :]
    listed = [int(code) for code in re.findall(r"^\| (\d+) \|", page[: page.index("\n### ", 5)], re.M)]
    found = re.findall(r"exit_\w+ = (\d+)", (source_dir / "src" / "core" / "status.f90").read_text())
    names = {int(code) for code in found}
    errors = source_dir / "postprocess" / "separatrix" / "errors.py"
    for line in ast.parse(errors.read_text()).body:
        if isinstance(line, ast.Assign) and isinstance(line.value, ast.Constant):
            names.add(line.value.value)
    assert listed == sorted(names)


def test_a_reason_is_an_answer_or_was_given_up() -> None:
    """A new reason has to be one of them in Python, too."""
    assert set(REASONS) - set(GIVEN_UP_REASONS) == {"not_run", "settled", "time_over", "left_domain"}
