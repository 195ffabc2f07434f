# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of a joint that is driven along a known motion, compared in force."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from separatrix.discovery import Options, discover
from separatrix.discovery.cli import main
from separatrix.discovery.fitting.base import fit_base
from separatrix.discovery.fitting.data import gather
from separatrix.discovery.fitting.forces import force_needed
from separatrix.discovery.measured.condense import stride
from separatrix.discovery.measured.in_force import prepare_force
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.measured.smoother import smooth
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError
from separatrix.library import Model

MASS, DAMPING, COEFFICIENT, GRAVITY = 2.0, 10.0, 0.3, 9.81
DRY = COEFFICIENT * MASS * GRAVITY
CASE = f"""[body]
mass = {MASS}
gravity = {GRAVITY}

[restoring]
law = "none"

[friction]
law = "coulomb_viscous"
kinetic_coefficient = {COEFFICIENT}
damping = {DAMPING}

[contact]
law = "none"

[drive]
law = "measured_force"
interval = "1 ms"
force = [0.0, 0.0]

[run]
duration = "1 s"
"""
RATE, FINE = 100, 20
# amplitude [m] and frequency [Hz] of the motions; the last one is held out
MOTIONS = ((0.1, 0.5), (0.1, 0.25), (0.06, 1.0))

pytestmark = pytest.mark.usefixtures("library")


def base(law: str = "") -> Model:
    """A slide with dry and viscous friction; where viscous friction is what is missing, without that."""
    if law == "viscous":
        return Model.from_text(CASE.replace("coulomb_viscous", "coulomb").replace(f"damping = {DAMPING}", ""))
    return Model.from_text(CASE)


def memory(x: np.ndarray, stiffness: float, slips: bool) -> np.ndarray:
    """Friction [N] with a spring before it slides: Dahl's, or one that `slips` at its largest force."""
    found, z = np.zeros(x.size), 0.0
    for k, step in enumerate(np.diff(x), start=1):
        z += stiffness * (1 if slips else 1 - z / DRY * np.sign(step)) * step
        z = min(max(z, -DRY), DRY) if slips else z
        found[k] = z
    return found


# each beyond the mass and the friction of the base; laws written down here, not those of the simulator
LAWS = {
    "nothing": lambda x, v: 0 * v,
    "viscous": lambda x, v: 0 * v,
    "stribeck": lambda x, v: 3 * np.exp(-((v / 0.05) ** 2)) * np.sign(v),
    "quadratic_drag": lambda x, v: 12 * v * np.abs(v),
    "asymmetric_friction": lambda x, v: 4 * np.abs(v),
    "position_dependent_friction": lambda x, v: 2 * DRY * x * np.sign(v),
    "dahl": lambda x, v: memory(x, 1500.0, False) - DRY * np.sign(v),
    "elastic": lambda x, v: memory(x, 1500.0, True) - DRY * np.sign(v),
    "cogging": lambda x, v: 1.0 * np.sin(2 * np.pi * x / 0.13),
    "bump": lambda x, v: 1.5 * np.sign(v) * np.exp(-(((np.abs(v) - 0.15) / 0.04) ** 2)),
}


def record_of(law: str, amplitude: float, frequency: float, noise: float, seed: int, sigma: float = 0.0):
    """A record of 8 s at 100 Hz; the force of the law along a finer motion.

    The noise is a share of the scatter of the force, or stated as `sigma`.
    """
    t = np.arange(8 * RATE * FINE) / (RATE * FINE)
    angle, turning = 2 * np.pi * frequency * t + 0.3, 2 * np.pi * frequency
    x, v = amplitude * np.sin(angle), amplitude * turning * np.cos(angle)
    force = -MASS * turning**2 * x + DAMPING * v + DRY * np.sign(v) + LAWS[law](x, v)
    t, x, force = t[::FINE], x[::FINE], force[::FINE]
    random = np.random.default_rng(seed)
    force = force + (sigma or noise * np.std(force)) * random.standard_normal(t.size)
    x = x + (1e-6 if noise or sigma else 0.0) * random.standard_normal(t.size)
    columns = {"t": t, "x": x, "force": force}
    stated = {"force_noise_sigma_n": sigma} if sigma else {}
    return make_record(f"r{seed}", columns, {"units": "t s, x m, force N"} | stated)


