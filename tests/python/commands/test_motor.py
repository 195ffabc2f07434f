# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines with a motor: outcomes of a run-up, branches and exponents, maps on several ranks."""

import itertools
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
import separatrix as sx
from program import differences, run, succeed

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
IMPACT = EXAMPLES / "motor_impact.toml"
STOPPED = 75
# The yoke without friction and stop of a published benchmark, method 1: its run-up ends in a fold.
YOKE = """\
body = { mass = 1, gravity = 1 }
restoring = { law = "linear", stiffness = 88.82643960980423 }
friction = { law = "viscous", damping = 0.5 }
drive = { law = "harmonic", amplitude = 0.02 }
start = { x0 = 0.02, v0 = 0 }
run = { duration = 120, window = 20 }
[motor]
law = "dc"
voltage = 7
torque_constant = 0.5
resistance = 5
inertia = 0.05
bearing_damping = 0.002
"""
# From standstill the least voltage that passes the resonance.
THRESHOLD = 6.383280023598


def outcome(separatrix: Path, case: Path, folder: Path, *settings: str) -> str:
    """The last word of the line about the crank."""
    sets = [f"--set={setting}" for setting in (*settings, "run.average='window'")]
    report = succeed(separatrix, "trajectory", case, *sets, "-o", "motion.h5", "--force", folder=folder).out
    return re.search(r"^crank speed .*: (\w+)$", report, re.MULTILINE)[1]


@pytest.fixture
def yoke(tmp_path: Path) -> Path:
    """The case in a file."""
    (tmp_path / "yoke.toml").write_text(YOKE)
    return tmp_path / "yoke.toml"


def test_outcomes_of_a_run_up(separatrix, yoke, tmp_path):
    """On both sides of the published threshold; held by the bearing; with a negative voltage."""
    assert outcome(separatrix, yoke, tmp_path, f"motor.voltage={THRESHOLD - 1e-6}") == "captured"
    assert outcome(separatrix, yoke, tmp_path, f"motor.voltage={THRESHOLD + 1e-6}") == "passed"
    assert outcome(separatrix, yoke, tmp_path, "motor.bearing_friction=0.8", "run.duration=20") == "stalled"
    assert outcome(separatrix, yoke, tmp_path, "motor.voltage=-3", "run.duration=20") == "reversed"


def test_crank_that_does_not_get_round(separatrix, yoke, tmp_path):
    """Friction holds the body; its spring turns the crank back, which comes to rest after a while."""
    held = ("friction={law='coulomb', kinetic_coefficient=10}", "motor.voltage=0.3", "run.window=2")
    assert outcome(separatrix, yoke, tmp_path, *held, "run.duration=6") == "rocking"
    assert outcome(separatrix, yoke, tmp_path, *held, "run.duration=60") == "stalled"


@pytest.mark.parametrize("dry", [False, True], ids=["viscous", "coulomb"])
def test_stalled_crank_is_an_attractor(separatrix, yoke, tmp_path, dry):
    """Every start ends at rest: the bearing holds the crank, and friction ends the motion of the body."""
    if dry:
        yoke.write_text(
            yoke.read_text().replace('"viscous", damping = 0.5', '"coulomb", kinetic_coefficient = 0.2')
        )
    axes = "{name='motor.crank_speed', from=0, to=20, count=5}, {name='x0', from=-0.3, to=0.3, count=3}"
    sets = ["motor.voltage=0.3", "motor.bearing_friction=0.05", f"axis=[{axes}]", "attractors.sample=16"]
    succeed(separatrix, "basin", yoke, *(f"--set={one}" for one in sets), "-o", "map.h5", folder=tmp_path)
    with sx.open_result(tmp_path / "map.h5") as result:
        assert set(result.separatrix.decoded("reason").values.ravel()) == {"settled"}
        assert set(result.separatrix.decoded("regime").values.ravel()) == {"at_rest"}
        settle, start = result["settle_time"].values, result["motor_crank_speed"].values
        rest = result.separatrix.attractors.iloc[0]
    assert settle[start == 0].max() == 0
    assert (settle[start > 0] > 0).all()
    assert settle.max() < 60
    assert rest["crank_outcome"] == "stalled"
    assert rest["crank_speed"] == 0
    np.testing.assert_allclose(rest["torque"], 0.5 * 0.3 / 5, rtol=1e-12)
    np.testing.assert_allclose(rest["heat_power"], 0.3**2 / 5, rtol=1e-12)
    if not dry:
        np.testing.assert_allclose(rest["x"], 0.02 * np.cos(rest["crank_angle"]), atol=1e-12)


