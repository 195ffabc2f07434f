# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Derived quantities: means, rms values and powers beside closed forms; refusals."""

import math

import h5py
import numpy as np
import pytest
import separatrix as sx
from program import differences, run, succeed

QUANTITIES = """
[derived.rms_x]
quantity = "rms"
expression = "x"
unit = "m"
[derived.mean_v]
quantity = "mean"
expression = "v"
unit = "m/s"
[derived.loss]
quantity = "mean"
expression = "friction.damping*v^2"
unit = "W"
[derived.speed]
quantity = "mean"
expression = "abs(v)"
unit = "m/s"
[derived.drift_x]
quantity = "drift"
expression = "x"
unit = "m"
[derived.power_in]
quantity = "power"
of = "drive"
[derived.damping]
quantity = "power"
of = "damping"
[derived.contacts]
quantity = "power"
of = "contacts"
"""
MASS, STIFFNESS, DAMPING, FORCE, FREQUENCY = 2.0, 50.0, 1.5, 3.0, 7.0
LINEAR = f"""
body.mass = {MASS}
restoring = {{ law = "linear", stiffness = {STIFFNESS} }}
friction = {{ law = "viscous", damping = {DAMPING} }}
drive = {{ law = "force", amplitude = {FORCE}, frequency = {FREQUENCY} }}
run = {{ duration = 60 }}
axis = [{{ name = "x0", from = -1, to = 1, count = 2 }}, {{ name = "v0", from = -1, to = 1, count = 2 }}]
[sweep]
parameter = "drive.frequency"
from = 6.0
to = 8.0
count = 3
starts = [0, 0]
"""
IMPACTING = """
body.mass = 1
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 0.1 }
contact = { law = "newton", restitution = 0.8, upper = 1 }
drive = { law = "harmonic", amplitude = 1, ratio = 1 }
start.x0 = 0
run.duration = 600
"""
CHAOTIC = """
body.mass = 2
restoring = { law = "linear", stiffness = 200 }
friction = { law = "viscous", damping = 1 }
contact = { law = "newton", restitution = 0.7, upper = "30 mm" }
drive = { law = "harmonic", amplitude = "10 mm", ratio = 0.9 }
run.duration = 200
attractors.sample = 8
axis = [{ name = "x0", values = [0] }, { name = "v0", values = [0.1, 0.2] }]
"""


def derived(folder, separatrix, command: str, text: str) -> dict[str, np.ndarray]:
    """The derived quantities of a result: of the attributes, the catalogue, or the root."""
    (folder / "case.toml").write_text(text)
    succeed(separatrix, command, "case.toml", "-o", "out.h5", "--force", folder=folder)
    with h5py.File(folder / "out.h5") as file:
        group = file["catalogue"] if command == "basin" else file
        source = file.attrs if command == "trajectory" else group
        names = [name for name in source if name.startswith("derived_") and not name.endswith("_units")]
        return {name.removeprefix("derived_"): np.asarray(source[name]) for name in names}


def closed_form(frequency: float) -> dict[str, float]:
    """Of the steady motion A cos(w t + phase): A/sqrt 2, c A^2 w^2/2, 2 A w/pi."""
    amplitude = FORCE / math.hypot(STIFFNESS - MASS * frequency**2, DAMPING * frequency)
    power = DAMPING * (amplitude * frequency) ** 2 / 2
    return {
        "rms_x": amplitude / math.sqrt(2), "mean_v": 0, "loss": power,
        "speed": 2 / math.pi * amplitude * frequency, "drift_x": 0,
        "power_in": power, "damping": power, "contacts": 0,
    }  # fmt: skip


@pytest.mark.parametrize("command", ["trajectory", "basin"])
def test_a_linear_oscillator_has_the_values_of_its_closed_form(separatrix, tmp_path, command):
    """The corners of abs(v) fall on turning points, which are events: no digits are lost there."""
    found = derived(tmp_path, separatrix, command, LINEAR + QUANTITIES)
    wanted = closed_form(FREQUENCY)
    assert found.keys() == wanted.keys()
    for name, value in wanted.items():
        assert found[name].squeeze() == pytest.approx(value, rel=1e-11, abs=1e-12), name


