# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `stability`: exponents, their sum, and what a motion is."""

import json
import math
import subprocess
from pathlib import Path

import h5py
import pytest
from program import succeed


@pytest.fixture
def run(separatrix: Path, source_dir: Path):
    """Runs the command on the oscillator of Budd and Dux; returns what ended."""

    def run_it(*options: str) -> subprocess.CompletedProcess:
        case = source_dir / "examples" / "validation" / "budd_dux.toml"
        return subprocess.run(
            [separatrix, "stability", case, *options], capture_output=True, text=True, check=False
        )

    return run_it


def test_chaos_has_a_positive_exponent_and_the_exact_sum(run):
    ended = run("--set", "contact.upper=0.0", "--set", "start.x0=-0.3", "--periods", "20000", "--json")
    assert ended.returncode == 0, ended.stderr
    lines = {line["event"]: line for line in map(json.loads, ended.stdout.splitlines())}
    assert lines["sum"]["found"] == pytest.approx(lines["sum"]["exact"], abs=1e-8)
    assert lines["zero_one"]["value"] > 0.9
    assert lines["motion"]["type"] == "chaotic"
    first = next(line for line in map(json.loads, ended.stdout.splitlines()) if line.get("number") == 1)
    assert first["value"] == pytest.approx(0.14, abs=0.01)
    assert 0 < first["error"] < 0.01


def test_a_stable_orbit_is_periodic(run):
    ended = run("--set", "start.x0=-1.0", "--periods", "2000", "--json")
    lines = {line["event"]: line for line in map(json.loads, ended.stdout.splitlines())}
    assert lines["motion"]["type"] in ("periodic", "not_known")


def test_a_start_at_another_crank_angle_comes_to_the_same_motion(run):
    ended = run("--set", "start.x0=-1.0", "--set", "start.crank_angle=1", "--periods", "2000", "--json")
    lines = {line["event"]: line for line in map(json.loads, ended.stdout.splitlines())}
    # one impact a period of restitution 0.8 and no damping
    assert lines["sum"]["found"] == pytest.approx(2 * math.log(0.8) * 2.8 / (2 * math.pi), abs=1e-9)


def test_impacts_without_rebound_lose_a_direction(run):
    ended = run("--set", "contact.restitution=0.0", "--set", "start.x0=-1.0", "--periods", "200", "--json")
    values = {
        line["number"]: line["value"]
        for line in map(json.loads, ended.stdout.splitlines())
        if line["event"] == "exponent"
    }
    assert values[2] is None
    assert '"sum"' not in ended.stdout


def test_what_makes_no_sense_is_refused(run):
    assert run("--periods", "3").returncode == 64
    ended = run("-o", "file.h5")
    assert ended.returncode == 64
    assert "--output belongs to" in ended.stderr


def test_a_start_beyond_a_barrier_names_where_it_comes_from(run):
    ended = run("--set", "contact.upper=0.0", "--set", "start.x0=0.5")
    assert ended.returncode == 65
    assert "--set start.x0=0.5: key 'start.x0': found x0 = 0.5 m, allowed at most the barrier" in ended.stderr


def test_the_entries_of_a_map_get_a_type(separatrix: Path, source_dir: Path, tmp_path: Path):
    """Chaos beside a cycle at a soft wall, chaos at a rigid one with its exact sum; cycles are left out."""

    def typed(case: str, *settings: str) -> tuple[dict, list[dict]]:
        target = tmp_path / f"{case}.h5"
        words = [separatrix, "basin", source_dir / "examples" / "validation" / f"{case}.toml", "-o", target]
        words += [word for item in settings for word in ("--set", item)]
        subprocess.run([*words, "-q", "--force"], check=True)
        asked = [separatrix, "stability", target, "--periods", "4000", "--json"]
        ended = subprocess.run(asked, capture_output=True, text=True, check=True)
        first, *entries = map(json.loads, ended.stdout.splitlines())
        return first, entries

    first, entries = typed("soft_impact")
    assert (first["without_period"], first["attractors"], len(entries)) == (1, 2, 1)
    assert entries[0]["type"] == "chaotic" and entries[0]["zero_one"] > 0.9
    # areas shrink by the damping alone
    assert sum(entries[0]["exponents"]) == pytest.approx(-0.04, abs=1e-9)
    axes = "axis=[{name='x0', from=-3, to=-0.1, count=8}, {name='v0', from=-2, to=2, count=8}]"
    _, entries = typed("budd_dux", "contact.upper=0.0", axes)
    assert entries[0]["type"] == "chaotic"
    assert entries[0]["exponents"][0] > 10 * entries[0]["errors"][0] > 0
    assert entries[0]["sum"] == pytest.approx(entries[0]["exact_sum"], abs=1e-8)
    first, entries = typed("budd_dux")
    assert (first["without_period"], entries) == (0, [])