def test_turning_crank_beside_a_held_body(separatrix, yoke, tmp_path):
    """Dry friction holds the body: it is at rest, and the crank turns."""
    yoke.write_text(
        yoke.read_text().replace('"viscous", damping = 0.5', '"coulomb", kinetic_coefficient = 10')
    )
    axes = "{name='motor.crank_speed', from=3, to=15, count=3}, {name='x0', from=-0.05, to=0.05, count=3}"
    sets = [f"axis=[{axes}]", "attractors.sample=16"]
    succeed(separatrix, "basin", yoke, *(f"--set={one}" for one in sets), "-o", "map.h5", folder=tmp_path)
    with sx.open_result(tmp_path / "map.h5") as result:
        assert set(result.separatrix.decoded("reason").values.ravel()) == {"settled"}
        rest = result.separatrix.attractors.iloc[0]
    # 0.1 U = (0.05 + 0.002) w in the mean
    np.testing.assert_allclose(rest["crank_speed"], 0.7 / 0.052, rtol=1e-2)


def test_sweep_out_of_rest(separatrix, yoke, tmp_path):
    """The bearing holds the crank up to U = R H/k; the hold before has the torque of a crank at rest."""
    text = '[sweep]\nparameter = "motor.voltage"\nfrom = 0.4\nto = 0.6\nstep = 0.1\n'
    text += 'directions = "up"\nstarts = [0, 0]\n'
    yoke.write_text(yoke.read_text() + text)
    sets = ["--set=motor.bearing_friction=0.045", "--set=run.duration=60"]
    succeed(separatrix, "sweep", yoke, *sets, "-o", "sweep.h5", folder=tmp_path)
    with h5py.File(tmp_path / "sweep.h5") as file:
        names = file["crank_outcome"].attrs["flag_meanings"].split()
        assert [names[code] for code in file["crank_outcome"][0]] == ["stalled", "captured", "captured"]
        np.testing.assert_allclose(file["torque"][0, 0], 0.04, rtol=1e-12)
        assert file["amplitude"][0, 0] == 0


@pytest.mark.parametrize(("case", "voltage", "speed", "expected"), [
    ("impact", 5.7, 9, "captured"),
    ("impact", 6.1, 10, "captured"),
    ("impact", 6.1, 16, "passed"),
    ("unbalance", 8, 9, "captured"),
    ("lever", None, 0, "captured"),
    ("lever", None, 18, "passed"),
])  # fmt: skip
def test_impacts_raise_the_resonance(separatrix, tmp_path, case, voltage, speed, expected):
    """All these cranks turn faster than body and spring would oscillate; those before the resonance hit."""
    sets = [f"motor.crank_speed={speed}", "run.duration=60", "run.window=12"]
    if voltage:
        sets.append(f"motor.voltage={voltage}")
    assert outcome(separatrix, EXAMPLES / f"motor_{case}.toml", tmp_path, *sets) == expected
    with h5py.File(tmp_path / "motion.h5") as file:
        assert file.attrs["crank_speed"] > 3 * np.pi
        assert file.attrs["crank_outcome"] == expected
        assert (file.attrs["impacts"] > 0) == (expected == "captured")


def test_power_goes_somewhere(separatrix, tmp_path):
    """In a steady motion the mean power is the sum of its shares; the voltage gives it and the heat."""
    sets = ["motor.crank_speed=10", "run.duration=150", "run.window=30"]
    outcome(separatrix, IMPACT, tmp_path, *sets)
    with h5py.File(tmp_path / "motion.h5") as file:
        attributes = dict(file.attrs)
        current = file["current"][()][file["time"][()] >= 120].mean()
    shares = sum(attributes[f"{name}_power"] for name in ("impact", "friction", "damping", "bearing"))
    assert abs(attributes["power"] - shares) < 2e-3 * shares
    assert abs(8 * current - attributes["power"] - attributes["heat_power"]) < 2e-3 * shares


