# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""libseparatrix from Python: the motion is the program's, its texts are cases, refusals name the fault."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from program import CASE
from separatrix.library import CaseError, Model, effects, library_path

pytestmark = pytest.mark.usefixtures("library")

TIMES = np.linspace(0.0, 0.3, 7)


@pytest.fixture
def model() -> Model:
    """The published machine with Coulomb friction."""
    return Model.from_text(CASE)


def fly(model: Model, active=(), values=(), start=((0.5, 1.0, 0.3),), times=TIMES, **options):
    """All starts with the same times."""
    n = len(start)
    first = np.arange(n + 1) * len(times)
    return model.segments(
        list(active), np.array(values), np.array(start), first, np.tile(times, n), **options
    )


def test_needs_neither_mpi_nor_hdf5(library: Path) -> None:
    """Whoever fits a record on a laptop has neither."""
    needed = subprocess.run(["ldd", library], capture_output=True, text=True, check=True).stdout.lower()
    assert "libgfortran" in needed
    assert "mpi" not in needed
    assert "hdf5" not in needed


def test_shows_nothing_but_the_header(library: Path, source_dir: Path) -> None:
    """Every function of the library is declared, and every one declared is there."""
    header = (source_dir / "include" / "separatrix.h").read_text()
    listed = subprocess.run(
        ["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True
    ).stdout
    names = {line.split()[-1] for line in listed.splitlines()}
    assert names
    assert {name for name in names if f"{name}(" not in header} == set()
    assert {name for name in names if not name.startswith("separatrix_")} == set()


def test_a_segment_is_what_the_program_records(model: Model, separatrix: Path, tmp_path: Path) -> None:
    """`trajectory --record` samples the same motion."""
    case = tmp_path / "case.toml"
    case.write_text(
        CASE + '[record]\nrate = "200 Hz"\n[run]\nduration = 5\n[trajectory]\nsamples_per_period = 10\n'
    )
    command = [separatrix, "trajectory", case, "-o", tmp_path / "out.h5", "--record", tmp_path / "record.csv"]
    subprocess.run(command, check=True, capture_output=True)
    t, x = np.loadtxt(tmp_path / "record.csv", delimiter=",", comments="#", skiprows=10, unpack=True)
    result = fly(model, start=[(0.4, 0.0, 0.0)], times=t, derivatives=False)
    np.testing.assert_allclose(result.x, x, rtol=0, atol=1e-9)
    assert result.impacts[0] > 0
    assert result.jacobian is None


def test_the_written_case_is_the_model(model: Model, separatrix: Path, tmp_path: Path) -> None:
    """Read back, it moves the same to the bit; the program accepts it."""
    values = {"restoring.stiffness": 91.0, "drive.cosine[2]": 0.0123, "contact.upper": 1.15}
    text = model.to_text(values)
    again = Model.from_text(text)
    assert {path: again.parameters[path].value for path in values} == values
    expected = fly(model, values, list(values.values()), derivatives=False)
    np.testing.assert_array_equal(fly(again, derivatives=False).x, expected.x)
    assert again.period == 2 * np.pi / model.drive_frequency(values)
    path = tmp_path / "written.toml"
    path.write_text(text)
    subprocess.run([separatrix, "trajectory", "--validate", path], check=True, capture_output=True)


def test_parameters_have_values_units_and_bounds(model: Model) -> None:
    """As the case has them, in SI units."""
    assert model.parameters["restoring.free_length"].value == 0.4
    assert model.parameters["restoring.stiffness"].unit == "N/m"
    assert model.parameters["contact.restitution"].upper == 1.0
    assert model.parameters["drive.sine[3]"].value == -0.02686
    assert model.parameters["drive.mean"].lower == -np.inf
    assert "contact.lower" not in model.parameters
    assert model.period == pytest.approx(2 * np.pi / (1.2 * np.sqrt(88.82643960980423)))


def test_derivatives_are_those_of_other_calls(model: Model) -> None:
    """Columns are the active parameters in the order asked for, then the start."""
    active, values = ["drive.mean", "restoring.stiffness"], np.array([0.31, 90.0])
    starts = np.array([(0.5, 1.0, 0.3), (1.0, 4.0, 1.0), (0.6, 0.2, 4.0)])
    result = fly(model, active, values, starts)
    assert result.steady.all()
    assert result.impacts.sum() > 0
    for k in range(5):
        sides = []
        for sign in (1, -1):
            moved, start = values.copy(), starts.copy()
            step = 1e-5 * (values[k] if k < 2 else 1.0)
            if k < 2:
                moved[k] += sign * step
            else:
                start[:, k - 2] += sign * step
            sides.append(fly(model, active, moved, start, derivatives=False))
        for jacobian, name in ((result.jacobian[:, 0], "x"), (result.jacobian[:, 1], "v")):
            expected = (getattr(sides[0], name) - getattr(sides[1], name)) / (2 * step)
            np.testing.assert_allclose(
                jacobian[:, k], expected, rtol=0, atol=1e-4 * np.abs(expected).max() + 1e-9
            )


def test_derivatives_along_directions_are_sums(model: Model) -> None:
    """Of those by each parameter, at the machine and at the sensor; directions of nothing give nothing."""
    active = ["drive.cosine[1]", "drive.sine[1]", "contact.restitution", "restoring.stiffness"]
    values = np.array([model.parameters[path].value for path in active])
    starts = np.array([(0.5, 1.0, 0.3), (1.0, 4.0, 1.0), (0.6, 0.2, 4.0)])
    directions = np.array([[0.3, -0.2, 0, 0], [0, 0, 1e-3, 2.0], [0, 0, 0, 0]])
    single = fly(model, active, values, starts)
    along = fly(model, active, values, starts, directions=directions)
    for number in range(2):
        parts, sums = single.jacobian[:, number], along.jacobian[:, number]
        expected = parts[:, :4] @ directions.T
        assert np.abs(expected[:, :2]).max() > 1e-3
        np.testing.assert_allclose(sums[:, :3], expected, rtol=0, atol=1e-5 * np.abs(expected).max())
        np.testing.assert_array_equal(sums[:, 3:], parts[:, 4:])
    sensor = Model.from_text(CASE + "[effect.sensor_gain]\ngain = 0.01\n[effect.sensor_bias]\nbias = 0.002\n")
    names = ["effect.sensor_bias.bias", "effect.sensor_gain.gain", "restoring.stiffness"]
    values = np.array([sensor.parameters[path].value for path in names])
    parts = fly(sensor, names, values, starts).jacobian[:, 0, :3]
    both = fly(sensor, names, values, starts, directions=[[2.0, 3.0, 0.5]]).jacobian[:, 0, 0]
    np.testing.assert_allclose(both, parts @ [2.0, 3.0, 0.5], rtol=0, atol=1e-6)
    with pytest.raises(CaseError, match="directions"):
        fly(model, active, [1.0, 1.0, 0.5, 90.0], starts, directions=np.full((1, 4), np.nan))


def test_impacts_are_listed(model: Model) -> None:
    """Speeds after and before an impact are in the ratio of the restitution."""
    result = fly(model, start=[(0.5, 0.0, 0.0), (1.0, 4.0, 0.0), (1.05, 3.0, 1.0)], derivatives=False)
    assert result.impacts.sum() == len(result.impact.segment) > 1
    np.testing.assert_array_equal(np.bincount(result.impact.segment, minlength=3), result.impacts)
    np.testing.assert_allclose(result.impact.speed_after, 0.5 * result.impact.speed_before, rtol=1e-12)
    assert set(result.impact.side) == {1}
    assert (result.impact.time < TIMES[-1]).all()


def test_more_impacts_than_room_are_all_listed(model: Model) -> None:
    """The room grows with what happens."""
    result = fly(model, start=[(0.4, 0.0, 0.0)], times=np.array([200.0]), derivatives=False)
    assert result.impacts[0] == len(result.impact.time) > 68
    assert (np.diff(result.impact.time) > 0).all()


def test_a_start_that_is_none_has_a_reason(model: Model) -> None:
    """NaN, and a position beyond the barrier; the segment between them is flown."""
    result = fly(model, start=[(np.nan, 0.0, 0.0), (0.5, 0.0, 0.0), (1.2, 0.0, 0.0)])
    assert result.reason.tolist() == [65, 0, 65]
    assert result.steady.tolist() == [False, True, False]
    np.testing.assert_array_equal(np.isnan(result.x.reshape(3, -1)).all(axis=1), [True, False, True])


def test_effects_are_those_of_the_program(separatrix: Path) -> None:
    """Name, parameters, units and bounds as `separatrix laws --json` has them."""
    text = subprocess.run([separatrix, "laws", "--json"], capture_output=True, text=True, check=True).stdout
    listed = {row["law"]: row for row in json.loads(text) if row["family"] == "effect"}
    found = effects()
    assert found.keys() == listed.keys()
    assert len(found) > 15
    for name, effect in found.items():
        assert effect.meaning == listed[name]["meaning"]
        rows = {row["name"]: row for row in listed[name]["parameters"]}
        assert effect.parameters.keys() == rows.keys()
        for parameter, one in effect.parameters.items():
            assert one.unit == rows[parameter]["unit"]
            assert one.lower == (-np.inf if rows[parameter]["lower"] is None else rows[parameter]["lower"])
            assert np.isnan(one.value) != rows[parameter]["optional"]


EFFECTS = {
    "viscous.damping": 0.3,
    "coulomb.force": 0.2,
    "quadratic_drag.coefficient": 0.1,
    "static_excess.force": 0.5,
    "asymmetric_friction.coulomb": 0.3,
    "position_dependent_friction.slope": 0.4,
    "cubic_spring.stiffness": 30.0,
    "offset_force.force": 1.0,
    "restitution_slope.slope": 0.02,
    "second_barrier.position": -0.2,
    "drive_ripple.sine": 0.05,
    "sensor_bias.bias": 0.01,
    "sensor_gain.gain": 0.02,
    "sensor_delay.delay": 0.003,
    "dahl.stiffness": 2000.0,
    "compliant_contact.stiffness": 1e5,
}


def effect_may_be_zero(path: str) -> bool:
    """A stiffness must be positive, and a barrier is somewhere."""
    return path not in ("dahl.stiffness", "compliant_contact.stiffness", "second_barrier.position")


@pytest.mark.parametrize("path", EFFECTS)
def test_an_effect_has_a_derivative(path: str, separatrix: Path, tmp_path: Path) -> None:
    """It is addressable, its derivative is that of another step, its text a case that moves the same."""
    name, parameter = path.split(".")
    value = EFFECTS[path]
    model = Model.from_text(CASE + f"[effect.{name}]\n{parameter} = {value}\n")
    key = f"effect.{path}"
    assert model.parameters[key].value == value
    starts = np.array([(0.5, 1.0, 0.3), (0.9, 4.0, 1.0), (0.6, -2.0, 4.0)])
    result = fly(model, [key], [value], starts)
    step = 1e-4 * value
    sides = [
        fly(model, [key], [value + s * step], starts, derivatives=False, tolerance=1e-12) for s in (1, -1)
    ]
    expected = (sides[0].x - sides[1].x) / (2 * step)
    np.testing.assert_allclose(
        result.jacobian[:, 0, 0], expected, rtol=0, atol=1e-3 * np.abs(expected).max() + 1e-9
    )
    written = tmp_path / "case.toml"
    written.write_text(model.to_text({key: 1.1 * value}))
    subprocess.run([separatrix, "trajectory", "--validate", written], check=True, capture_output=True)
    again = fly(Model.read(written), start=starts, derivatives=False)
    np.testing.assert_array_equal(again.x, fly(model, [key], [1.1 * value], starts, derivatives=False).x)


@pytest.mark.parametrize("path", [path for path in EFFECTS if effect_may_be_zero(path)])
def test_an_effect_of_size_zero_has_a_derivative(path: str) -> None:
    """A fit begins there. Many leave the closed form with the first step."""
    name, parameter = path.split(".")
    model = Model.from_text(CASE + f"[effect.{name}]\n{parameter} = 0\n")
    starts = np.array([(0.5, 1.0, 0.3), (0.9, 4.0, 1.0), (0.6, -2.0, 4.0)])
    result = fly(model, [f"effect.{path}", "drive.mean"], [0.0, 0.31055], starts)
    assert result.steady.all()
    step = 2e-4 * EFFECTS[path]
    values = [
        fly(model, [f"effect.{path}"], [k * step], starts, derivatives=False, tolerance=1e-12).x
        for k in (1, 2)
    ]
    expected = (4 * values[0] - values[1] - 3 * result.x) / (2 * step)
    np.testing.assert_allclose(
        result.jacobian[:, 0, 0], expected, rtol=0, atol=1e-3 * np.abs(expected).max() + 1e-7
    )
    plain = fly(Model.from_text(CASE), ["drive.mean"], [0.31055], starts)
    np.testing.assert_array_equal(result.jacobian[:, :, 1:], plain.jacobian)


def test_a_sensor_shows_another_position(model: Model) -> None:
    """Bias and gain change the record, a delay the time; the motion is the same."""
    text = CASE + "[effect.sensor_bias]\nbias = 0.01\n[effect.sensor_gain]\ngain = 0.1\n"
    seen, moved = fly(Model.from_text(text), derivatives=False), fly(model, derivatives=False)
    np.testing.assert_allclose(seen.x, 1.1 * moved.x + 0.01, rtol=1e-15)
    np.testing.assert_array_equal(seen.v, moved.v)
    late = Model.from_text(CASE + "[effect.sensor_delay]\ndelay = 0.05\n")
    before = [(0.5, 1.0, 0.3 - 0.05 * model.drive_frequency({}))]
    expected = fly(model, start=before, derivatives=False).x
    np.testing.assert_allclose(fly(late, derivatives=False).x, expected, rtol=0, atol=1e-13)


def test_a_measured_force_is_taken_from_the_call() -> None:
    """A mass under a force that rises linearly, from three times of its record: the closed form."""
    text = '[body]\nmass = 2\n[restoring]\nlaw = "none"\n[drive]\nlaw = "measured_force"\ninterval = 1\n'
    model = Model.from_text(text + "force = [0, 0]\n")
    assert set(model.parameters) == {"body.mass", "body.gravity"}
    begins, interval, rise = np.array([0.0, 0.123, 0.4]), 0.01, 5.0
    samples = rise * interval * np.arange(101)
    starts = np.array([(0.1, 0.2, 0.0)] * 3)
    options = {"active": ["body.mass"], "values": [2.0], "start": starts}
    result = fly(model, **options, force=(begins, interval, samples))
    pushed = rise * (np.repeat(begins, 7) * np.tile(TIMES, 3) ** 2 / 2 + np.tile(TIMES, 3) ** 3 / 6)
    np.testing.assert_allclose(result.x, 0.1 + 0.2 * np.tile(TIMES, 3) + pushed / 2, rtol=0, atol=1e-11)
    np.testing.assert_allclose(result.jacobian[:, 0, 0], -pushed / 4, rtol=0, atol=1e-5)
    np.testing.assert_allclose(result.jacobian[:, 0, 2], np.tile(TIMES, 3), rtol=0, atol=1e-5)
    with pytest.raises(CaseError, match=r"force: segments from 0.0 to 1.1\d* s, allowed 0 to 1.0 s"):
        fly(model, **options, force=(2 * begins, interval, samples))


def test_a_pendulum_is_a_machine() -> None:
    """Its small motions have the frequency sqrt(moment/inertia), whose derivative is known."""
    text = '[body]\nmass = 0.5\n[restoring]\nlaw = "pendulum"\nmoment = 8\n'
    times = np.linspace(0, 1, 11)
    result = fly(Model.from_text(text), ["restoring.moment"], [8.0], [(1e-4, 0.0, 0.0)], times)
    np.testing.assert_allclose(result.x, 1e-4 * np.cos(4 * times), rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        result.jacobian[:, 0, 0], -1e-4 * times * np.sin(4 * times) / 4, rtol=0, atol=1e-8
    )


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("mass = 1.0", "mass = -1.0"), ["case:3", "body.mass", "-1", "more than 0"]),
        (("stiffness = 88", "stifness = 88"), ["case:6", "restoring.stifness", "stiffness"]),
        (('law = "coulomb"', 'law = "columb"'), ["case:9", "friction.law", "columb", "coulomb"]),
    ],
)
def test_a_bad_case_names_line_and_key(change: tuple[str, str], expected: list[str]) -> None:
    """The message is that of the program."""
    with pytest.raises(CaseError) as refusal:
        Model.from_text(CASE.replace(*change))
    assert refusal.value.code == 65
    for part in expected:
        assert part in str(refusal.value)


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    """Code 66, as of the program."""
    with pytest.raises(CaseError, match="nowhere.toml") as refusal:
        Model.read(tmp_path / "nowhere.toml")
    assert refusal.value.code == 66


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"active": ["restoring.stifness"], "values": [1.0]}, "did you mean 'restoring.stiffness'"),
        ({"active": ["restoring.stiffness"], "values": [-1.0]}, "allowed more than 0"),
        ({"active": ["restoring.stiffness"], "values": [np.nan]}, "allowed more than 0"),
        ({"active": ["restoring.stiffness"], "values": [1.0, 2.0]}, r"values: found shape \(2,\)"),
        ({"active": ["drive.mean", "drive.mean"], "values": [1.0, 2.0]}, "active: found 'drive.mean' twice"),
        ({"start": [(0.5, 1.0)]}, r"start: found shape \(1, 2\)"),
        ({"times": np.array([0.1, 0.05])}, r"times\[1\]: found 0.05 s in segment 0"),
        ({"times": np.array([-0.1])}, "at least 0"),
        ({"times": np.array([1e9])}, "at most 100000.* drive periods"),
        ({"tolerance": 0.1}, "tolerance: found 0.1"),
        ({"force": (np.zeros(1), 0.1, np.zeros(9))}, "measured_force"),
    ],
)
def test_a_bad_call_reports_what_is_wrong(model: Model, options: dict, expected: str) -> None:
    """What was found and what is allowed."""
    with pytest.raises(CaseError, match=expected):
        fly(model, **options)


