# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `branches`: its file, its log, its figure, and what it refuses."""

import json
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from program import differences, succeed
from separatrix import style, table
from separatrix.figures import branches
from separatrix.open import decode_flags, decode_words, open_result


@pytest.fixture
def run(separatrix: Path, source_dir: Path, tmp_path: Path):
    """Runs the command on a validation case; returns the file and what ended."""

    def run_it(case: str, *options: str) -> tuple[Path, subprocess.CompletedProcess]:
        out = tmp_path / "out.h5"
        path = source_dir / "examples" / "validation" / f"{case}.toml"
        return out, subprocess.run(
            [separatrix, "branches", path, "-o", out, *options], capture_output=True, text=True, check=False
        )

    return run_it


AMPLITUDE = ("--parameter", "drive.amplitude", "--from", "50 mm", "--to", "0.3", "--searches", "3")


def test_a_fold_beside_a_graze_is_in_the_file_the_log_and_the_figure(run):
    out, ended = run("impact_coco", *AMPLITUDE, "--json")
    assert ended.returncode == 0, ended.stderr
    points = [line for line in map(json.loads, ended.stdout.splitlines()) if line["event"] == "point"]
    logged = {line["label"]: line["parameter"] for line in points}
    assert logged["SN"] == pytest.approx(0.099970753628, abs=1e-11)
    assert logged["GR-fold"] == pytest.approx(0.1, abs=1e-11)
    with open_result(out) as result:
        labels = decode_flags(result["label"]).values
        fold = np.flatnonzero(labels == "SN")
        assert fold.size == 1
        assert result["parameter"].values[fold[0]] == logged["SN"]
        assert result["multiplier_real"].values[fold[0], 0] == pytest.approx(1, abs=1e-8)
        # the free motion, the saddle between graze and fold, the impacting motion
        words = decode_words(result["event_word"]).values
        stable = result["stable"].values == 1
        assert set(words) == {".", "R."}
        assert stable[words == "."].all()
        between = (result["parameter"].values < 0.0999999) & (words == "R.") & (labels == "none")
        assert (~stable[between]).any() and stable[words == "R."].any()
        with style.context():
            figure = branches.figures(result, "title")["branches"]
        texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert "fold (SN)" in texts and "graze with a fold (GR-fold)" in texts


def test_a_family_of_orbits_is_called_one(run):
    over = ("--parameter", "drive.ratio", "--from", "0.49", "--to", "0.51", "--searches", "3")
    out, ended = run("dry_friction_family", *over)
    assert ended.returncode == 0, ended.stderr
    assert "orbits that are not isolated (a multiplier within 1e-6 of 1: a family) were met" in ended.stdout
    with open_result(out) as result:
        assert "not_known" not in set(decode_flags(result["label"]).values)
        assert result["branch"].values.max() == 1


def test_an_impact_may_pass_the_section_where_a_doubling_ends(run):
    """A machine without symmetry has no branch points: the doubled orbits end in the orbit that doubled."""
    out, ended = run(
        "budd_dux", "--parameter", "contact.upper", "--from", "-1", "--to", "-0.85", "--searches", "3"
    )
    assert ended.returncode == 0, ended.stderr
    with open_result(out) as result:
        labels = decode_flags(result["label"]).values
        assert not {"BP", "closed"} & set(labels)
        doubled = (labels == "PD") & (result["period"].values == 4)
        near = doubled & (abs(result["parameter"].values + 0.9435527583705) < 1e-9)
        assert near.sum() == 1
        assert result["multiplier_real"].values[near][0] == pytest.approx([1, 0.8**16], abs=1e-8)


STOPS = """
body = { mass = 2, gravity = 9.81 }
restoring = { law = "linear", stiffness = 50 }
friction = { law = "viscous", damping = 0.6 }
contact = { law = "newton", restitution = 0.7, upper = 0.3, lower = -0.3 }
drive = { law = "harmonic", amplitude = 0.15, ratio = 1.3 }
run.duration = 200
start.x0 = 0.05
"""