def test_ranks_share_the_entries_of_a_map(mpi_separatrix: Path, source_dir: Path, tmp_path: Path):
    """Three slices with chaos, on two ranks and on one: the same lines, in the same order."""
    case = source_dir / "examples" / "validation" / "budd_dux.toml"
    axes = """axis=[{name='x0', from=-3, to=-0.1, count=4}, {name='v0', from=-2, to=2, count=4},
    {name='drive.ratio', from=2.79, to=2.81, count=3}]"""
    wanted = ("--set", "contact.upper=0.0", "--set", "attractors.sample=4", "--set", axes)
    succeed(mpi_separatrix, "basin", case, *wanted, "-o", "map.h5", "-q", folder=tmp_path)
    asked = ("stability", "map.h5", "--periods", 400, "--json")

    def report(ranks: int) -> list[dict]:
        lines = succeed(mpi_separatrix, *asked, folder=tmp_path, ranks=ranks).out.splitlines()
        clocks = ("time", "seconds")
        return [
            {key: value for key, value in json.loads(line).items() if key not in clocks} for line in lines
        ]

    alone = report(0)
    assert [line["slice"] for line in alone[1:]] == [0, 1, 2]
    assert report(2) == alone


def test_a_period_above_the_limit_is_reported(separatrix: Path, source_dir: Path, tmp_path: Path):
    """A cycle of three periods in a map that looks for one alone."""
    case = tmp_path / "petals.toml"
    case.write_text(
        """body.mass = 1
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 0.04 }
contact = { law = "newton", restitution = 0.8, upper = 0 }
drive = { law = "harmonic", amplitude = 1, ratio = 2.6 }
run.duration = 500
attractors.max_period = 1
axis = [{ name = "x0", from = -2.5, to = 0, count = 8 }, { name = "v0", from = -3, to = 3, count = 8 }]
"""
    )
    target = tmp_path / "map.h5"
    subprocess.run([separatrix, "basin", case, "-o", target, "-q"], check=True)
    asked = [separatrix, "stability", target, "--periods", "4000", "--json"]
    ended = subprocess.run(asked, capture_output=True, text=True, check=True)
    _, *entries = map(json.loads, ended.stdout.splitlines())
    assert [(one["type"], one["period"]) for one in entries] == [("period_above_the_limit", 3)]
    assert entries[0]["exponents"][0] < 0


def test_a_weak_cycle_of_a_map_is_reported_despite_its_positive_mean_exponent(
    separatrix: Path, tmp_path: Path
):
    """A cycle contracts with 5e-4/s: means over a thousand seconds are off by more, its multipliers not."""
    case = tmp_path / "weak.toml"
    case.write_text(
        """body.mass = 1
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 1e-3 }
contact = { law = "newton", restitution = 1, upper = 0 }
drive = { law = "harmonic", amplitude = 1, ratio = 2.6 }
run.duration = 500
attractors.max_period = 1
axis = [
  { name = "x0", from = -0.738, to = -0.698, count = 4 },
  { name = "v0", from = 0.173, to = 0.213, count = 4 },
]
"""
    )
    target = tmp_path / "map.h5"
    subprocess.run([separatrix, "basin", case, "-o", target, "-q"], check=True)
    asked = [separatrix, "stability", target, "--periods", "400", "--json"]
    ended = subprocess.run(asked, capture_output=True, text=True, check=True)
    _, entry = map(json.loads, ended.stdout.splitlines())
    assert entry["exponents"][0] > 0
    assert (entry["type"], entry["period"]) == ("period_above_the_limit", 4)