def test_slow_ramp_is_captured_longer(separatrix, yoke, tmp_path):
    """A voltage between threshold and fold: reached slowly, the crank stays below the resonance."""
    quick, slow = "motor.voltage=7.5", "motor.ramp_time=100"
    assert outcome(separatrix, yoke, tmp_path, quick) == "passed"
    assert outcome(separatrix, yoke, tmp_path, quick, slow, "motor.ramp_from=3") == "captured"


def test_balance_of_a_ramp(separatrix, yoke, tmp_path):
    """The samples of a ramp have the crank, and its energy balance closes."""
    outcome(separatrix, yoke, tmp_path, "motor.ramp_time=60", "motor.voltage=9")
    with h5py.File(tmp_path / "motion.h5") as file:
        speed, torque, power = (file[name][()] for name in ("crank_speed", "motor_torque", "motor_power"))
        np.testing.assert_allclose(power, torque * speed, atol=1e-12)
        assert abs(file.attrs["energy_closing_error"]) < 1e-8


def test_branches_find_the_fold(separatrix, yoke, tmp_path):
    """The slow branch turns where it is published to."""
    report = succeed(
        separatrix, "branches", yoke, "--parameter", "motor.voltage", "--from", "8.2", "--to", "8.3",
        "--searches", "1", "-o", "branches.h5", folder=tmp_path, timeout=600,
    ).out  # fmt: skip
    fold = re.search(r"SN at motor\.voltage = (\S+) V", report)
    assert abs(float(fold[1]) - 8.252828124769745) < 1e-8


@pytest.mark.long
def test_curve_of_folds(separatrix, yoke, tmp_path):
    """The end of the slow run-up over the inertia passes the published value."""
    words = "--parameter motor.voltage --from 8.2 --to 8.3 --searches 1".split()
    words += "--free motor.inertia --free-from 0.045 --free-to 0.055 -o curve.h5".split()
    succeed(separatrix, "branches", yoke, *words, folder=tmp_path, timeout=600)
    with h5py.File(tmp_path / "curve.h5") as file:
        voltage, inertia = file["curve_parameter"][()], file["curve_free"][()]
    order = np.argsort(inertia)
    assert abs(np.interp(0.05, inertia[order], voltage[order]) - 8.252828124769745) < 1e-8


def test_exponents_are_those_of_the_multipliers(separatrix, tmp_path):
    """The free cycle at 8 V: logarithms of its multipliers over its time."""
    report = succeed(separatrix, "stability", IMPACT, "--periods", "2000", folder=tmp_path).out
    found = [float(value) for value in re.findall(r"exponent \d: (\S+) 1/s", report)]
    period = 2 * np.pi / 15.30884297906753
    pair, single = np.log(abs(-0.609077686526 + 0.567414199022j)), np.log(0.652441520152)
    np.testing.assert_allclose(sorted(found), np.array([single, pair, pair]) / period, rtol=0.02)
    assert "the motion is periodic" in report


def test_starts_that_end_fast(separatrix, tmp_path):
    """Of 41 x 41 starts of the impacting machine 1229 end on the free cycle, as by another program."""
    succeed(separatrix, "basin", IMPACT, "-o", "map.h5", folder=tmp_path, timeout=300)
    with sx.open_result(tmp_path / "map.h5") as result:
        speed = result.separatrix.of_attractor("crank_speed").values
    assert speed.shape == (41, 41)
    fast = np.isclose(speed, 15.30884297906753, rtol=0, atol=1e-8)
    assert fast.sum() == 1229
    np.testing.assert_allclose(speed[~fast], 12.47775818691878, rtol=0, atol=1e-8)