def test_what_begins_where_both_stops_are_touched_at_once_is_followed_once(separatrix, tmp_path):
    case, out = tmp_path / "stops.toml", tmp_path / "out.h5"
    case.write_text(STOPS)
    words = ("--parameter", "drive.ratio", "--from", "0.65", "--to", "0.8", "--searches", "3")
    command = [separatrix, "branches", case, "-o", out, *words, "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    # where the linear motion is as large as the play: k a = |k - m w^2 + i c w| 0.3
    stiffness, mass, damping, natural = 50, 2, 0.6, 5
    coefficients = [mass**2, damping**2 - 2 * stiffness * mass, stiffness**2 - (stiffness * 0.15 / 0.3) ** 2]
    graze = np.sqrt(np.roots(coefficients).min()) / natural
    points = [line for line in map(json.loads, ended.stdout.splitlines()) if line["event"] == "point"]
    at = [line for line in points if abs(line["parameter"] - graze) < 1e-10]
    # the motion without impacts goes on with two; one on a side begins there, and its mirror image
    assert {line["label"] for line in at} == {"GR"}
    words = sorted(line["word"] for line in at if line["word"].count(".") == 1)
    assert words == [".", "L.", "R."]
    with open_result(out) as result:
        both = (decode_words(result["event_word"]).values == "RL.") & (result["parameter"].values < 0.8)
        values = np.sort(result["parameter"].values[both])
        assert np.diff(values).min() > 1e-9
        assert set(result["symmetric"].values[both]) == {1}
        # what touches both stops has one amplitude: a point on the section is drawn
        with style.context():
            figure = branches.figures(result, "title")["branches"]
        assert figure.axes[0].get_ylabel().startswith("position at crank angle 0")


STOP, PAIR = "[contact]\nupper = 0.3\n", "[contact]\nupper = 0.3\nlower = -0.3\n"


@pytest.mark.parametrize(("case", "parameter", "amplitude", "of_section"), [
    # few points, or one amplitude without impacts
    (STOP, "drive.ratio", [0.1], False),
    (PAIR, "drive.ratio", [0.1, 0.2], False),
    (PAIR, "contact.restitution", 8 * [0.2], False),
    ("[contact]\nlaw = \"none\"\n", "body.mass", 8 * [0.3], False),
    (PAIR, "drive.ratio", [0.3], True),
    (PAIR, "drive.ratio", [0.1, 0.2, 0.25, 0.3], True),
    (PAIR, "drive.ratio", [0.1, 0.2, 0.25, 0.26, 0.3], False),
    # the play is the parameter itself: 0.3 + 0.9 and 0.3 + 1
    (PAIR, "contact.upper", [0.6, 0.65], True),
    ("[contact.a]\nupper = 0.3\nlower = -0.3\n[contact.b]\nupper = 1.0\n", "drive.ratio", 3 * [0.3], True),
])  # fmt: skip
def test_a_point_on_the_section_is_drawn_where_orbits_touch_both_stops(
    case, parameter, amplitude, of_section
):
    amplitude = np.array(amplitude)
    columns = {"x_min": -amplitude, "x_max": amplitude, "x": 0 * amplitude}
    columns["parameter"] = 0.9 + 0.1 * np.arange(amplitude.size)
    result = xr.Dataset({name: ("point", values, {"units": "m"}) for name, values in columns.items()})
    result.attrs = {"resolved_case": case, "parameter": parameter}
    found, text = branches.height(result)
    assert text.startswith("position" if of_section else "amplitude")
    assert found == pytest.approx(columns["x"] if of_section else amplitude)


def test_curves_in_two_parameters_meet_at_the_resonant_graze(run):
    out, ended = run(
        "impact_coco", *AMPLITUDE, "--free", "drive.ratio", "--free-from", "0.9", "--free-to", "1.1", "--json"
    )
    assert ended.returncode == 0, ended.stderr
    logged = [
        line for line in map(json.loads, ended.stdout.splitlines()) if line["event"] == "codimension_two"
    ]
    meeting = [line for line in logged if (line["label"], line["second"]) == ("SN", "GR")]
    assert [line["free"] for line in meeting] == pytest.approx([0.998749217772], abs=1e-9)
    with open_result(out) as result:
        labels = decode_flags(result["curve_label"]).values
        amplitude, ratio = result["curve_parameter"].values, result["curve_free"].values
        assert set(labels) == {"GR", "SN"}
        grazes = labels == "GR"
        assert amplitude[grazes] == pytest.approx(np.hypot(1 - ratio**2, 0.1 * ratio)[grazes], abs=1e-10)
        assert (ratio[grazes].min(), ratio[grazes].max()) == pytest.approx((0.9, 1.1), abs=1e-9)
        # the folds leave the grazes with the square of the distance
        away = (ratio - 0.998749217772)[labels == "SN"]
        gap = (np.hypot(1 - ratio**2, 0.1 * ratio) - amplitude)[labels == "SN"]
        near = (away > 1e-3) & (away < 1e-2)
        assert near.sum() >= 2
        assert np.polyfit(np.log(away[near]), np.log(gap[near]), 1)[0] == pytest.approx(2, abs=0.02)
        with style.context():
            figure = branches.figures(result, "title")["curves"]
        texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert {"fold (SN)", "graze (GR)", "codimension two"} <= set(texts)


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        ((), 64, "--parameter NAME is missing"),
        (("--parameter", "drive.ration", "--from", "1", "--to", "2"), 65, "drive.ratio"),
        (("--parameter", "x0", "--from", "1", "--to", "2"), 65, "--parameter: found 'x0'"),
        (("--parameter", "body.mass"), 65, "--from and --to are needed"),
        (("--parameter", "drive.amplitude", "--from", "2", "--to", "1"), 65, "a range that rises"),
        (("--parameter", "contact.restitution", "--from", "0.5", "--to", "1.5"), 65, "--to"),
        (
            ("--parameter", "drive.amplitude", "--from", "1 s", "--to", "2"),
            65,
            "--from: found '1 s', allowed a number in m",
        ),
        (("--parameter", "drive.amplitude", "--from", "", "--to", "2"), 64, "--from: found ''"),
        ((*AMPLITUDE, "--free", "drive.amplitude"), 65, "--free: found 'drive.amplitude'"),
        ((*AMPLITUDE, "--free", "drive.ratio"), 65, "--free-from and --free-to are needed"),
        (
            (*AMPLITUDE, "--free", "drive.ratio", "--free-from", "2", "--free-to", "3"),
            65,
            "holds drive.ratio",
        ),
        ((*AMPLITUDE, "--free-from", "2"), 64, "--free NAME, which is missing"),
    ],
)
def test_what_makes_no_sense_is_refused(run, options, code, message):
    out, ended = run("impact_coco", *options)
    assert ended.returncode == code
    assert message in ended.stderr
    assert not out.exists()