def test_a_sweep_has_them_at_every_value(separatrix, tmp_path):
    """Both runs; another frequency is another machine, and another value of a parameter another constant."""
    found = derived(tmp_path, separatrix, "sweep", LINEAR + QUANTITIES)
    for k, frequency in enumerate((6.0, 7.0, 8.0)):
        for name, value in closed_form(frequency).items():
            assert found[name][:, k] == pytest.approx(value, rel=1e-8, abs=1e-9), name


def test_a_swept_parameter_has_its_value_in_expressions(separatrix, tmp_path):
    """The power that an expression has with the damping is that of the energy balance."""
    text = (LINEAR + QUANTITIES).replace('"drive.frequency"', '"friction.damping"')
    found = derived(
        tmp_path,
        separatrix,
        "sweep",
        text.replace("from = 6.0", "from = 1.0").replace("to = 8.0", "to = 3.0"),
    )
    assert found["loss"] == pytest.approx(found["damping"], rel=1e-9)
    assert np.ptp(found["loss"][0]) > 0.01


def test_impacts_lose_what_their_restitution_gives(separatrix, tmp_path):
    """One impact a period: m (1 - e^2) v^2/2 over the period; drive, damping and impacts balance."""
    found = derived(tmp_path, separatrix, "trajectory", IMPACTING + QUANTITIES)
    with h5py.File(tmp_path / "out.h5") as file:
        speed, period = file.attrs["mean_impact_speed"], file.attrs["drive_period"]
        assert file.attrs["impacts_per_period"] == 1
    assert found["contacts"] == pytest.approx((1 - 0.8**2) * speed**2 / 2 / period, rel=1e-10)
    assert found["power_in"] == pytest.approx(found["contacts"] + found["damping"], rel=1e-10)
    # the velocity jumps between panels, which end at the impacts
    assert found["loss"] == pytest.approx(found["damping"], rel=1e-10)
    assert abs(found["mean_v"]) < 1e-12


@pytest.mark.parametrize(
    "case", ["motor_impact", "structure_impact_damper", "own_equation", "structure_beam"]
)
def test_powers_of_every_kind_of_machine_balance(separatrix, source_dir, tmp_path, case):
    """A motor, bodies with impacts, an equation by expressions, a structure: over a cycle."""
    words = [
        f'derived.{of}={{quantity="power", of="{of}"}}' for of in ("drive", "friction", "damping", "contacts")
    ]
    options = [word for text in words for word in ("--set", text)]
    succeed(
        separatrix, "trajectory", source_dir / "examples" / f"{case}.toml", *options, "-o", "out.h5",
        folder=tmp_path,
    )  # fmt: skip
    with h5py.File(tmp_path / "out.h5") as file:
        assert file.attrs["period"] > 0
        power = {of: file.attrs[f"derived_{of}"] for of in ("drive", "friction", "damping", "contacts")}
        assert file.attrs["derived_drive_units"] in ("W", b"W")
    assert power["drive"] > 1e-5
    assert power["drive"] == pytest.approx(power["friction"] + power["damping"] + power["contacts"], rel=1e-6)


def test_bodies_by_their_names(separatrix, tmp_path):
    """Columns of a trajectory are the names: the relative velocity of two bodies, one of them free."""
    text = """
    body.a.mass = 1
    body.b = { mass = 1, v0 = 2 }
    spring.s = { between = ["a"], stiffness = 9, damping = 0.6 }
    drive.d = { body = "a", law = "force", amplitude = 1, frequency = 2 }
    watch.body = "a"
    run = { duration = 40, window = 6.283185307179586 }
    derived.apart = { quantity = "mean", expression = "b_v - a_v", unit = "m/s" }
    derived.speed = { quantity = "rms", expression = "a_v", unit = "m/s" }
    derived.path = { quantity = "drift", expression = "b_x", unit = "m" }
    """
    found = derived(tmp_path, separatrix, "trajectory", text)
    # the cycle holds nothing of a body that nothing ties to it: the window does
    assert found["apart"] == pytest.approx(2, abs=1e-3)
    assert found["path"] == pytest.approx(2 * math.pi, rel=1e-9)
    axes = 'axis = [{ name = "x0", values = [0] }, { name = "v0", values = [0, 1] }]\n'
    found = derived(tmp_path, separatrix, "basin", text + axes)
    assert np.isnan(found["apart"]).all() and np.isnan(found["path"]).all()
    assert found["speed"] == pytest.approx(1 / math.hypot(5, 1.2) * 2 / math.sqrt(2), rel=1e-11)


