# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The independent simulator of the campaign: mechanics, agreement with the program, sealed truths."""

import json
import math
import tomllib

import numpy as np
import pytest
from program import succeed

pytestmark = pytest.mark.filterwarnings("error")
SEED = 11


@pytest.fixture(scope="module")
def generator(source_dir):
    """The modules of tests/generator."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(source_dir / "tests" / "generator"))
        import design
        import experiment
        import records
        import simulator
    return design, experiment, records, simulator


def machine_of(generator, **changes):
    """The published machine at ratio 1.05, with changes."""
    _, experiment, _, _ = generator
    machine = experiment.REGIMES["published"].machine()
    return machine.copy(frequency=1.05 * math.sqrt(experiment.STIFFNESS), **changes)


def fly(generator, machine, x0, v0, *, periods=8, samples=400, substeps=8):
    """States of a motion."""
    *_, simulator = generator
    start = simulator.state(machine, x0, v0)
    interval = machine.period / samples
    return simulator.simulate(machine, start, 0.0, interval, periods * samples + 1, substeps)


def test_nothing_is_lost_without_friction_and_drive(generator):
    *_, simulator = generator
    machine = machine_of(generator, coulomb=0.0, scale=0.0, restitution=1.0, upper=0.8, cubic=-20.0)
    states, impacts = fly(generator, machine, 0.75, 2.0)
    extension = machine.free_length + machine.mean - states[:, simulator.X]
    energy = (
        states[:, simulator.V] ** 2 / 2
        + machine.stiffness * extension**2 / 2
        + machine.cubic * extension**4 / 4
    )
    assert impacts > 5
    assert energy == pytest.approx(energy[0], rel=1e-9)


def test_coulomb_friction_takes_force_times_path(generator):
    *_, simulator = generator
    machine = machine_of(generator, scale=0.0, upper=simulator.NOWHERE)
    states, _ = fly(generator, machine, 1.0, 0.0, periods=2, samples=4000)
    extension = machine.free_length + machine.mean - states[:, simulator.X]
    energy = states[:, simulator.V] ** 2 / 2 + machine.stiffness * extension**2 / 2
    path = np.sum(np.abs(np.diff(states[:, simulator.X])))
    assert energy[0] - energy[-1] == pytest.approx(machine.coulomb * path, rel=1e-5)
    assert (np.diff(energy) <= 1e-12).all()


def test_a_body_at_rest_is_held_by_the_static_excess(generator):
    *_, simulator = generator
    rest = machine_of(generator).free_length + machine_of(generator).mean
    level = machine_of(generator).coulomb
    for excess, held in ((0.0, False), (0.3 * level, True)):
        machine = machine_of(generator, scale=0.0, static_excess=excess)
        states, _ = fly(generator, machine, rest + 1.2 * level / machine.stiffness, 0.0, periods=1)
        assert bool((states[:, simulator.V] == 0).all()) == held


@pytest.mark.parametrize("substeps", [4, 8])
def test_half_the_step_changes_little(generator, substeps):
    *_, simulator = generator
    machine = machine_of(generator, dahl=400.0, contact_stiffness=1e6, contact_damping=0.2, quadratic=0.05)
    one, _ = fly(generator, machine, 0.5, 1.0, periods=4, substeps=substeps)
    other, _ = fly(generator, machine, 0.5, 1.0, periods=4, substeps=2 * substeps)
    assert np.abs(one - other)[:, simulator.X].max() < 1e-6


@pytest.mark.parametrize(
    ("shape", "constant", "loss"),
    [
        (0, 0.0, lambda v: v),
        (1, 0.2, lambda v: v**0.2),
        (2, 0.7, lambda v: 0.7 * (1 - np.exp(-v / 0.7))),
        (3, 1.2, lambda v: (1 + np.tanh((v - 1.2) / 0.18)) / 2),
    ],
    ids=["line", "power", "saturating", "step"],
)
def test_restitution_falls_with_the_speed_as_its_shape_states(generator, shape, constant, loss):
    *_, simulator = generator
    more = {"restitution_slope": 0.15, "restitution_shape": shape, "restitution_constant": constant}
    machine = machine_of(generator, coulomb=0.0, stiffness=0.0, upper=0.8, restitution=0.8, **more)
    for speed in (0.3, 1.1, 2.5):
        states, impacts = fly(generator, machine, 0.79, speed, periods=1)
        assert impacts == 1
        assert -states[-1, simulator.V] == pytest.approx(speed * (0.8 - 0.15 * loss(speed)), rel=1e-12)


def test_laws_of_another_shape_have_their_shape(generator):
    """Work of the forces along a motion: of a spring from its potential, of friction over position."""
    *_, simulator = generator
    more = {"cubic": 30.0, "cubic_exponent": 2.0, "quadratic": 0.0}
    machine = machine_of(generator, coulomb=0.0, scale=0.0, upper=simulator.NOWHERE, **more)
    states, _ = fly(generator, machine, 0.9, 0.0, periods=2, samples=4000)
    extension = np.abs(machine.free_length + machine.mean - states[:, simulator.X])
    energy = states[:, simulator.V] ** 2 / 2 + machine.stiffness * extension**2 / 2 + 30 * extension**3 / 3
    assert energy == pytest.approx(energy[0], rel=1e-9)
    rough = {"friction_slope": 0.5, "friction_wave": 9.0, "friction_wave_phase": 0.6}
    machine = machine_of(generator, scale=0.0, upper=simulator.NOWHERE, **rough)
    states, _ = fly(generator, machine, 1.1, 0.0, periods=1, samples=8000)
    x = states[:, simulator.X]
    extension = machine.free_length + machine.mean - x
    energy = states[:, simulator.V] ** 2 / 2 + machine.stiffness * extension**2 / 2
    middle = (x[1:] + x[:-1]) / 2
    work = np.sum(machine.coulomb * (1 + 0.5 * np.sin(9 * middle + 0.6) / 9) * np.abs(np.diff(x)))
    assert energy[0] - energy[-1] == pytest.approx(work, rel=1e-5)


@pytest.mark.parametrize("small", [False, True])
def test_slow_records_stick_and_a_small_drive_hardly_moves(generator, tmp_path, source_dir, small):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(source_dir / "tests" / "generator"))
        import slow
    case = slow.draw_slow(SEED, 1, "stribeck", small)
    slow.write_slow(tmp_path, case)
    x = [np.loadtxt(tmp_path / name, delimiter=",", skiprows=8)[:, 1] for name in ("first.csv", "second.csv")]
    assert all(one.size > slow.SAMPLES[0] / 2 for one in x)
    still = np.abs(x[0][200:] - x[0][:-200]) < 8 * slow.NOISE
    assert 0.2 < still.mean() < 0.95
    assert np.ptp(x[0]) > 0.2
    assert (np.ptp(x[1]) < 0.02) == small
    rest = np.loadtxt(tmp_path / slow.REST, delimiter=",", skiprows=3)[:, 1]
    assert np.std(rest) == pytest.approx(slow.NOISE, rel=0.1)


def effects_of_program() -> list[tuple[str, dict, dict]]:
    """Name, table of the case file, parameters of the generator."""
    return [
        ("none", {}, {}),
        ("viscous", {"damping": 0.3}, {"viscous": 0.3}),
        ("coulomb", {"force": 0.5}, {"coulomb": 0.5 + 0.2 * 9.81}),
        ("quadratic_drag", {"coefficient": 0.1}, {"quadratic": 0.1}),
        ("stribeck", {"excess": 0.8, "velocity": 0.2}, {"stribeck": 0.8, "stribeck_velocity": 0.2}),
        (
            "stribeck",
            {"excess": 0.8, "velocity": 0.2, "exponent": 0.8},
            {"stribeck": 0.8, "stribeck_velocity": 0.2, "stribeck_exponent": 0.8},
        ),
        ("static_excess", {"force": 1.0}, {"static_excess": 1.0}),
        ("dahl", {"stiffness": 400.0}, {"dahl": 400.0}),
        ("asymmetric_friction", {"coulomb": 0.3}, {"asymmetric_coulomb": 0.3}),
        ("position_dependent_friction", {"slope": -0.4}, {"friction_slope": -0.4}),
        ("cubic_spring", {"stiffness": 30.0}, {"cubic": 30.0}),
        ("offset_force", {"force": -0.7}, {"offset": -0.7}),
        ("restitution_slope", {"slope": 0.05}, {"restitution_slope": 0.05}),
        (
            "compliant_contact",
            {"stiffness": 1e6, "damping": 0.3},
            {"contact_stiffness": 1e6, "contact_damping": 0.3},
        ),
        (
            "compliant_contact",
            {"stiffness": 2e5, "damping": 0.3, "exponent": 1.2},
            {"contact_stiffness": 2e5, "contact_damping": 0.3, "contact_exponent": 1.2},
        ),
        ("second_barrier", {"position": 0.27}, {"lower": 0.27}),
        ("drive_ripple", {"sine": 0.03, "cosine": -0.02}, {"ripple_sine": 0.03, "ripple_cosine": -0.02}),
        ("sensor_bias", {"bias": 0.01}, {"sensor_bias": 0.01}),
        ("sensor_gain", {"gain": 0.02}, {"sensor_gain": 0.02}),
        ("sensor_delay", {"delay": 0.003}, {"sensor_delay": 0.003}),
    ]


@pytest.mark.parametrize(
    ("name", "table", "changes"), effects_of_program(), ids=lambda value: value if type(value) is str else ""
)
def test_two_methods_give_one_record(generator, separatrix, tmp_path, name, table, changes):
    _, experiment, records, simulator = generator
    sensor = {key: value for key, value in changes.items() if key.startswith("sensor")}
    machine = machine_of(generator, **{key: value for key, value in changes.items() if key not in sensor})
    if "ripple_sine" in changes:
        machine = machine.copy(ripple_harmonic=1.0)
    made = experiment.Experiment(1.05, 0.4, 0.5, 1.0, 0, 200, 6, sensor)
    driven = made.driven(machine)
    states, impacts = made.states(driven, 3200)
    seen = made.observe(driven, states, 3200)[:, simulator.X]
    case = records.base_case(experiment.REGIMES["published"], 1.05)
    case += f"[start]\nx0 = 0.5\nv0 = 1.0\ncrank_angle = 0.4\n[run]\nduration = {6.01 * machine.period!r}\n"
    case += f"[record]\nrate = {1 / made.interval!r}\n"
    if table:
        case += f"[effect.{name}]\n" + "".join(f"{key} = {value!r}\n" for key, value in table.items())
    (tmp_path / "case.toml").write_text(case)
    succeed(
        separatrix, "trajectory", "case.toml", "-o", "m.h5", "--record", "m.csv", "--quiet", folder=tmp_path
    )
    lines = [line for line in (tmp_path / "m.csv").read_text().splitlines() if line[0] not in "#t"]
    theirs = np.array([[float(word) for word in line.split(",")] for line in lines])[: made.count, 1]
    late = math.ceil(sensor.get("sensor_delay", 0.0) / made.interval)
    assert impacts > 3
    assert np.abs(seen - theirs)[late:].max() < 1e-6


@pytest.mark.parametrize(
    ("shape", "constant"), [("", 0.0), ("POWER", 0.2), ("POWER", 1.4), ("SATURATING", 0.8), ("STEP", 1.1)]
)
def test_the_law_that_a_function_is_held_against_is_that_of_the_bounces(generator, campaign, shape, constant):
    import discovery_functions

    *_, simulator = generator
    drawn = {"restitution_shape": getattr(simulator, shape)} if shape else {}
    drawn |= {"restitution_constant": constant} if shape else {}
    machine = machine_of(generator, restitution=0.7, restitution_slope=0.1, **drawn)
    speeds = np.linspace(0.2, 3, 8)
    for speed, wanted in zip(speeds, discovery_functions.law(machine, speeds), strict=True):
        start = simulator.state(machine, machine.upper - 1e-6 * speed, speed)
        states, impacts = simulator.simulate(machine, start, 0.0, 2e-6, 2, 4)
        assert impacts == 1
        assert -states[1, simulator.V] / speed == pytest.approx(wanted, abs=2e-3)


def nothing_hidden(design) -> int:
    """The number of a case that is drawn quickly."""
    return next(
        n for n in range(design.BLOCK) if design.plan(SEED, n)[0] == "none" and not design.is_long(SEED, n)
    )


@pytest.mark.parametrize("number", [None, 1])
def test_a_case_follows_from_its_number(generator, tmp_path, number):
    design, _, records, _ = generator
    seals = []
    for folder in ("one", "two"):
        case = design.draw(SEED, nothing_hidden(design) if number is None else number)
        seals.append(records.write_case(tmp_path / folder, tmp_path / f"{folder}.json", case))
    assert seals[0] == seals[1] == records.seal(tmp_path / "one.json")
    for name in (records.BASE, *records.TRAINING, records.HELD_OUT):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_the_seal_notices_another_truth(generator, tmp_path):
    design, _, records, _ = generator
    path = tmp_path / "truth.json"
    found = records.write_case(tmp_path / "case", path, design.draw(SEED, nothing_hidden(design)))
    path.write_text(json.dumps(json.loads(path.read_text()) | {"names": ["viscous"]}))
    assert records.seal(path) != found


def test_records_do_not_contain_the_truth(generator, tmp_path):
    design, experiment, records, _ = generator
    case = design.draw(SEED, 1)
    records.write_case(tmp_path / "case", tmp_path / "truth.json", case)
    base = tomllib.loads((tmp_path / "case" / records.BASE).read_text())
    assert base["restoring"]["stiffness"] == experiment.STIFFNESS
    assert "effect" not in base
    heads = {
        line.split(":")[0]
        for line in (tmp_path / "case" / "first.csv").read_text().splitlines()
        if line[0] == "#"
    }
    known = (
        "units",
        "sampling_rate_hz",
        "drive_ratio",
        "sensor_noise_sigma_m",
        "sensor_resolution_m",
        "phase",
    )
    assert heads <= {f"# {name}" for name in known}


def test_a_size_is_worth_what_was_asked(generator):
    design, *_ = generator
    for number in range(3 * design.BLOCK):
        kind, name, target = design.plan(SEED, number)
        if kind == "single" and name in ("cubic_spring", "quadratic_drag", "offset_force"):
            case = design.draw(SEED, number)
            assert target * 0.9 <= case.d_prime[name] <= 1.3 * target, (number, name)
            return
    raise AssertionError("no such case in three blocks")


def test_long_cases_have_the_samples_of_a_rig(generator, tmp_path):
    design, _, records, _ = generator
    numbers = range(4 * design.BLOCK)
    long = [number for number in numbers if design.is_long(SEED, number)]
    assert len(long) == 4 * design.LONG
    number = next(number for number in long if design.plan(SEED, number)[0] == "none")
    case = design.draw(SEED, number)
    records.write_case(tmp_path / "case", tmp_path / "truth.json", case)
    truth = json.loads((tmp_path / "truth.json").read_text())
    rows = sum(
        line[0].isdigit()
        for name in (*records.TRAINING, records.HELD_OUT)
        for line in (tmp_path / "case" / name).read_text().splitlines()
    )
    assert truth["samples"] == rows
    assert 50_000 <= rows <= 105_000


def test_faults_of_a_rig_are_small_and_in_half_of_the_cases(generator):
    design, experiment, records, simulator = generator
    drawn = [design._rig(np.random.default_rng(number)) for number in range(200)]
    assert 70 < sum(bool(one) for one in drawn) < 130
    sizes = np.abs([list(one.values()) for one in drawn if one])
    assert sizes.min() >= 1e-4
    assert sizes.max() <= 1e-3
    case = design.draw(SEED, nothing_hidden(design))
    one = case.training[0]
    clean = one.observe(one.driven(case.machine), one.states(one.driven(case.machine))[0])[:, 0]
    case.rig = {"crank_noise": 1e-3, "curved": 1e-3, "cubic": -1e-3, "harmonics": 1e-3}
    driven, imperfections = records.with_imperfections(case, one)
    one.sensor = {**one.sensor, **imperfections}
    seen = one.observe(driven, one.states(driven)[0])[:, 0]
    change = np.median(np.abs(seen - clean)) / clean.std()
    assert 1e-4 < change < 0.05


def test_every_kind_has_its_share(generator):
    design, *_ = generator
    plans = [design.plan(SEED, number) for number in range(10 * design.BLOCK)]
    for kind, share in design.SHARES.items():
        assert sum(one[0] == kind for one in plans) == 10 * share
    singles = [one[1] for one in plans if one[0] == "single"]
    counts = {name: singles.count(name) for name in set(singles)}
    assert len(counts) == len(design.CATALOGUE) + 1
    assert max(counts.values()) - min(counts.values()) <= 1
    asked = {(name, target) for kind, name, target in plans if kind == "single"}
    assert all(sum(name == other for other, _ in asked) == len(design.TARGETS) for name in counts)