def test_a_parameter_without_effect_has_straight_branches(run):
    out, ended = run(
        "impact_coco", "--parameter", "body.gravity", "--from", "1", "--to", "9", "--searches", "2"
    )
    assert ended.returncode == 0, ended.stderr
    with open_result(out) as result:
        for number in np.unique(result["branch"].values):
            chosen = result["branch"].values == number
            assert np.ptp(result["x"].values[chosen]) < 1e-9
        assert set(decode_flags(result["label"]).values) == {"none", "end_of_range"}
    assert "body.gravity has no effect on any orbit that was found" in ended.stdout
    assert "ends: end of range" in ended.stdout


BETWEEN_STOPS_OF_ONE = """
body = { mass = 1 }
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 0.1 }
contact = { law = "newton", restitution = 0.8, upper = 1, lower = -1 }
drive = { law = "harmonic", amplitude = 0.5, ratio = 0.7 }
run = { duration = 100 }
"""
BETWEEN_STOPS_OF_A_STRUCTURE = """
body.a.mass = 1
spring.s = { between = ["a"], stiffness = 1, damping = 0.1 }
contact.wall = { between = ["a"], law = "newton", restitution = 0.8, upper = 1, lower = -1 }
drive.d = { law = "force", body = "a", amplitude = 0.5, frequency = 0.7 }
watch.body = "a"
run = { duration = 100 }
"""
LOSSLESS = """
body = { mass = 1, gravity = 1 }
restoring = { law = "linear", stiffness = 1 }
contact = { law = "newton", restitution = 1.0, upper = 1 }
drive = { law = "harmonic", amplitude = 0.5, ratio = 2.3 }
start = { x0 = 0.1 }
run = { duration = 300 }
"""
TOUCHED_FURTHER_ON = """
body = { mass = 1.372, gravity = 0.7288629737609329 }
restoring = { law = "linear", stiffness = 1.182 }
friction = { law = "coulomb_viscous", kinetic_coefficient = 0.04, static_coefficient = 0.06, damping = 0.73 }
contact = { law = "kelvin_voigt", stiffness = 23.64, damping = 0.637, tension = 0, upper = 0.606 }
drive = { law = "harmonic", amplitude = 0.358, ratio = 2.124 }
run = { duration = 200 }
"""