def test_cranks_of_points(separatrix, yoke, tmp_path):
    """Without starts among the axes, as over voltage and inertia: speed and outcome of every point."""
    axes = f"{{name='motor.voltage', values=[{THRESHOLD - 1e-6}, {THRESHOLD + 1e-6}]}}"
    axes += ", {name='motor.bearing_friction', values=[0.0, 0.8]}"
    sets = (f"--set=axis=[{axes}]", "--set=run.duration=60")
    succeed(separatrix, "basin", yoke, *sets, "-o", "plane.h5", folder=tmp_path, timeout=300)
    with sx.open_result(tmp_path / "plane.h5") as result:
        names = result.separatrix.decoded("crank_outcome").values
        assert names.tolist() == [["captured", "stalled"], ["passed", "stalled"]]
        speed = result["crank_speed"].values
        np.testing.assert_allclose(speed, [[9.164705, 0], [12.22538, 0]], rtol=1e-4)
        for field in ("crank_outcome", "crank_speed"):
            assert result.separatrix.plot(field).axes
    assert "checksums" in succeed(separatrix, "verify", "plane.h5", "--sample", "1", folder=tmp_path).out


def test_cranks_of_points_that_have_not_settled(separatrix, yoke, tmp_path):
    """They are those of the trajectory over as long as the window after its end."""
    axes = "{name='motor.voltage', values=[6.0, 8.0]}, {name='motor.inertia', values=[0.05, 0.4]}"
    short = "run={duration=6, window=2, extension=1, average='window'}"
    sets = (f"--set=axis=[{axes}]", f"--set={short}")
    succeed(separatrix, "basin", yoke, *sets, "-o", "plane.h5", folder=tmp_path, timeout=300)
    with sx.open_result(tmp_path / "plane.h5") as result:
        speeds, names = result["crank_speed"], result.separatrix.decoded("crank_outcome")
        ends = result.separatrix.decoded("reason")
        assert (ends == "time_over").sum() >= 3
        for volts, inertia in itertools.product((6.0, 8.0), (0.05, 0.4)):
            at = {"motor_voltage": volts, "motor_inertia": inertia}
            if ends.sel(at) != "time_over":
                continue
            given = (f"motor.voltage={volts}", f"motor.inertia={inertia}", "run.duration=8", "run.window=2")
            assert names.sel(at) == outcome(separatrix, yoke, tmp_path, *given)
            with sx.open_result(tmp_path / "motion.h5") as motion:
                np.testing.assert_allclose(float(speeds.sel(at)), motion.attrs["crank_speed"], rtol=2e-4)


def test_cranks_of_attractors(separatrix, tmp_path):
    """Torque k (U - k w)/R in the mean; the power is the sum of its shares; each slice has its own speed."""
    axes = (
        "{name='motor.voltage', from=8, to=8.2, count=2}, {name='motor.crank_speed', from=9, to=17, count=5}"
    )
    sets = [f"axis=[{axes}]"]
    sets += ["attractors.sample=24", "start.x0=0.05"]
    succeed(
        separatrix,
        "basin",
        IMPACT,
        *(f"--set={word}" for word in sets),
        "-o",
        "map.h5",
        folder=tmp_path,
        timeout=300,
    )
    with sx.open_result(tmp_path / "map.h5") as result:
        cranks = result.separatrix.attractors.reset_index()
        speed = result.separatrix.of_attractor("crank_speed")
        labels = result["attractor"].values
    voltage = 8 + 0.2 * cranks["slice"]
    np.testing.assert_allclose(cranks["torque"], 0.5 * (voltage - 0.5 * cranks["crank_speed"]) / 5, rtol=1e-5)
    shares = sum(cranks[f"{name}_power"] for name in ("impact", "friction", "damping", "bearing"))
    np.testing.assert_allclose(cranks["power"], shares, rtol=1e-5)
    assert (cranks["crank_speed_min"] < cranks["crank_speed"]).all()
    assert (cranks["crank_speed"] < cranks["crank_speed_max"]).all()
    assert set(cranks["crank_outcome"]) == {"captured", "passed"}
    for one in cranks.itertuples():
        mine = speed.values[one.slice][labels[one.slice] == one.attractor]
        assert (mine == one.crank_speed).all()


