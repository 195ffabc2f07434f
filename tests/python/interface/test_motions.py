# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions, sweeps and labels of real runs: what the case asks for is what the files hold."""

import os
import re
import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest
import separatrix as sx
from program import meanings, run, succeed, write_case
from separatrix import cli
from separatrix.errors import GivenUpError
from separatrix.given_up import left_text
from separatrix.open import open_result

NO_STARTS = ["sweep", "case.toml", "--set", "sweep.starts=[0, 0]"]
FLOATS = ("x_max", "x_min", "amplitude", "v_max", "mean_impact_speed", "impacts_per_period")
SECTION = ("section_x", "section_v")


def options(*settings: str) -> list[str]:
    """Settings as arguments of the program."""
    return [word for setting in settings for word in ("--set", setting)]


def foot(angle: np.ndarray) -> np.ndarray:
    """Position of the foot of the spring of the case, by its series."""
    harmonics = np.arange(1, 4)
    phase = np.multiply.outer(angle + np.radians(191.1), harmonics)
    cosine, sine = np.array([0.09495, 0.01, -0.02003]), np.array([0.0, 0.02849, -0.02686])
    return 0.31055 + np.cos(phase) @ cosine + np.sin(phase) @ sine


@pytest.mark.parametrize("angle", [0.0, 90.0])
def test_the_drive_begins_at_the_crank_angle_of_the_start(separatrix, tmp_path, angle):
    write_case(tmp_path)
    start = options(f'start.crank_angle="{angle} deg"')
    succeed(separatrix, "trajectory", "case.toml", *start, folder=tmp_path)
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        time, drive = file["time"][()], file["drive"][()]
        period = file.attrs["drive_period"]
    expected = foot(np.radians(angle) + 2 * np.pi * time / period)
    np.testing.assert_allclose(drive, expected, rtol=0, atol=1e-12)
    assert (time[0], time[-1]) == (0.0, 50.0)
    assert (np.diff(time) > 0).all()


def test_a_body_that_never_moves_has_no_events(separatrix, tmp_path):
    write_case(tmp_path)
    held = options("friction.kinetic_coefficient=50")
    succeed(separatrix, "trajectory", "case.toml", *held, "--csv", "events.csv", folder=tmp_path)
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        for name in ("event_kind", "event_time", "event_x", "event_v_before", "event_v_after"):
            assert file[name].shape == (0,)
        assert (file["x"][()] == 0.4).all()
        assert (file["v"][()] == 0.0).all()
    assert (tmp_path / "events.csv").read_text().count("\n") == 1
    succeed(separatrix, "verify", "case.trajectory.h5", folder=tmp_path)


@pytest.mark.parametrize("example", ["structure_impact_damper", "pair_backlash"])
def test_impacts_between_bodies_are_no_damage(separatrix, source_dir, example, tmp_path):
    """The watched body need not turn round where two bodies strike each other."""
    case = source_dir / "examples" / f"{example}.toml"
    succeed(separatrix, "trajectory", case, "-o", "motion.h5", folder=tmp_path)
    succeed(separatrix, "verify", "motion.h5", folder=tmp_path)