def test_what_stays_on_the_unit_circle_does_not_pass_it(separatrix: Path, tmp_path: Path):
    """Without losses the product of the multipliers is 1 but for rounding; gravity moves nothing."""
    (tmp_path / "case.toml").write_text(LOSSLESS)
    words = ("--parameter", "body.gravity", "--from", "0.5", "--to", "2", "--searches", "3", "-o", "out.h5")
    output = succeed(separatrix, "branches", "case.toml", *words, folder=tmp_path).out
    assert "body.gravity has no effect" in output
    with open_result(tmp_path / "out.h5") as result:
        assert set(decode_flags(result["label"]).values) == {"none", "end_of_range"}


def test_a_parameter_may_have_its_effect_further_on(separatrix: Path, tmp_path: Path):
    """No orbit at the values searched touches the stop, but others of their branch do."""
    (tmp_path / "case.toml").write_text(TOUCHED_FURTHER_ON)
    words = (
        "--parameter",
        "contact.upper",
        "--from",
        "0.006",
        "--to",
        "1.206",
        "--searches",
        "4",
        "-o",
        "out.h5",
    )
    output = succeed(separatrix, "branches", "case.toml", *words, folder=tmp_path).out
    assert "GR at contact.upper" in output
    assert "no effect" not in output


@pytest.mark.parametrize("one", [BETWEEN_STOPS_OF_ONE, BETWEEN_STOPS_OF_A_STRUCTURE])
def test_a_range_in_which_stops_change_sides_is_refused(separatrix: Path, tmp_path: Path, one: str):
    (tmp_path / "case.toml").write_text(one)
    name = "contact.upper" if one == BETWEEN_STOPS_OF_ONE else "contact.wall.upper"
    words = ("--parameter", name, "--from", "-2", "--to", "1", "-o", "out.h5")
    ended = subprocess.run(
        [separatrix, "branches", "case.toml", *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert ended.returncode == 65
    assert "lower: found -1.0 m, allowed" in ended.stderr
    assert "upper = -2.0 m" in ended.stderr
    assert not (tmp_path / "out.h5").exists()


@pytest.mark.parametrize(
    ("case", "message"),
    [
        ("../measured_pendulum", "drive.law: one body without a drive has no section"),
        ("../measured_platform", "drive.law: the variations of a body under a measured force"),
    ],
)
def test_a_refusal_names_what_the_case_has(run, case, message):
    out, ended = run(case, "--parameter", "body.mass", "--from", "1", "--to", "2")
    assert ended.returncode == 65 and message in ended.stderr
    assert not out.exists()


# hits both stops in turn; its motion of three periods is symmetric on one side of 0.8209 only
BETWEEN_STOPS = """
body = { mass = 1, gravity = 10 }
restoring = { law = "linear", stiffness = 25 }
friction = { law = "coulomb_viscous", damping = 0.4, kinetic_coefficient = 0.03 }
contact = { law = "newton", restitution = 0.6, upper = 0.3, lower = -0.3 }
drive = { law = "harmonic", amplitude = 0.12, ratio = 1.0 }
axis = [{ name = "x0", from = -0.3, to = 0.3, count = 30 }, { name = "v0", from = -4, to = 4, count = 30 }]
"""


def test_both_arms_that_break_the_symmetry_end_in_the_branch_point(separatrix, tmp_path):
    (tmp_path / "stops.toml").write_text(BETWEEN_STOPS)
    words = "branches stops.toml --parameter drive.ratio --from 0.81 --to 0.83 --searches 6 -o out.h5 -q"
    subprocess.run([separatrix, *words.split()], cwd=tmp_path, check=True)
    with open_result(tmp_path / "out.h5") as result:
        labels = decode_flags(result["label"]).values
        at = labels == "BP"
        values, branch = result["parameter"].values[at], result["branch"].values[at]
        # each branch locates it by itself
        assert np.ptp(values) < 1e-12
        # the symmetric branch, and both arms: two branches that end there, or one that passes
        symmetric = [
            result["symmetric"].values[result["branch"].values == one].mean() > 0.5 for one in branch
        ]
        assert sum(symmetric) == 1
        words = set()
        for number in set(branch) - {branch[symmetric.index(True)]}:
            words |= set(decode_words(result["event_word"][result["branch"].values == number]).values)
        assert words == {"L..R.", "RL..R.", "L.L.R."}
        assert np.abs(result["multiplier_real"].values[at, 0] - 1).max() < 1e-8
        # Newton's method on the map over half a period, which an independent integrator flew
        assert 0.82089345 < values[0] < 0.82092812
        assert "not_known" not in set(labels)


# fold at which the impacting motion ends in a run up; grazes at which impacts start in it and in a run down
ENDS = {
    "coulomb": (1.341271279226, 0.8767783170526, 1.110177089292),
    "viscous": (1.373806398979, 0.8709006271277, 1.114312918750),
    "stribeck": (1.341270651726, 0.8767755243508, 1.110175552555),
}


@pytest.mark.parametrize("friction", ENDS)
def test_what_begins_and_ends_the_impacting_motion(friction, run):
    out, ended = run(f"../sweep_{friction}", "--parameter", "drive.ratio", "--searches", "1")
    assert ended.returncode == 0, ended.stderr
    with open_result(out) as result:
        labels, period = decode_flags(result["label"]).values, result["period"].values
        values, impacts = result["parameter"].values, result["impacts"].values
        multipliers = result["multiplier_real"].values + 1j * result["multiplier_imag"].values
        last = np.flatnonzero(np.diff(result["branch"].values, append=0, prepend=0)) - 1
        assert values[(labels == "SN") & (period == 1)] == pytest.approx([ENDS[friction][0]], abs=1e-10)
        assert values[(labels == "GR") & (period == 1)] == pytest.approx([ENDS[friction][1]], abs=1e-10)
        assert values[(labels == "GR-fold") & (period == 1)] == pytest.approx([ENDS[friction][2]], abs=1e-10)
        for k in np.flatnonzero(np.isin(labels, ["SN", "PD"])):
            wanted = 1 if labels[k] == "SN" else -1
            # where a branch ends in the doubling that it came from it has +1
            ends_here = k in last or k - 1 in last
            apart = [np.abs(multipliers[k] - way).min() for way in ((wanted, 1) if ends_here else (wanted,))]
            assert min(apart) < 1e-8
        if friction == "viscous":
            # flights shrink areas by exp(-b T/m), an impact by the square of the restitution
            calm = np.abs(multipliers).max(axis=1) < 1e2
            product = multipliers.prod(axis=1).real
            free = calm & (impacts == 0)
            rate = np.log(product[free]) * values[free] / period[free]
            assert np.ptp(rate) < 1e-11 * np.abs(rate).max()
            expected = 0.25 ** impacts[calm] * np.exp(rate.mean() * period[calm] / values[calm])
            # long orbits beside a graze have large derivatives and a small determinant
            bar = np.where(period[calm] == 1, 1e-12, 1e-10)
            assert np.all(np.abs(product[calm] - expected) < bar)


def test_jumps_of_a_sweep_are_folds_and_grazes(separatrix, source_dir, tmp_path):
    """Each limit that `sweep` brackets holds one of these, and which one is known from the branches."""
    out = tmp_path / "sweep.h5"
    case = source_dir / "examples" / "sweep_coulomb.toml"
    subprocess.run(
        [
            separatrix,
            "sweep",
            case,
            "-q",
            "-o",
            out,
            "--set",
            "sweep.starts=[2,2]",
            "--set",
            "sweep.step=0.02",
        ],
        check=True,
    )
    with open_result(out) as result:
        limits = table(result, "limits")
        names, lows, highs = (limits[key].values for key in ("name", "lower", "upper"))
    fold, graze, jump = ENDS["coulomb"]
    for name, value in {
        "impacts_stop_up": fold,
        "impacts_start_up": graze,
        "impacts_start_down": jump,
    }.items():
        (k,) = np.flatnonzero(names == name)
        assert lows[k] <= value <= highs[k]


def test_a_signal_ends_it(separatrix: Path, source_dir: Path, tmp_path: Path) -> None:
    """Nothing is kept that could be resumed."""
    process = subprocess.Popen(
        [
            separatrix,
            "branches",
            source_dir / "examples" / "sweep_stribeck.toml",
            "--parameter",
            "drive.ratio",
            "-q",
        ],
        cwd=tmp_path,
    )
    time.sleep(0.5)
    process.terminate()
    assert process.wait(10) == -signal.SIGTERM
    assert list(tmp_path.iterdir()) == []


# soft stops: beside two of its branch points lies a graze, and several of its branches close
SOFT_STOPS = BETWEEN_STOPS.replace(
    '"newton", restitution = 0.6', '"kelvin_voigt", stiffness = 800, damping = 2'
)


def test_every_turn_has_one_label(separatrix: Path, tmp_path: Path):
    """The parameter turns in folds and branch points, each once on a branch, its mirror image aside."""
    case, out = tmp_path / "case.toml", tmp_path / "out.h5"
    case.write_text(SOFT_STOPS)
    words = ("--parameter", "drive.ratio", "--from", "0.7", "--to", "0.95", "--searches", "4", "-o", out)
    ended = subprocess.run(
        [separatrix, "branches", case, *words], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    turns = 0
    with open_result(out) as result:
        numbers, parameter = result["branch"].values, result["parameter"].values
        labels, speeds = decode_flags(result["label"]).values, result["v"].values
        for number in np.unique(numbers):
            chosen = numbers == number
            rises, label = np.diff(parameter[chosen]), labels[chosen]
            for k in np.flatnonzero((rises[:-1] * rises[1:] < 0) & (abs(rises[1:]) > 1e-11)):
                turns += 1
                assert set(label[k : k + 3]) & {"SN", "BP", "GR-fold", "not_known"}
            events = [
                (name, round(at, 9), round(speed, 5))
                for name, at, speed in zip(label, parameter[chosen], speeds[chosen], strict=True)
                if name in {"SN", "PD"}
            ]
            assert len(events) == len(set(events))
    assert turns > 5


@pytest.mark.parametrize("ranks", [2, 5])
def test_the_ranks_share_the_search_and_the_bits_are_the_same(mpi_separatrix, tmp_path, ranks):
    case = Path(__file__).parents[3] / "examples/validation/impact_coco.toml"
    words = ["branches", case, "--parameter", "drive.amplitude", "--from", "0.05", "--to", "1.2", "-o"]
    succeed(mpi_separatrix, *words, "one.h5", folder=tmp_path)
    succeed(mpi_separatrix, *words, "many.h5", folder=tmp_path, ranks=ranks)
    assert differences(tmp_path / "one.h5", tmp_path / "many.h5") == []