def test_the_example_of_the_page_runs(source_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """docs/library.md shows what works."""
    monkeypatch.chdir(source_dir)
    page = (source_dir / "docs" / "library.md").read_text()
    names: dict = {}
    exec(page.split("```python\n")[1].split("```")[0], names)
    assert names["result"].x.shape == (100,)
    assert names["result"].jacobian.shape == (100, 2, 5)


def test_a_hammer_is_refused(source_dir: Path) -> None:
    """A start does not state which impulses are still to come."""
    with pytest.raises(CaseError, match="impulses"):
        fly(Model.read(source_dir / "examples" / "hammer.toml"))


def test_the_library_is_looked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The variable first, then beside the program."""
    assert str(library_path()).endswith("lib/libseparatrix.so")
    monkeypatch.delenv("SEPARATRIX_LIBRARY")
    (tmp_path / "bin").mkdir()
    (tmp_path / "lib").mkdir()
    program = tmp_path / "bin" / "separatrix"
    program.touch(mode=0o755)
    (tmp_path / "lib" / "libseparatrix.so").touch()
    monkeypatch.setenv("PATH", str(program.parent))
    assert library_path() == tmp_path / "lib" / "libseparatrix.so"


def test_the_table_of_effects_states_what_each_is_and_needs() -> None:
    found = effects()
    assert found["stribeck"].family == "friction over speed"
    assert (found["stribeck"].amplitudes, found["stribeck"].sizes) == (("excess",), ("velocity",))
    assert found["restitution_slope"].acts == "barrier"
    assert found["compliant_contact"].needs == "contact.restitution"
    for name, one in found.items():
        assert one.acts in ("flight", "barrier", "sensor")
        assert {*one.amplitudes, *one.sizes} <= one.parameters.keys()
        # confusion is mutual
        assert all(name in found[other].confused for other in one.confused)


def test_a_model_with_an_effect_is_that_of_its_case() -> None:
    model = Model.from_text(CASE)
    extended = model.with_effect("cubic_spring", {"stiffness": 12.5})
    written = Model.from_text(CASE + "\n[effect.cubic_spring]\nstiffness = 12.5\n")
    assert extended.parameters == written.parameters
    assert extended.to_text({}) == written.to_text({})
    # defaults of what is not given
    both = extended.with_effect("drive_ripple", {"sine": 0.01})
    assert both.parameters["effect.drive_ripple.cosine"].value == 0


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("cubic", {}, "effect 'cubic': unknown; allowed viscous"),
        ("cubic_spring", {}, "'stiffness' is missing"),
        ("cubic_spring", {"stifness": 1.0}, "parameter 'stifness': unknown; allowed stiffness"),
        ("viscous", {"damping": -1.0}, "allowed at least 0"),
    ],
)
def test_an_effect_that_makes_no_case_is_refused(name: str, values: dict, reason: str) -> None:
    with pytest.raises(CaseError, match=reason):
        Model.from_text(CASE).with_effect(name, values)
    viscous = Model.from_text(CASE).with_effect("viscous", {"damping": 0.1})
    with pytest.raises(CaseError, match="the case has it already"):
        viscous.with_effect("viscous", {"damping": 0.1})