@pytest.fixture(scope="module")
def one_way(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sweep of the case in both directions and in each of them."""
    folder = tmp_path_factory.mktemp("one_way")
    write_case(folder)
    for way in ("both", "up", "down"):
        command = [*NO_STARTS, *options(f'sweep.directions="{way}"')]
        succeed(separatrix, *command, "-o", f"{way}.h5", folder=folder)
    return folder


@pytest.mark.parametrize(("way", "ran"), [("up", 0), ("down", 1)])
def test_a_direction_that_was_not_run_is_nan(one_way, way, ran):
    with h5py.File(one_way / f"{way}.h5") as file, h5py.File(one_way / "both.h5") as both:
        for name in (*FLOATS, *SECTION):
            np.testing.assert_array_equal(file[name][ran], both[name][ran], name)
            assert np.isnan(file[name][1 - ran]).all(), name
            assert np.isfinite(file[name][ran]).all(), name
        assert (file["reason"][1 - ran] == 0).all()
        assert (file["reason"][ran] == 2).all()
        names = meanings(file["limits/name"])
        assert names
        assert all(name.endswith(f"_{way}") for name in names)


@pytest.mark.parametrize(("way", "text"), [("up", "run-up"), ("down", "run-down")])
def test_only_the_run_that_was_made_is_drawn(one_way, way, text):
    style = pytest.importorskip("separatrix.style")
    from separatrix import open_result
    from separatrix.figures import sweep

    with style.context(), open_result(one_way / f"{way}.h5") as result:
        for figure in sweep.figures(result, "title").values():
            texts = {entry.get_text() for entry in figure.legends[0].get_texts()}
            assert texts & {"run-up", "run-down"} == {text}
            for ax in figure.axes:
                assert np.isfinite([ax.get_xlim(), ax.get_ylim()]).all()


def test_a_sweep_begins_at_the_crank_angle_of_the_start(separatrix, tmp_path, one_way):
    write_case(tmp_path)
    # so short that the first hold still knows its start
    short = options("run.duration=2", "start.crank_angle=2.0")
    succeed(separatrix, *NO_STARTS, *short, "-o", "turned.h5", folder=tmp_path)
    succeed(separatrix, *NO_STARTS, *short[:2], "-o", "zero.h5", folder=tmp_path)
    with h5py.File(tmp_path / "turned.h5") as turned, h5py.File(tmp_path / "zero.h5") as zero:
        for direction, end in ((0, 0), (1, -1)):
            assert turned["x_max"][direction, end] != zero["x_max"][direction, end]


def test_limits_have_the_unit_of_the_swept_parameter(separatrix, tmp_path, one_way):
    write_case(tmp_path)
    swept = "sweep={parameter='contact.upper', from=0.7, to=1.5, count=5, starts=[0, 0]}"
    succeed(separatrix, "sweep", "case.toml", *options(swept), folder=tmp_path)
    for path, name, unit in (
        (tmp_path / "case.sweep.h5", "contact_upper", "m"),
        (one_way / "both.h5", "drive_ratio", "1"),
    ):
        with h5py.File(path) as file:
            for item in (
                name,
                "limits/lower",
                "limits/upper",
                "limits/observed_lower",
                "limits/observed_upper",
            ):
                assert file[item].attrs["units"] == unit, item


def grazing_ratios(case):
    """Drive ratios at which the motion of a linear case without impact just reaches the wall."""
    drive, stiffness = case["drive"], float(case["restoring"]["stiffness"].split()[0])
    damping = float(case["friction"]["damping"].split()[0])
    number = np.arange(1, 1 + len(drive["cosine"]))
    angle = np.radians(float(drive["angle"].split()[0]))
    series = (np.array(drive["cosine"]) - 1j * np.array(drive["sine"])) * np.exp(1j * number * angle)
    phase = np.exp(1j * number * np.linspace(0, 2 * np.pi, 20001)[:, np.newaxis])

    def gap(ratio):
        omega = number * ratio * np.sqrt(stiffness)
        answer = series * stiffness / (stiffness - omega**2 + 1j * damping * omega)
        return 0.4 + 0.31055 + (phase @ answer).real.max() - 1.1

    roots = []
    for low, high in ((0.8, 0.95), (1.05, 1.2)):
        rises = gap(low) < 0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if (gap(middle) < 0) == rises else (low, middle)
        roots.append(low)
    return roots


@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_limits_are_where_the_settled_motion_touches_the_wall(separatrix, source_dir, tmp_path, tolerance):
    path = source_dir / "examples" / "sweep_viscous.toml"
    few = options("sweep.starts=[0, 0]", f"sweep.limit_tolerance={tolerance}")
    output = succeed(separatrix, "sweep", path, *few, "-o", "out.h5", folder=tmp_path).out
    up, down = grazing_ratios(tomllib.loads(path.read_text()))
    assert (up, down) == pytest.approx((0.870901, 1.114313), abs=1e-6)
    with h5py.File(tmp_path / "out.h5") as file:
        rows = zip(meanings(file["limits/name"]), file["limits/lower"], file["limits/upper"], strict=True)
        found = {name: (lower, upper) for name, lower, upper in rows}
    for name, ratio in (("impacts_start_up", up), ("impacts_start_down", down)):
        lower, upper = found[name]
        assert lower <= ratio <= upper
        assert upper - lower <= 1.01 * tolerance
    if tolerance < 1e-6:
        # as many digits as they are worth
        assert "0.8709006" in output


@pytest.mark.parametrize("command", ["basin", "sweep"])
def test_a_duration_below_a_drive_period_is_refused(separatrix, tmp_path, command):
    write_case(tmp_path)
    # at the ratio 0.8 of the sweep and 1.2 of the map a period is longer than 0.5 s
    outcome = run(separatrix, command, "case.toml", *options("run.duration=0.5"), folder=tmp_path)
    assert (outcome.code, len(outcome.messages)) == (65, 1)
    assert "run.duration" in outcome.err
    assert "period" in outcome.err
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]


def write_lists(folder: Path) -> list[str]:
    """Two lists of the same length; returns the command of the first one."""
    for name, shift in (("a", 0.0), ("b", 1e-9)):
        rows = [f"{i / 600 + shift},{i % 7 - 3}" for i in range(600)]
        (folder / f"{name}.csv").write_text("\n".join(["x0,v0", *rows]) + "\n")
    return ["points", "case.toml", "--list", "a.csv"]


def test_another_list_of_the_same_length_cannot_go_on(separatrix, tmp_path):
    write_case(tmp_path)
    command = write_lists(tmp_path)
    assert run(separatrix, *command, "--time-limit", "0.001", folder=tmp_path).code == 75
    before = (tmp_path / "case.points.h5.part").read_bytes()
    other = [*command[:-1], "b.csv", "--resume"]
    outcome = run(separatrix, *other, folder=tmp_path)
    assert (outcome.code, len(outcome.messages)) == (76, 1)
    assert (tmp_path / "case.points.h5.part").read_bytes() == before
    succeed(separatrix, *command, "--resume", folder=tmp_path)


def test_a_table_that_exists_is_not_replaced_without_force_not_even_by_a_resumed_run(separatrix, tmp_path):
    write_case(tmp_path)
    command = [*write_lists(tmp_path), "--csv", "out.csv"]
    assert run(separatrix, *command, "--time-limit", "0.001", folder=tmp_path).code == 75
    (tmp_path / "out.csv").write_text("something dear")
    for more in ([], ["--resume"]):
        outcome = run(separatrix, *command, *more, "-o", "case.points.h5", folder=tmp_path)
        assert outcome.code == 73
        assert (tmp_path / "out.csv").read_text() == "something dear"
    succeed(separatrix, *command, "--force", folder=tmp_path)
    assert (tmp_path / "out.csv").read_text().startswith("x0,v0,")


COARSE = ("axis[1].count=5", "axis[2].count=7")
TWO_PARAMETERS = (
    "axis=[{name='friction.kinetic_coefficient', from=0.15, to=0.25, count=3},"
    " {name='drive.ratio', from=1.15, to=1.25, count=3},"
    " {name='x0', from=0, to=1.1, count=5}, {name='v0', from=-6, to=6, count=7}]"
)


def test_a_branch_has_one_label_over_two_parameters(separatrix, tmp_path):
    write_case(tmp_path)
    succeed(separatrix, "basin", "case.toml", *options(TWO_PARAMETERS), folder=tmp_path)
    with h5py.File(tmp_path / "case.basin.h5") as file:
        catalogue = {name: file[f"catalogue/{name}"][()] for name in ("slice", "attractor", "regime")}
        period = file["catalogue/period"][()]
    assert set(catalogue["slice"]) == set(range(9))
    # here there is one free and one impacting motion in each slice, both of period 1
    assert (period == 1).all()
    labels = {}
    for regime, label in zip(catalogue["regime"], catalogue["attractor"], strict=True):
        labels.setdefault(int(regime), set()).add(int(label))
    assert {regime: len(found) for regime, found in labels.items()} == {1: 1, 2: 1}
    assert len(set.union(*labels.values())) == 2


def test_every_labelled_point_has_the_regime_of_its_attractor(separatrix, tmp_path):
    write_case(tmp_path)
    elastic = options(*COARSE, 'friction={law="none"}', "contact.restitution=1.0", "run.duration=20")
    succeed(separatrix, "basin", "case.toml", *elastic, folder=tmp_path)
    with h5py.File(tmp_path / "case.basin.h5") as file:
        label, regime = file["attractor"][()], file["regime"][()]
        of_label = dict(zip(file["catalogue/attractor"][()], file["catalogue/regime"][()], strict=True))
    for index in zip(*np.nonzero(label), strict=True):
        assert regime[index] == of_label[label[index]]


@pytest.mark.parametrize("command", ["basin", "trajectory"])
def test_a_pipe_is_not_replaced(separatrix, tmp_path, command):
    write_case(tmp_path)
    pipe = tmp_path / "pipe.h5"
    os.mkfifo(pipe)
    outcome = run(separatrix, command, "case.toml", "-o", "pipe.h5", "--force", folder=tmp_path)
    assert (outcome.code, outcome.out) == (73, "")
    assert "'pipe.h5'" in outcome.err
    assert pipe.is_fifo()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case.toml", "pipe.h5"]


def test_the_figures_of_a_plane_name_where_its_motions_start(results):
    style = pytest.importorskip("separatrix.style")
    from separatrix import open_result
    from separatrix.figures import basin

    captions = {}
    for kind in ("map", "stack", "plane"):
        with style.context(), open_result(results[kind]) as result:
            captions[kind] = basin.basin_map(results[kind], result, "regime", "title").separatrix_caption
    assert "$x_0$ = 0.4 m, $v_0$ = 0 m/s" in captions["plane"]
    assert "$x_0$" not in captions["map"]
    assert r"$\omega/\omega_0$ = 1.2" in captions["map"]
    for kind in ("stack", "plane"):
        assert r"$\omega/\omega_0$" not in captions[kind]
    assert r"$\mu" not in captions["plane"]


DOUBLE_WELL = """\
[body.ball]
mass = 1
[spring.well]
between = ["ball"]
law = "polynomial"
stiffness = -1
cubic = 1
damping = 0.5
[start]
x0 = 0.5
[run]
duration = 80
[attractors]
sample = 32
[[axis]]
name = "x0"
from = -2
to = 2
count = 8
[[axis]]
name = "v0"
from = -2
to = 2
count = 8
"""


def test_a_double_well_has_two_attractors_at_rest(separatrix, tmp_path):
    """By symmetry half of the starts come to each; settled, a motion takes no more steps than before."""
    (tmp_path / "case.toml").write_text(DOUBLE_WELL)
    outcome = succeed(separatrix, "trajectory", "case.toml", folder=tmp_path)
    assert "at its equilibrium" in outcome.out
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        assert file["x"][-1] == pytest.approx(1, abs=1e-8)
        assert file.attrs["regime"] == "at_rest"
    succeed(separatrix, "basin", "case.toml", folder=tmp_path)
    with h5py.File(tmp_path / "case.basin.h5") as file:
        labels, counts = np.unique(file["attractor"][()], return_counts=True)
    assert labels.tolist() == [1, 2]
    assert counts.tolist() == [32, 32]


OVERDAMPED = """\
start = { x0 = 0.3, v0 = 3 }
run = { duration = 50 }
[PART]
mass = 1
[SPRING]
law = "linear"
stiffness = 100
DAMPING
"""


@pytest.mark.parametrize("damping", [1e3, 1e5, 1e7])
@pytest.mark.parametrize("parts", [False, True])
def test_an_overdamped_machine_has_a_closed_form(separatrix, tmp_path, parts, damping):
    """Steps that follow the fast exponent would take for ever; the slow one keeps its digits beside it."""
    words = {
        "PART": "body",
        "SPRING": "restoring",
        "DAMPING": f'[friction]\nlaw = "viscous"\ndamping = {damping}',
    }
    if parts:
        words = {"PART": "body.a", "SPRING": "spring.s", "DAMPING": f'damping = {damping}\nbetween = ["a"]'}
    text = OVERDAMPED
    for word, meaning in words.items():
        text = text.replace(word, meaning)
    write_case(tmp_path, text)
    succeed(separatrix, "trajectory", "case.toml", folder=tmp_path)
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        time, x = file["time"][()], file["x"][()]
        missing = file.attrs["energy_closing_error"]
    fast = damping / 2 + np.sqrt((damping / 2) ** 2 - 100)
    slow = 100 / fast
    expected = ((3 + fast * 0.3) * np.exp(-slow * time) - (3 + slow * 0.3) * np.exp(-fast * time)) / (
        fast - slow
    )
    np.testing.assert_allclose(x, expected, rtol=1e-10, atol=1e-14)
    assert abs(missing) < 1e-9


AT_FREE_LENGTH = """\
[body.b]
mass = 1
[spring.b]
between = ["b"]
stiffness = 10
free_length = 0.1
[start]
x0 = 0.1
[run]
duration = 1
"""


def test_a_spring_at_its_free_length_holds_no_energy(separatrix, tmp_path):
    """Nor does it move what it holds, but for rounding; stretched, it holds k (x - l)^2/2.

    So it does where its foot is given.
    """
    write_case(tmp_path, AT_FREE_LENGTH)
    output = succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", folder=tmp_path).out
    assert output.startswith("at_rest: amplitude 0.0 m, v_max 0.0 m/s")
    with h5py.File(tmp_path / "out.h5") as file:
        assert np.abs(file["potential_energy"][()]).max() < 1e-16
    moving = ["trajectory", "case.toml", *options("start.x0=0.2"), "-o", "out.h5", "--force"]
    assert succeed(separatrix, *moving, folder=tmp_path).out.startswith("non_impact")
    with h5py.File(tmp_path / "out.h5") as file:
        extension = file["x"][()] - 0.1
        np.testing.assert_allclose(file["potential_energy"], 5 * extension**2, rtol=0, atol=1e-15)
    foot = '[body.foot]\nmass = 1\n[drive.foot]\nbody = "foot"\nlaw = "motion"\nmean = 0.3\nfrequency = 6\n'
    write_case(tmp_path, AT_FREE_LENGTH.replace('["b"]', '["foot", "b"]') + foot + '[watch]\nbody = "b"\n')
    succeed(separatrix, "trajectory", "case.toml", "-o", "foot.h5", folder=tmp_path)
    with h5py.File(tmp_path / "foot.h5") as file:
        extension = file["x"][()] - 0.4
        np.testing.assert_allclose(file["potential_energy"], 5 * extension**2, rtol=0, atol=1e-15)


def test_a_period_without_a_mode_is_a_unit_of_time(separatrix, tmp_path):
    for spring, words in (("", "unit of time 1.0"), (AT_FREE_LENGTH, "period of the slowest mode 1.98692 s")):
        body = '[body.b]\nmass = 1\nload = "-9.81 N"\n[run]\nduration = 1\n[start]\nx0 = 1\n'
        write_case(tmp_path, spring or body)
        output = succeed(
            separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", folder=tmp_path
        ).out
        assert words in output


def test_a_run_shorter_than_a_drive_period_is_of_seconds(separatrix, tmp_path):
    write_case(tmp_path)
    command = ["trajectory", "case.toml", *options("run.duration=1e-3"), "-o", "out.h5"]
    output = succeed(separatrix, *command, folder=tmp_path).out
    assert "(last 0.000250000 s)" in output
    assert "per period" not in output
    assert "drive periods" not in output


def test_a_motion_that_leaves_reports_when(separatrix, tmp_path):
    """x = x0 cosh(10 t) is at 1e6 m at t = ln(2e8)/10; captions have no steady motion, no drive."""
    write_case(
        tmp_path,
        AT_FREE_LENGTH.replace("10\n", "-100\n").replace("0.1", "0.01").replace("free_length = 0.01\n", ""),
    )
    longer = options("run.duration=10")
    command = ["trajectory", "case.toml", *longer, "-o", "out.h5"]
    output = succeed(separatrix, *command, folder=tmp_path).out
    found = re.search(r"ended before the end: left_domain after (\d\.\d+) s; 0 events", output)
    assert found is not None, output
    assert float(found[1]) == pytest.approx(np.log(2e8) / 10, abs=0.011)
    exponents = succeed(separatrix, "stability", "case.toml", "--periods", "64", *longer, folder=tmp_path).out
    assert "not known: the motion grows without bound, or leaves the domain (run.domain)" in exponents
    assert cli.main([str(tmp_path / "out.h5"), "--formats", "svg"]) == 0
    with open_result(tmp_path / "out.h5") as result:
        assert left_text(result, 1e6) == f"left the domain after {float(found[1]):.6g} s"
    text = (tmp_path / "out_history.svg").read_text()
    assert "; left the" in text
    assert "steady motion" not in text
    assert "drive period" not in text


@pytest.mark.parametrize("example", ["structure_impact_damper", "pair_backlash", "basin_coulomb"])
def test_a_motion_in_python_is_that_of_the_command(separatrix, library, source_dir, example, tmp_path):
    """The same variables with the same bits, of every body and joint too."""
    case = sx.load(source_dir / "examples" / f"{example}.toml").with_(
        {"run.duration": 5.0, "run.window": 2.0}
    )
    succeed(separatrix, "trajectory", case.save(tmp_path / "case.toml"), "-o", "motion.h5", folder=tmp_path)
    mine = sx.trajectory(case)
    with sx.open_result(tmp_path / "motion.h5") as file:
        assert set(mine.variables) == set(file.variables)
        for name in file.variables:
            np.testing.assert_array_equal(mine[name], file[name], name)
            assert mine[name].attrs["units"] == file[name].attrs["units"]
        assert mine.attrs["regime"] == file.attrs["regime"]


def test_a_motion_of_several_bodies_that_is_given_up_is_an_error(separatrix, library):
    parts = {
        "body": {"a": {"mass": 1.0}, "b": {"mass": 1.0}},
        "spring": {"s": {"between": ["a", "b"], "stiffness": 1.0}},
        "contact": {"stop": {"between": ["a"], "law": "newton", "restitution": 0.9, "upper": 0.3}},
        "start": {"x0": 0.2, "v0": 1.0},
        "run": {"duration": 100.0, "window": 10.0},
        "integrator": {"event_budget": 10},
    }
    case = sx.Case.from_dict(parts)
    message = r"given up: event_budget.* after [0-9.]+ s \(partial=True"
    with pytest.raises(GivenUpError, match=message) as raised:
        sx.trajectory(case)
    assert {"a_x", "b_x"} <= set(raised.value.result.variables)
    assert sx.trajectory(case, partial=True).attrs["reason"] == "event_budget"