def records_of(law: str, noise: float) -> list:
    """Three records, the last one to be held out."""
    return [record_of(law, *motion, noise, seed) for seed, motion in enumerate(MOTIONS)]


def ask(law: str, noise: float, **options) -> dict:
    """The verdict on a law."""
    records = records_of(law, noise)
    return discover(base(law), records[:2], records[2:], Options(quick=True, compare="force", **options))


@pytest.mark.parametrize("noise", (0.0, 0.005, 0.02))
def test_nothing_missing_stays_silent(noise: float) -> None:
    verdict = ask("nothing", noise)
    assert (verdict["outcome"], verdict["effects"], verdict["compared"]) == ("none", [], "force")


NOISES = (0.0, 0.005, 0.02)
NAMED = {
    "viscous": ("effect.viscous.damping", DAMPING),
    "stribeck": ("effect.stribeck.excess", 3.0),
    "quadratic_drag": ("effect.quadratic_drag.coefficient", 12.0),
    "asymmetric_friction": ("effect.asymmetric_friction.viscous", 4.0),
    "position_dependent_friction": ("effect.position_dependent_friction.slope", 2.0),
    "dahl": ("effect.dahl.stiffness", 1500.0),
}


# each at two of the three
CASES = [
    pytest.param(law, NOISES[(i + k) % 3], marks=[pytest.mark.long] * k)
    for i, law in enumerate(NAMED)
    for k in (0, 1)
]


@pytest.mark.parametrize(("law", "noise"), CASES)
def test_a_law_of_the_catalogue_is_named(law: str, noise: float) -> None:
    rivals = ("viscous", "stribeck", "quadratic_drag", "asymmetric_friction", "position_dependent_friction")
    verdict = ask(law, noise, candidates=tuple({*rivals, law}))
    assert (verdict["outcome"], verdict["effects"]) == ("named", [law])
    path, true = NAMED[law]
    found = verdict["parameters"][path]
    assert found["value"] == pytest.approx(true, rel=0.05)
    for gap in verdict["gap"].values():
        assert gap["after"] - 1 < max(0.2, 0.01 * (gap["before"] - 1))


@pytest.mark.long
def test_friction_with_a_spring_in_series_gets_no_name() -> None:
    """Known is on what it depends, and which joint of a structure has such a law."""
    verdict = ask("elastic", 0.005, candidates=("viscous", "quadratic_drag", "dahl"))
    assert (verdict["outcome"], verdict["effects"], verdict["added"]) == ("characterised", [], [])
    assert verdict["character"][0]["depends_on"] == ["direction of motion", "way since it turned"]
    assert "elastic_coulomb" in verdict["not_added"]


def test_a_force_of_position_is_not_taken_for_friction() -> None:
    verdict = ask("cogging", 0.005, candidates=("viscous", "quadratic_drag", "position_dependent_friction"))
    assert verdict["outcome"] in ("characterised", "not-in-catalogue")
    assert verdict["effects"] == []


@pytest.mark.long
def test_the_drift_of_a_force_sensor_is_reported() -> None:
    """Each record by itself, as it warms up: no function of position."""
    records = records_of("nothing", 0.005)
    for record, rate in zip(records, (0.3, -0.2, 0.5), strict=True):
        record.force = record.force + rate * (record.t - record.t[0])
    verdict = discover(base(), records[:2], records[2:], Options(quick=True, compare="force"))
    assert verdict["outcome"] == "characterised"
    assert verdict["effects"] == []
    assert verdict["character"][0]["depends_on"] == ["slow time"]
    assert "asked for" in verdict["not_tested"]["cubic_damping"]