# machine, range, direction, start w, x, v near the cycle there, then kind and value of the limit
LIMITS = [
    ("yoke", (8.1, 8.4), "up", (9.4389, 0.0048, 3.5517), "fold", 8.252828124769745),
    ("yoke", (5.55, 5.7), "down", (10.4748, -0.0748, 0.1859), "neimark_sacker", 5.643766508919115),
    ("impact", (4.5, 4.7), "up", (8.3445, 0.1170, 0.2064), "graze", 4.611362473527201),
    ("impact", (8.8, 8.95), "up", (13.0929, -0.1080, 1.6999), "fold", 8.864114491727010),
    ("impact", (5.95, 6.1), "down", (11.0888, -0.0695, 0.1658), "neimark_sacker", 6.019664934380103),
]


@pytest.mark.parametrize(
    "limit",
    [
        pytest.param(one, marks=pytest.mark.long if i in (1, 3) or one[4] == "neimark_sacker" else ())
        for i, one in enumerate(LIMITS)
    ],
    ids=[f"{one[0]}_{one[2]}_{one[4]}" for one in LIMITS],
)
def test_sweep_names_its_limits(separatrix, yoke, tmp_path, limit):
    """The first limit of a sweep: its kind, its value, and the speeds on both sides."""
    machine, (low, high), direction, start, kind, value = limit
    case = yoke if machine == "yoke" else IMPACT
    text = re.sub(r"(?s)\[\[axis.*", "", case.read_text())
    text += f'[sweep]\nparameter = "motor.voltage"\nfrom = {low}\nto = {high}\nstep = {(high - low) / 3!r}\n'
    (tmp_path / "case.toml").write_text(text + f'directions = "{direction}"\nstarts = [0, 0]\n')
    sets = [
        f"--set={key}={one}"
        for key, one in zip(("motor.crank_speed", "start.x0", "start.v0"), start, strict=True)
    ]
    sets += ["--set=run.duration=40", "--set=run.window=8"]
    succeed(separatrix, "sweep", "case.toml", *sets, "-o", "sweep.h5", folder=tmp_path, timeout=600)
    with h5py.File(tmp_path / "sweep.h5") as file:
        limits = file["limits"]
        names = limits["kind"].attrs["flag_meanings"].split()
        assert names[limits["kind"][0]] == kind
        assert abs(limits["value"][0] - value) < 1e-8
        before, after = limits["crank_speed_before"][0], limits["crank_speed_after"][0]
        assert (after > before) == (direction == "up")


# machine, values, start w, x, v; kind and value of the limit: a doubling of a published benchmark, and the
# voltage below which the body sticks at its turning points: the spring pulls with the static friction there
CHANGES = [
    (
        "lever",
        "motor.no_load_speed",
        (10.08, 10.11),
        (9.725, 1.08929, -1.13155),
        "doubling",
        10.09385546020162,
    ),
    ("impact", "motor.voltage", (2.01, 2.05), (3.8, 0.034, -0.006), "stick", 2.027819251935),
]


@pytest.mark.parametrize("change", CHANGES, ids=[one[4] for one in CHANGES])
def test_sweep_names_changes_without_other_impacts(separatrix, tmp_path, change):
    """A motion that goes on with as many impacts, or none, but doubles its period or begins to stick."""
    machine, parameter, (low, high), start, kind, value = change
    text = re.sub(r"(?s)\[\[axis.*|\[sweep\].*", "", (EXAMPLES / f"motor_{machine}.toml").read_text())
    text += f'[sweep]\nparameter = "{parameter}"\nfrom = {low}\nto = {high}\nstep = {high - low!r}\n'
    (tmp_path / "case.toml").write_text(text + 'directions = "down"\nstarts = [0, 0]\n')
    keys = ("motor.crank_speed", "start.x0", "start.v0")
    sets = [f"--set={key}={one}" for key, one in zip(keys, start, strict=True)]
    sets += ["--set=run.duration=20", "--set=run.window=4"]
    report = succeed(
        separatrix, "sweep", "case.toml", *sets, "-o", "sweep.h5", folder=tmp_path, timeout=600
    ).out
    assert re.search(f"run down: {kind} between .* in steps; {kind} at ", report)
    with h5py.File(tmp_path / "sweep.h5") as file:
        limits = file["limits"]
        names = limits["kind"].attrs["flag_meanings"].split()
        assert [names[code] for code in limits["kind"]] == [kind]
        assert limits["name"].attrs["flag_meanings"] == f"{kind}_down"
        assert abs(limits["value"][0] - value) < 1e-8