def test_a_chaotic_motion_has_the_values_of_its_window(separatrix, tmp_path):
    """The window of the case; the energy at its ends differs, so powers balance nearly."""
    text = CHAOTIC + QUANTITIES
    found = derived(tmp_path, separatrix, "basin", text)
    with h5py.File(tmp_path / "out.h5") as file:
        kinds = file["catalogue/kind"][()].tolist()
    chaotic = kinds.index(3)
    assert found["rms_x"][chaotic] == pytest.approx(0.0191, rel=0.1)
    lost = found["contacts"][chaotic] + found["damping"][chaotic]
    assert found["power_in"][chaotic] == pytest.approx(lost, rel=0.05)
    # two integrals over the same window, one of them by the energy balance
    assert found["loss"][chaotic] == pytest.approx(found["damping"][chaotic], rel=1e-8)


def test_at_rest_only_what_no_position_changes_is_known(separatrix, tmp_path):
    """A body that friction holds anywhere in a range has no one position."""
    text = LINEAR.replace('law = "viscous", damping = 1.5', 'law = "coulomb", kinetic_coefficient = 0.9')
    text = text.replace('drive = { law = "force", amplitude = 3.0, frequency = 7.0 }\n', "")
    text = text.replace("drive.frequency", "body.mass") + QUANTITIES.replace("friction.damping*v^2", "v^2")
    found = derived(tmp_path, separatrix, "basin", text)
    assert np.isnan(found["rms_x"]).all() and np.isnan(found["drift_x"]).all()
    for name in ("mean_v", "loss", "speed", "power_in", "damping"):
        assert found[name] == pytest.approx(0, abs=1e-15), name


def test_ranks_and_shares_have_the_same_bits(separatrix, tmp_path):
    """Slices are shared by the ranks, as are the attractors searched there."""
    stack = LINEAR.replace("axis = [", 'axis = [{ name = "drive.amplitude", from = 1, to = 3, count = 3 }, ')
    (tmp_path / "case.toml").write_text(stack + QUANTITIES)
    succeed(separatrix, "basin", "case.toml", "-o", "one.h5", folder=tmp_path)
    succeed(separatrix, "basin", "case.toml", "-o", "three.h5", folder=tmp_path, ranks=3)
    assert not [name for name in differences(tmp_path / "one.h5", tmp_path / "three.h5") if "derived" in name]
    with h5py.File(tmp_path / "one.h5") as file:
        assert np.diff(file["catalogue/derived_rms_x"][()]).min() > 0


@pytest.mark.parametrize(
    "table, message",
    [
        ('quantity = "median"', "derived.a.quantity"),
        ('quantity = "power"\nof = "wind"', "allowed friction, damping, contacts, drive"),
        ('expression = "x + y"\nunit = "m"', "column 5: found name 'y'"),
        ('expression = "x"\nunit = "mm"', 'allowed the SI unit, "m"'),
        ('expression = "x"', "derived.a.unit"),
        ('expression = ""\nunit = "m"', 'found "", allowed an expression'),
        ('expression = "x"\nunit = "m"\nof = "drive"', "derived.a.of"),
    ],
)
def test_what_is_wrong_is_named(separatrix, tmp_path, table, message):
    """File, line, key, what was found and what is allowed."""
    (tmp_path / "case.toml").write_text(LINEAR + f"[derived.a]\n{table}\n")
    refused = run(separatrix, "trajectory", "case.toml", folder=tmp_path)
    assert refused.code == 65
    assert message in refused.err