@pytest.mark.parametrize(
    ("column", "factor", "partial"),
    [
        pytest.param("force", 1e-3, False, marks=pytest.mark.long),
        ("force", 1e-3, True),
        pytest.param("force", 9.81, False, marks=pytest.mark.long),
        pytest.param("x", 1e3, False, marks=pytest.mark.long),
    ],
)
def test_wrong_units_make_no_certain_name(column: str, factor: float, partial: bool) -> None:
    """Newtons that are kilonewtons or kilograms, metres that are millimetres."""
    records = records_of("stribeck", 0.005)
    for record in records:
        setattr(record, column, factor * getattr(record, column))
    options = Options(quick=True, compare="force", partial=partial)
    verdict = discover(base(), records[:2], records[2:], options)
    assert verdict["outcome"] != "named"
    notes = [one for one in verdict["notes"] if "other units" in one]
    assert notes
    factors = [float(found[1]) for one in notes if (found := re.search(r"is ([\d.e-]+) times that", one))]
    assert factors == pytest.approx([factor if column == "force" else 1 / factor] * 2, rel=0.2)


def test_a_clipped_force_is_refused() -> None:
    records = records_of("viscous", 0.005)
    limit = 0.9 * np.max(np.abs(records[1].force))
    records[1].force = np.clip(records[1].force, -limit, limit)
    with pytest.raises(SeparatrixError, match="r1.*force stays at its largest value.*clipped"):
        discover(base(), records[:2], records[2:], Options(quick=True, compare="force"))


@pytest.mark.parametrize(("sigma", "notes"), [(0.5, 0), (60.0, 1)])
def test_a_force_below_its_noise_is_reported(sigma: float, notes: int) -> None:
    reported = prepare_force(record_of("viscous", *MOTIONS[0], 0.0, 1, sigma), base()).notes
    assert sum("the force is smaller than its noise" in one for one in reported) == notes


def test_a_force_without_noise_is_not_clipped() -> None:
    """Dry friction at a constant speed is one number, time and again."""
    t = np.arange(4000) / 500
    x = 0.1 * np.abs(np.mod(t, 2.0) - 1.0)
    v = np.gradient(x, t)
    force = DRY * np.sign(np.round(v, 6)) + DAMPING * v
    prepare_force(make_record("triangle", {"t": t, "x": x, "force": force}), base())


def test_what_to_measure_next_makes_an_ambiguous_name_a_certain_one() -> None:
    """Noise hides whether friction grows with the speed or its square; the proposed motion shows it."""
    options = Options(quick=True, compare="force", candidates=("viscous", "quadratic_drag"))
    records = [record_of("viscous", 0.1, 0.5, 0.0, seed, 8.0) for seed in (1, 2)]
    verdict = discover(base("viscous"), records[:1], records[1:], options)
    assert (verdict["outcome"], verdict["alternatives"]) == ("ambiguous", ["quadratic_drag"])
    sizes = [one["d_prime"] for one in verdict["experiments"]]
    assert sizes == sorted(sizes, reverse=True)
    asked = verdict["experiments"][0]
    assert asked["d_prime"] > 10
    assert f"{asked['scale']:g} times the amplitude, {asked['rate']:g} times as fast" in asked["text"]
    measured = record_of("viscous", 0.1 * asked["scale"], 0.5 * asked["rate"], 0.0, 3, 8.0)
    verdict = discover(base("viscous"), [records[0], measured], records[1:], options)
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["viscous"])


@pytest.mark.long
def test_friction_of_no_closed_form_is_found_as_a_function() -> None:
    """A bump of the friction at 0.15 m/s: the family is named, and the function has the bump."""
    verdict = ask("bump", 0.005, candidates=("stribeck", "quadratic_drag", "viscous"))
    assert verdict["effects"] == ["friction_curve"]
    part = verdict["function"]["parts"][0]
    at, value = np.array(part["at"]), np.array(part["value"])
    true = DRY + DAMPING * at + LAWS["bump"](0 * at, np.maximum(at, 1e-9))
    inner = at > 0.02
    assert value[inner] == pytest.approx(true[inner], abs=0.25)


def fitted(record, machine):
    """The base machine fitted to a record."""
    return fit_base(gather([prepare_force(record, machine)], 1.0, None), machine, MASS)