def test_branch_passes_the_section(separatrix, tmp_path):
    """At 2.492 V a turning point passes the section: the branch goes on with its events in another order."""
    words = [
        "--set=contact.upper=10",
        "--set=start.x0=0.0274",
        "--set=motor.crank_speed=3",
        "--searches",
        "1",
    ]
    words += ["--parameter", "motor.voltage", "--from", "2.47", "--to", "2.51", "-o", "branches.h5"]
    report = succeed(separatrix, "branches", IMPACT, *words, folder=tmp_path, timeout=600).out
    assert re.search(r"branch 1: period 1, \d+ points, ends: end of range$", report, re.MULTILINE)
    assert "not known" not in report
    with h5py.File(tmp_path / "branches.h5") as file:
        assert file["v"][()].min() < 0 < file["v"][()].max()


def test_exponents_of_a_limited_control(separatrix, yoke, tmp_path):
    """From standstill the torque is at its limit, on the cycle it is not: exponents are those without one."""
    motor = '[motor]\nlaw = "pi"\nproportional = 0.1\nintegral = 0.2\nreference = 9\ninertia = 0.05\n'
    text = yoke.read_text()
    yoke.write_text(text[: text.index("[motor]")] + motor + "bearing_damping = 0.002\ntorque_limit = 0.2\n")
    report = succeed(separatrix, "stability", yoke, "--periods", "400", folder=tmp_path, timeout=300).out
    found = [float(value) for value in re.findall(r"exponent \d: (\S+) 1/s", report)]
    pairs = np.log(np.abs([0.818042582540 + 0.151914954620j, -0.067561169099 + 0.490596887719j]))
    np.testing.assert_allclose(sorted(found), np.sort(np.repeat(pairs, 2)) * 9 / (2 * np.pi), rtol=0.06)
    # At 0.115 N m the torque reaches its limit in every turn, at 0.1045 N m the integral, too.
    for limit, lost in (("0.115", 0), ("0.1045", 1)):
        words = (f"--set=motor.torque_limit={limit}", "--periods", "200")
        report = succeed(separatrix, "stability", yoke, *words, folder=tmp_path, timeout=300).out
        assert report.count(": -inf") == lost
        assert "the motion is periodic" in report


SMALL = ("axis[1].count=6", "axis[2].count=5", "run.duration=8", "run.window=2", "attractors.sample=8")
PLANE = (
    "axis=[{name='motor.voltage', from=6, to=8, count=4},"
    " {name='motor.inertia', from=0.04, to=0.06, count=3}]"
)


@pytest.mark.parametrize(
    "more", [SMALL, pytest.param((PLANE, *SMALL[2:]), marks=pytest.mark.long)], ids=["starts", "plane"]
)
def test_maps_are_the_same_bits(separatrix, mpi_separatrix, tmp_path, more):
    """Serial, on 1 to 4 ranks, and stopped and gone on with other ranks."""
    command = ["basin", IMPACT, *(f"--set={word}" for word in more)]
    succeed(separatrix, *command, "-o", "one.h5", folder=tmp_path, timeout=300)
    for ranks in (1, 2, 3, 4):
        shared = [*command, "--set=grid.tile=[2, 3]", "-o", f"{ranks}.h5"]
        stopped = run(
            mpi_separatrix, *shared, "--time-limit", "0.2", folder=tmp_path, ranks=ranks, timeout=300
        )
        assert stopped.code in (0, STOPPED), stopped
        if stopped.code == STOPPED:
            succeed(mpi_separatrix, *shared, "--resume", folder=tmp_path, ranks=5 - ranks, timeout=300)
        assert differences(tmp_path / "one.h5", tmp_path / f"{ranks}.h5") == []