def test_tables_that_may_be_there_are_named_where_one_is_misspelt(separatrix, tmp_path):
    (tmp_path / "case.toml").write_text("body.mass = 1\nderiveds.a.unit = 'm'\n")
    refused = run(separatrix, "trajectory", "case.toml", folder=tmp_path)
    assert refused.code == 65 and "key 'deriveds': unknown (did you mean 'derived'?)" in refused.err
    allowed = refused.err.split("allowed ")[1].strip().split(", ")
    assert {"derived", "force", "state", "motor"} <= set(allowed)


def test_an_operation_that_is_not_defined_is_not_known(separatrix, tmp_path):
    """A logarithm of positions of both signs."""
    text = LINEAR + '[derived.a]\nexpression = "log(x)"\nunit = "1"\n'
    text += '[derived.b]\nquantity = "rms"\nexpression = "v"\nunit = "m/s"\n'
    found = derived(tmp_path, separatrix, "trajectory", text)
    assert np.isnan(found["a"]) and found["b"] > 0
    info = succeed(separatrix, "trajectory", "case.toml", "-o", "again.h5", folder=tmp_path)
    assert "a: not known (mean of log(x))" in info.out


def test_the_many_starts_of_a_sweep_have_those_of_their_attractors(separatrix, tmp_path):
    """With and without impacts; what a start has is what its motion has; the same bits for three ranks."""
    text = IMPACTING.replace("amplitude = 1, ratio = 1", "amplitude = 0.4, ratio = 1.3").replace(
        "0.1", "0.05"
    )
    text += 'derived.lost = { quantity = "power", of = "contacts" }\n'
    text += (
        'sweep = { parameter = "drive.ratio", from = 1.28, to = 1.32, count = 3, starts = [3, 3], '
        "x0 = [-4, 1], v0 = [-4, 4] }\n"
    )
    (tmp_path / "case.toml").write_text(text)
    succeed(separatrix, "sweep", "case.toml", "-o", "one.h5", folder=tmp_path)
    succeed(separatrix, "sweep", "case.toml", "-o", "three.h5", folder=tmp_path, ranks=3)
    assert not [
        name for name in differences(tmp_path / "one.h5", tmp_path / "three.h5") if "catalogue" in name
    ]
    assert "invariants hold" in succeed(separatrix, "verify", "one.h5", folder=tmp_path).out
    sweep = sx.open_result(tmp_path / "one.h5")
    lost = sweep.separatrix.derived()["branch_derived_lost"]
    assert lost.dims == ("drive_ratio", "start") and lost.attrs["units"] == "W"
    catalogue = sweep.separatrix.attractors
    assert catalogue["count"].sum() == (sweep.branch_attractor.values > 0).sum()
    assert len(np.unique(sweep.branch_attractor)) > 1
    for value, start in [(0, 0), (1, 4), (2, 8), (2, 2)]:
        options = [f"start.x0={float(sweep.start_x0[start])}", f"start.v0={float(sweep.start_v0[start])}"]
        options.append(f"drive.ratio={float(sweep.drive_ratio[value])}")
        options = [word for option in options for word in ("--set", option)]
        succeed(separatrix, "trajectory", "case.toml", *options, "-o", "t.h5", "--force", folder=tmp_path)
        with h5py.File(tmp_path / "t.h5") as file:
            assert float(lost[value, start]) == pytest.approx(file.attrs["derived_lost"], rel=1e-9, abs=1e-12)
    # by label and number among all values, also in a figure of some of them
    named = sweep.separatrix.table("branch_regime")
    assert np.array_equal(named["branch_derived_lost"], lost.values.ravel(), equal_nan=True)
    drawn = sweep.separatrix.plot("derived_lost", region={"drive.ratio": (1.3, 1.32)}).axes[0].collections[0]
    assert np.asarray(drawn.get_offsets())[:, 1] == pytest.approx(lost.values[1:].ravel(), nan_ok=True)