def test_the_force_is_that_of_the_equation_of_motion() -> None:
    """The force, its derivatives and the fitted numbers."""
    found = fitted(record_of("nothing", 0.1, 0.5, 0.005, 1), base())
    problem, motion = found.problem, found.problem.prepared[0].driven
    made = problem.evaluate(problem.values, None)
    at, used = problem.segments.index, made.used > 0
    a, v, sign = motion.a[at], motion.v[at], np.sign(motion.v[at])
    true = MASS * a + DAMPING * v + DRY * sign
    assert made.force[used] == pytest.approx(true[used], abs=1e-5)
    wanted = {
        "body.mass": (MASS, a + COEFFICIENT * GRAVITY * sign),
        "friction.kinetic_coefficient": (COEFFICIENT, MASS * GRAVITY * sign),
        "friction.damping": (DAMPING, v),
    }
    assert [one.path for one in problem.free] == list(wanted)
    sigma = problem.prepared[0].deviation(at)
    for index, (value, slope) in enumerate(wanted.values()):
        assert found.fit.values[index] == pytest.approx(value, rel=0.02)
        assert (sigma * made.by_parameter[:, :, index])[used] == pytest.approx(slope[used], abs=2e-3)


def test_friction_with_a_memory_that_depends_on_position() -> None:
    """Against Dahl's equation in small steps; the motion turns between samples."""
    machine = base().with_effect("position_dependent_friction", {"slope": 2.0})
    machine = machine.with_effect("dahl", {"stiffness": 1500.0})
    record = record_of("nothing", 0.1, 0.5, 0.0, 1)
    motion = gather([prepare_force(record, machine)], 1.0, None).prepared[0].driven
    t = np.arange(record.t.size * 100) / (100 * RATE)
    x = 0.1 * np.sin(np.pi * t + 0.3)
    dry = ((1 + 2 * x) * memory(x, 1500.0, False))[::100]
    needed = force_needed(machine, {}, motion, record.force, record.pieces)
    inner = motion.moves & (record.t > 1.5)
    true = MASS * motion.a + DAMPING * motion.v + dry
    assert needed[inner] == pytest.approx(true[inner], abs=0.01)


def test_the_memory_of_friction_begins_where_a_triangle_turns() -> None:
    """Between samples: the corner of a motion of constant speeds, 2 mm from sample to sample."""
    t = np.arange(400 * FINE) / (RATE * FINE)
    x = 0.05 * 2 / np.pi * np.arcsin(np.sin(2 * np.pi * t + 0.31))
    record = make_record(
        "triangle", {"t": t[::FINE], "x": x[::FINE], "force": memory(x, 1500.0, False)[::FINE]}
    )
    machine = base().with_effect("dahl", {"stiffness": 1500.0})
    motion = gather([prepare_force(record, machine)], 1.0, None).prepared[0].driven
    needed = force_needed(machine, {}, motion, record.force, record.pieces)
    inner = motion.moves & (record.t > 1.0)
    near = np.abs(motion.a) < 0.1
    error = (needed - MASS * motion.a - DAMPING * motion.v - record.force)[inner & near]
    assert (inner & near).sum() > 200
    assert np.max(np.abs(error)) < 0.05


def test_rest_and_turning_points_are_not_compared() -> None:
    """Where the body does not move friction is whatever holds it."""
    t = np.arange(800) / RATE
    held = (t > 3.0) & (t < 4.0)
    angle = np.pi * np.where(t < 3.0, t, np.where(held, 3.0, t - 1.0)) + np.pi / 2
    noise = np.random.default_rng(3).standard_normal((2, t.size))
    record = make_record("held", {"t": t, "x": 0.1 * np.sin(angle) + 1e-6 * noise[0], "force": noise[1]})
    motion = gather([prepare_force(record, base())], 1.0, None).prepared[0].driven
    t, held = record.t, (record.t > 3.0) & (record.t < 4.0)
    assert motion.moves[(t > 3.1) & (t < 3.9)].mean() < 0.05
    turned = np.flatnonzero((motion.v[1:] * motion.v[:-1] < 0) & (t[:-1] > 3.5))
    assert not motion.moves[turned].any()
    assert motion.moves[~held & (t > 1.0)].mean() > 0.9