def test_a_damaged_map_is_refused(separatrix: Path, source_dir: Path, tmp_path: Path):
    target = tmp_path / "map.h5"
    count = ["--set", "axis[1].count=4", "--set", "axis[2].count=4"]
    case = source_dir / "examples" / "basin_coulomb.toml"
    subprocess.run([separatrix, "basin", case, "-o", target, "-q", *count], check=True)
    with h5py.File(target, "r+") as file:
        file["catalogue/period"][0] = 0
    ended = subprocess.run([separatrix, "stability", target], capture_output=True, text=True, check=False)
    assert ended.returncode == 74
    assert "period" in ended.stderr
    # a file is buffered, a pipe is not
    with (tmp_path / "message.txt").open("w") as file:
        subprocess.run([separatrix, "stability", target], stderr=file, check=False)
    assert (tmp_path / "message.txt").read_text() == ended.stderr


def test_a_file_that_is_no_map_is_refused(separatrix: Path, source_dir: Path, tmp_path: Path):
    target = tmp_path / "motion.h5"
    case = source_dir / "examples" / "trajectory_coulomb_1.05.toml"
    subprocess.run([separatrix, "trajectory", case, "-o", target, "-q"], check=True)
    ended = subprocess.run([separatrix, "stability", target], capture_output=True, text=True, check=False)
    assert ended.returncode == 65
    assert "allowed a map (basin) with a catalogue, or a case" in ended.stderr
    (tmp_path / "torn.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 50)
    ended = subprocess.run(
        [separatrix, "stability", tmp_path / "torn.h5"], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 74


SOFT_STOP = """
[body.block]
mass = 1
[spring.frame]
between = ["block"]
stiffness = 1
damping = 0.2
[contact.stop]
between = ["block"]
law = "kelvin_voigt"
stiffness = 20
damping = 0
upper = 0.63
[drive.force]
law = "force"
body = "block"
frequency = 1
amplitude = 0.5
[start]
x0 = 0
[run]
duration = 300
"""


@pytest.mark.parametrize("structure", [False, True])
def test_touches_of_a_soft_stop_are_impacts(separatrix: Path, source_dir: Path, tmp_path: Path, structure):
    """A motion that touches it once a period does so as often as there are periods."""
    case = source_dir / "examples" / "validation" / "soft_impact.toml"
    more = ("--set", "drive.ratio=1.0")
    if structure:
        case, more = tmp_path / "soft.toml", ()
        case.write_text(SOFT_STOP)
    output = succeed(separatrix, "stability", case, *more, "--periods", 200, "--json", folder=tmp_path).out
    motion = next(line for line in map(json.loads, output.splitlines()) if line["event"] == "motion")
    assert (motion["type"], motion["impacts"]) == ("periodic", 200)


DECAY = """
[body.block]
mass = 1
[spring.spring]
between = ["block"]
stiffness = 1
damping = {damping}
[contact.wall]
between = ["block"]
law = "newton"
restitution = {loss}
lower = {wall}
[start]
x0 = 1
[run]
duration = 20
"""


@pytest.mark.parametrize(
    ("damping", "loss", "wall", "outcome"),
    [
        (0.2, 1, -9, "comes to rest"),
        (0.0002, 1, -9, "comes to rest"),
        (0, 0.9, 0, "comes to rest"),
        (0, 1, -9, "is periodic"),
        (0, 1, -0.5, "is periodic"),
    ],
)
def test_a_motion_that_decays_is_not_periodic(separatrix, tmp_path, damping, loss, wall, outcome):
    """Each turn is smaller than the one before by a share: a rest is what it comes to, not a cycle."""
    case = tmp_path / "case.toml"
    case.write_text(DECAY.format(damping=damping, loss=loss, wall=wall))
    text = succeed(separatrix, "stability", case, "--periods", "200", folder=tmp_path).out
    assert f"the motion {outcome}" in text
    assert ("by 200 returns" in text) or outcome == "comes to rest"


@pytest.mark.parametrize(("loss", "impacts"), [(0, 1), (0.1, 6)])
def test_impacts_that_close_a_contact_count(separatrix, source_dir, tmp_path, loss, impacts):
    """As many a period as the trajectory has."""
    case = source_dir / "examples" / "validation" / "public" / "plastic_ball.toml"
    loss = ("--set", f"contact.plate.restitution={loss}")
    text = succeed(separatrix, "stability", case, "--periods", "200", *loss, folder=tmp_path).out
    assert f"by 200 drive periods with {200 * impacts} impacts" in text
    succeed(separatrix, "trajectory", case, *loss, "-o", "ball.h5", folder=tmp_path)
    with h5py.File(tmp_path / "ball.h5") as file:
        assert file.attrs["impacts_per_period"] == impacts