def test_a_long_record_is_compared_in_means_of_neighbours() -> None:
    count = 2 * RECORDS.most_in_force + 1
    t = np.arange(count) * 1e-4
    x = 0.1 * np.sin(2 * np.pi * t)
    force = np.sign(np.cos(2 * np.pi * t)) + 0.1 * np.random.default_rng(1).standard_normal(count)
    record = make_record("long", {"t": t, "x": x, "force": force}, {"force_noise_sigma_n": "0.1"})
    prepared = prepare_force(record, base())
    assert prepared.record.t.size == count // 3
    assert prepared.sigma == pytest.approx(0.1 / np.sqrt(3))
    assert "means of 3 neighbours" in " ".join(prepared.notes)


def test_the_noise_is_that_of_a_record_at_rest() -> None:
    """A drift of the load cell is none."""
    t = np.arange(500) / RATE
    force = 3.0 + 0.2 * t + 0.07 * np.random.default_rng(5).standard_normal(t.size)
    rest = make_record("rest", {"t": t, "x": 0 * t, "force": force}, at_rest=True)
    prepared = prepare_force(record_of("nothing", 0.1, 0.5, 0.02, 1), base(), rest)
    assert prepared.sigma == pytest.approx(0.07, rel=0.1)
    assert prepared.sigma_stated
    still = make_record("still", {"t": t, "x": 0 * t}, at_rest=True)
    with pytest.raises(SeparatrixError, match="still: no column 'force'"):
        prepare_force(record_of("nothing", 0.1, 0.5, 0.02, 1), base(), still)


def test_what_is_no_record_of_a_driven_joint_is_refused() -> None:
    record = record_of("nothing", 0.1, 0.5, 0.0, 1)
    without = make_record("still", {"t": record.t, "x": record.x})
    with pytest.raises(SeparatrixError, match="still: no column 'force'"):
        prepare_force(without, base())
    other = CASE.replace('law = "measured_force"\ninterval = "1 ms"\nforce = [0.0, 0.0]', 'law = "none"')
    with pytest.raises(SeparatrixError, match="drive.law: allowed with --compare force"):
        prepare_force(record, Model.from_text(other))


def test_the_command_reads_the_column_f_and_writes_a_case_that_runs(tmp_path: Path) -> None:
    paths = []
    for record in records_of("quadratic_drag", 0.005):
        paths.append(tmp_path / f"{record.name}.csv")
        table = np.column_stack([record.t, 1e3 * record.x, record.force])
        np.savetxt(paths[-1], table, delimiter=",", header="t [s],x [mm],F [N]", comments="", fmt="%.10g")
    case, out = tmp_path / "slide.toml", tmp_path / "out"
    case.write_text(CASE)
    asked = ["--compare", "force", "--effects", "quadratic_drag,stribeck", "--quick", "--quiet"]
    assert main([str(case), *map(str, paths), "--out", str(out), *asked]) == os.EX_OK
    verdict = json.loads((out / "verdict.json").read_text())
    assert verdict["effects"] == ["quadratic_drag"]
    assert "The force that drives the body" in (out / "report.html").read_text()
    extended = Model.read(out / "extended.toml")
    assert extended.parameters["effect.quadratic_drag.coefficient"].value == pytest.approx(12, rel=0.05)


def test_a_record_sampled_far_faster_than_it_moves_has_its_acceleration():
    """Tuned on its first 0.12 s the smoother followed the noise, and the mass came out small."""
    random = np.random.default_rng(3)
    t = np.arange(0, 6, 2e-4)
    x = 0.1 * np.sin(np.pi * t) + 1e-6 * random.standard_normal(t.size)
    true = -0.1 * np.pi**2 * np.sin(np.pi * t)
    period = 2 / 2e-4
    error = smooth(t, x, 1e-6, period, stride(period, t.size)).state[:, 2] - true
    assert np.std(error) < 0.03 * np.std(true)
