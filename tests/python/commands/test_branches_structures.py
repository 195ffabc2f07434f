# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`branches` and `stability` of structures and of machines without a clock, against closed forms."""

import json
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from program import succeed
from separatrix.open import decode_flags, open_result


@pytest.fixture
def follow(separatrix: Path, source_dir: Path, tmp_path: Path):
    """Follows the orbits of an example over a parameter; returns the labelled points and the file."""

    def follow_it(case: str, name: str, start: float, end: float, *more: str) -> tuple[list[dict], Path]:
        out = tmp_path / "out.h5"
        words = ("--parameter", name, "--from", start, "--to", end, "--json", "-o", out, *more)
        output = succeed(separatrix, "branches", source_dir / "examples" / case, *words, folder=tmp_path).out
        lines = map(json.loads, output.splitlines())
        return [line for line in lines if line["event"] == "point"], out

    return follow_it


def amplitude(frequency: float) -> float:
    """Largest position of the second of two masses without the stop."""
    coupled = np.array([[2.0, -1.0], [-1.0, 1.0]])
    system = coupled - frequency**2 * np.eye(2) + 0.04j * frequency * coupled
    return abs(np.linalg.solve(system, [1, 0])[1])


def test_two_masses_with_a_stop(follow):
    """Fold and Neimark-Sacker point with one impact a period in closed form; the graze by its amplitude."""
    points, out = follow("structure_two_masses.toml", "drive.force.frequency", 0.9, 1.2, "--searches", "4")
    found = {point["label"]: point for point in points}
    assert found["NS"]["parameter"] == pytest.approx(0.909658534285, abs=1e-11)
    assert found["SN"]["parameter"] == pytest.approx(1.144117503720, abs=1e-11)
    assert amplitude(found["GR-fold"]["parameter"]) == pytest.approx(1, abs=1e-10)
    assert found["SN"]["multipliers"][:2] == pytest.approx([1, 0], abs=1e-8)
    assert np.hypot(*found["NS"]["multipliers"][:2]) == pytest.approx(1, abs=1e-8)
    with open_result(out) as result:
        assert result.sizes["multiplier"] == 4
        multipliers = result["multiplier_real"].values + 1j * result["multiplier_imag"].values
        # next to a graze one multiplier is beyond what rounding leaves of the others
        plain = (decode_flags(result["label"]).values == "none") & (abs(multipliers[:, 0]) < 100)
        # what damping and an impact change of volumes
        drive, hits = result["parameter"].values[plain], result["impacts"].values[plain]
        expected = np.exp(-0.12 * 2 * np.pi / drive) * 0.64**hits
        assert np.prod(multipliers[plain], axis=1).real == pytest.approx(expected, rel=1e-6)


TWO_IMPACTS = """
[body.a]
mass = 1
[body.b]
mass = 0.5
[spring.g]
between = ["a"]
stiffness = 1
damping = 0.06
[spring.c]
between = ["a", "b"]
stiffness = 0.8
damping = 0.05
[contact.w]
between = ["b"]
law = "newton"
restitution = 0.7
upper = 1.2
[drive.f]
law = "force"
body = "a"
amplitude = 0.4
frequency = 0.75
[watch]
body = "b"
[run]
duration = 500
"""


def test_a_graze_that_is_met_from_the_side_of_the_impact_has_its_name(follow, tmp_path: Path):
    """Beside it the derivative is beyond what rounding leaves: the branches ended there without a name."""
    case = tmp_path / "two.toml"
    case.write_text(TWO_IMPACTS)
    points, out = follow(case, "drive.f.frequency", 0.83, 0.88, "--searches", "3")
    with open_result(out) as result:
        assert "not_known" not in set(decode_flags(result["label"]).values)
    grazes = [point["parameter"] for point in points if point["label"] == "GR-fold"]
    assert pytest.approx(0.8506164517288, abs=1e-11) in grazes


def labelled(out: Path) -> list[tuple[int, str, float, float]]:
    """Branch, label, parameter and position of every labelled point."""
    with open_result(out) as result:
        labels = decode_flags(result["label"]).values
        named = labels != "none"
        values = (result[name].values[named] for name in ("parameter", "x"))
        return list(zip(result["branch"].values[named], labels[named], *values, strict=True))


@pytest.mark.parametrize(
    "restitution",
    [pytest.param(0.65, marks=pytest.mark.long), 0.7, pytest.param(0.75, marks=pytest.mark.long)],
)
def test_no_branch_is_run_through_twice(follow, tmp_path: Path, restitution: float):
    """A branch that has turned back at a graze, or whose instants pass the section, seemed closed."""
    case = tmp_path / "two.toml"
    case.write_text(MANY_GRAZES)
    points, out = follow(
        case,
        "drive.force.frequency",
        1,
        1.8,
        "--searches",
        "4",
        "--set",
        f"contact.stop.restitution={restitution}",
    )
    there = [(branch, label, round(at, 9), round(x, 4)) for branch, label, at, x in labelled(out)]
    assert len(set(there)) == len(there)
    assert sum(point["label"] == "closed" for point in points) == 1
    assert not any(point["label"] == "not_known" for point in points)
    if restitution == 0.7:
        # the orbit with an impact more that begins at the graze of one of half its period
        near = {
            point["label"]: point["parameter"]
            for point in points
            if 1.6884 < point["parameter"] < 1.6887 or 1.6895 < point["parameter"] < 1.68961
        }
        assert near["SN"] == pytest.approx(1.689606082241, abs=1e-10)
        assert near["PD"] == pytest.approx(1.688467345599, abs=1e-10)
        assert near["GR-fold"] == pytest.approx(1.689527898042, abs=1e-10)


@pytest.mark.long
def test_mirror_images_have_the_same_labels(follow, tmp_path: Path):
    """Between two stops: what is not its own mirror image comes twice, with the same labels."""
    case = tmp_path / "two.toml"
    stops = MANY_GRAZES.replace("restitution = 0.7, upper = 0.8", "restitution = 0.8, upper = 1, lower = -1")
    case.write_text(stops.replace("amplitude = 0.9", "amplitude = 0.5").split("axis =", maxsplit=1)[0])
    points, out = follow(case, "drive.force.frequency", 0.59, 0.63, "--searches", "2")
    assert not {"not_known", "too_long"} & {point["label"] for point in points}
    kinds = ("SN", "PD", "NS", "GR", "GR-fold")
    found = Counter((label, round(at, 8)) for _, label, at, _ in labelled(out) if label in kinds)
    assert len(found) >= 10
    assert all(count % 2 == 0 for count in found.values())
    # one whose impacts on both stops graze at once, and one that loses its symmetry
    assert found["GR", 0.61714608] == 4
    symmetric = [point for point in points if point["label"] == "BP"]
    assert {round(point["parameter"], 8) for point in symmetric} == {0.62092151}


RUBBING = """
body.b.mass = 1.434
spring.s = { between = ["b"], stiffness = 3.096, damping = 0.4459 }
friction.f = { between = ["b"], force = 0.076, static_force = 0.076 }
contact.w = { between = ["b"], law = "newton", restitution = 0.825, upper = 0.561 }
drive.d = { law = "force", body = "b", amplitude = 3.811176, frequency = 0.880141953176069 }
run.duration = 200
"""
SOFT_AND_RUBBING = """
body = { a = { mass = 1.056 }, b = { mass = 1.063 } }
spring.s0 = { between = ["a"], stiffness = 0.983, damping = 0.042 }
spring.s1 = { between = ["a", "b"], stiffness = 2.528, damping = 0.167 }
friction.f = { between = ["b"], force = 0.18, static_force = 0.216 }
drive.d = { law = "force", body = "b", amplitude = 1.589, frequency = 1.826, angle = 3.141592653589793 }
watch.body = "a"
run.duration = 300
[contact.k0]
between = ["a", "b"]
law = "kelvin_voigt"
stiffness = 14.48
damping = 0.23
tension = 0
lower = -0.789
"""


def test_an_impact_that_turns_a_slide_round_is_lost_in_a_graze(follow, tmp_path: Path):
    """Its slide begins and ends with it: that is no onset of sticking, and the branch goes on."""
    case = tmp_path / "one.toml"
    case.write_text(RUBBING)
    points, _ = follow(case, "contact.w.upper", -0.039, 1.161, "--searches", "4")
    there = [point["label"] for point in points if abs(point["parameter"] - 1.118429273427) < 1e-9]
    assert there == ["GR-fold"]
    doubled = {point["branch"] for point in points if point["label"] == "GR-fold" and point["parameter"] > 1}
    ends = {point["label"] for point in points if point["branch"] in doubled}
    assert ends == {"GR-fold", "PD", "end_of_range"}


def test_a_contact_that_opens_as_friction_turns_is_no_graze(follow, tmp_path: Path):
    """The two events change their order; the branch ended there, and was followed three times."""
    case = tmp_path / "soft.toml"
    case.write_text(SOFT_AND_RUBBING)
    points, _ = follow(case, "drive.d.frequency", 1.369, 2.374, "--searches", "5")
    assert [point["label"] for point in points].count("GR") == 1
    assert {point["branch"] for point in points} == {1}
    assert points[1]["parameter"] == pytest.approx(2.004075787797, abs=1e-10)


MANY_GRAZES = """
body.first.mass = 1
body.second.mass = 0.6
spring.frame = { between = ["first"], stiffness = 1, damping = 0.06 }
spring.coupling = { between = ["first", "second"], stiffness = 0.8, damping = 0.05 }
contact.stop = { between = ["second"], law = "newton", restitution = 0.7, upper = 0.8 }
drive.force = { law = "force", body = "first", amplitude = 0.9, frequency = 1.3 }
watch.body = "second"
run = { duration = 800, window = 50, extension = 2 }
axis = [ { name = "x0", from = -2, to = 0.8, count = 21 }, { name = "v0", from = -3, to = 3, count = 21 } ]
"""


def test_multipliers_beside_a_graze_are_finite_but_for_one(follow, tmp_path: Path):
    """Mirror images of one motion graze at one value: one multiplier has no bound, the rest are the same."""
    case = tmp_path / "three.toml"
    case.write_text(BETWEEN_STOPS)
    points, _ = follow(case, "drive.d.frequency", 2.2, 2.3, "--searches", "2")
    grazes = [point for point in points if point["label"].startswith("GR") and point["word"] in {"L.", "R."}]
    unbounded = [
        np.reshape(point["multipliers"], (-1, 2)) for point in grazes if abs(point["multipliers"][0]) > 1e7
    ]
    assert len(unbounded) >= 2
    sizes = [np.sort(np.hypot(*values[1:].T)) for values in unbounded]
    assert sizes[0] == pytest.approx(sizes[1], abs=1e-6)
    assert (sizes[0] < 1).all()


BETWEEN_STOPS = """
[body.a]
mass = 1
[body.b]
mass = 1
[spring.s]
between = ["a"]
stiffness = 20
damping = 0.4
[spring.t]
between = ["a", "b"]
stiffness = 15
damping = 0.3
[friction.f]
between = ["b"]
force = 0.1
[contact.c]
between = ["a"]
law = "newton"
restitution = 0.6
upper = 0.3
lower = -0.3
[drive.d]
law = "force"
body = "b"
amplitude = 1.5
frequency = 2.5
[watch]
body = "a"
"""


def test_a_soft_stop(follow, source_dir: Path, tmp_path: Path):
    """The branch passes the graze both ways, which is where the amplitude without the stop is the gap."""
    text = (source_dir / "examples" / "structure_two_masses.toml").read_text()
    case = tmp_path / "soft.toml"
    case.write_text(text.replace('law = "newton"\nrestitution = 0.8', 'law = "kelvin_voigt"\nstiffness = 20'))
    # the seeds miss the stop, or meet it, or both
    for start, end in (0.99875, 1.01), (0.95, 1.05):
        points, out = follow(case, "drive.force.frequency", start, end, "--searches", "2", "--force")
        grazes = [point for point in points if point["label"].startswith("GR")]
        assert [point["label"] for point in grazes] == ["GR"]
        assert amplitude(grazes[0]["parameter"]) == pytest.approx(1, abs=1e-12)
        ends = [point["parameter"] for point in points if point["branch"] == grazes[0]["branch"]]
        assert {min(ends), max(ends)} <= {start, end}
        with open_result(out) as result:
            branch = result["branch"].values == grazes[0]["branch"]
            assert len(set(result["event_word"].values[branch])) == 2


def test_an_impact_may_pass_the_section(follow):
    """The orbit of one impact a period is stable, also where the impact comes at the section's phase."""
    setting = {
        "body.first.mass": 1.3, "body.second.mass": 0.7,
        "spring.frame.stiffness": 2.1, "spring.frame.damping": 0.11,
        "spring.coupling.stiffness": 1.7, "spring.coupling.damping": 0.05,
        "contact.stop.restitution": 0.72, "drive.force.amplitude": 1.375,
    }  # fmt: skip
    words = [word for name, value in setting.items() for word in ("--set", f"{name}={value}")]
    name = "drive.force.frequency"
    points, out = follow("structure_two_masses.toml", name, 0.85, 0.95, "--searches", "3", *words)
    assert {point["label"] for point in points} == {"end_of_range"}
    with open_result(out) as result:
        x = result["x"].values[result["parameter"].argsort()]
        assert (np.diff(np.sign(np.diff(x))) != 0).any()
        assert result["stable"].values.all()
        multipliers = result["multiplier_real"].values + 1j * result["multiplier_imag"].values
        assert abs(multipliers).max() < 0.9


def test_a_floating_structure(follow, tmp_path: Path):
    """Nothing ties the bodies to the ground: x is that of the watched one less the mean, in closed form."""
    case = tmp_path / "floating.toml"
    case.write_text(
        "[body.a]\nmass = 1\n[body.b]\nmass = 2\n[body.c]\nmass = 1.5\n"
        '[spring.ab]\nbetween = ["a", "b"]\nstiffness = 1\ndamping = 0.05\n'
        '[spring.bc]\nbetween = ["b", "c"]\nstiffness = 2\ndamping = 0.05\n'
        '[spring.ground]\nbetween = ["a"]\nstiffness = 0\ndamping = 0.3\n'
        '[drive.force]\nlaw = "force"\nbody = "a"\namplitude = 1\nfrequency = 1.14\n'
        '[watch]\nbody = "c"\n[run]\nduration = 500\n'
    )
    _, out = follow(case, "spring.ab.stiffness", 0.5, 6, "--searches", "1")
    first, second, ground = np.array([1, -1, 0]), np.array([0, 1, -1]), np.array([1, 0, 0])
    damping = 0.05 * np.outer(first, first) + 0.05 * np.outer(second, second) + 0.3 * np.outer(ground, ground)
    with open_result(out) as result:
        assert result["parameter"].values.min() == 0.5
        assert result["parameter"].values.max() == 6
        for stiffness, x, v in zip(*(result[name].values for name in ("parameter", "x", "v")), strict=True):
            springs = stiffness * np.outer(first, first) + 2 * np.outer(second, second)
            system = springs - 1.14**2 * np.diag([1, 2, 1.5]) + 1.14j * damping
            q = np.linalg.solve(system, [1, 0, 0])
            assert x == pytest.approx((q[2] - q.mean()).real, abs=1e-11)
            assert v == pytest.approx((1.14j * q[2]).real, abs=1e-11)


def test_two_blocks_on_a_belt(follow):
    """A limit cycle whose time is an unknown, one multiplier less, and the doublings of another."""
    points, out = follow(
        "structure_blocks_on_a_belt.toml", "friction.first.velocity", 0.19, 0.25, "--searches", "2"
    )
    with open_result(out) as result:
        assert result.sizes["multiplier"] == 3
        branch = result["branch"].values == result["branch"].values[np.argmin(result["cycle_time"].values)]
        cycle = np.interp(0.2, result["parameter"].values[branch], result["cycle_time"].values[branch])
        assert cycle == pytest.approx(3.8037379614, abs=1e-4)
    doubled = [point for point in points if point["label"] == "PD" and point["multipliers"][0] < 0]
    assert len(doubled) == 1
    assert doubled[0]["multipliers"][0] == pytest.approx(-1, abs=1e-8)


def test_stick_slip_ends_where_the_slide_just_comes_back(follow):
    """The slide in closed form: its fastest moment has the velocity of the belt."""
    case = "validation/structures/belt_coulomb.toml"
    points, _ = follow(case, "friction.belt.velocity", 0.6, 1, "--searches", "2")
    end = [point for point in points if point["label"] == "stick_onset"]
    assert len(end) == 1
    belt, decay = end[0]["parameter"], 0.025
    turning = np.sqrt(1 - decay**2)
    time = np.linspace(3, 9, 600_001)
    cosine = 1.5 - 0.05 * belt - 1
    sine = (belt + decay * cosine) / turning
    amplitude, rate = cosine - 1j * sine, -decay + 1j * turning
    fastest = np.max((amplitude * rate * np.exp(rate * time)).real)
    assert fastest == pytest.approx(belt, abs=1e-9)


def test_spectrum_of_an_impact_damper(separatrix: Path, source_dir: Path, tmp_path: Path):
    """Four exponents, whose sum is exact; those of a cycle come in pairs."""
    case = source_dir / "examples" / "structure_impact_damper.toml"
    output = succeed(separatrix, "stability", case, "--periods", 1000, "--json", folder=tmp_path).out
    lines = [json.loads(line) for line in output.splitlines()]
    values = [line["value"] for line in lines if line["event"] == "exponent"]
    total = next(line for line in lines if line["event"] == "sum")
    assert len(values) == 4
    assert total["found"] == pytest.approx(total["exact"], abs=1e-9)
    # moduli of the half-map 0.8678247 and 0.7878421, each of a pair (Masri and Caughey 1966)
    assert sum(values[:2]) == pytest.approx(2 * np.log(0.8678247) / np.pi, abs=1e-3)
    assert sum(values[2:]) == pytest.approx(2 * np.log(0.7878421) / np.pi, abs=1e-3)
    assert next(line for line in lines if line["event"] == "motion")["type"] == "periodic"


def curves(out: Path, label: str) -> tuple[np.ndarray, np.ndarray]:
    """Both parameters at the points of the curves of a label."""
    with open_result(out) as result:
        here = decode_flags(result["curve_label"]).values == label
        return result["curve_parameter"].values[here], result["curve_free"].values[here]


def test_curves_of_grazes_and_folds_in_two_parameters(follow):
    """A linear structure grazes where its amplitude is the gap; folds are those of other machines."""
    case, name = "structure_two_masses.toml", "drive.force.frequency"
    free = ("--free", "contact.stop.upper", "--free-from", "0.95", "--free-to", "1.2")
    _, out = follow(case, name, 0.9, 1.2, "--searches", "3", *free)
    frequency, gap = curves(out, "GR")
    assert len(gap) > 20
    assert gap.max() - gap.min() > 0.2
    assert [amplitude(value) for value in frequency] == pytest.approx(gap, abs=1e-9)
    frequency, gap = curves(out, "SN")
    assert gap.max() == pytest.approx(1.2, abs=1e-12)
    points, _ = follow(case, name, 1.1, 1.15, "--searches", "3", "--set", "contact.stop.upper=1.2", "--force")
    fold = next(point["parameter"] for point in points if point["label"] == "SN")
    assert frequency[gap.argmax()] == pytest.approx(fold, abs=1e-9)


@pytest.mark.long
def test_curves_of_doublings_of_a_machine_without_a_clock(follow):
    case, name = "structure_blocks_on_a_belt.toml", "friction.first.velocity"
    free = ("--free", "spring.coupling.stiffness", "--free-from", "1.2", "--free-to", "1.25")
    _, out = follow(case, name, 0.15, 0.3, "--searches", "2", *free)
    velocity, stiffness = curves(out, "PD")
    more = ("--searches", "2", "--set", "spring.coupling.stiffness=1.25", "--force")
    points, _ = follow(case, name, 0.15, 0.3, *more)
    doublings = {round(point["parameter"], 9) for point in points if point["label"] == "PD"}
    reached = velocity[abs(stiffness - 1.25) < 1e-12]
    assert sorted(reached) == pytest.approx(sorted(doublings), abs=2e-9)


def test_onset_of_sticking_of_a_pair_scales_with_its_mass(follow):
    """Friction over mass times acceleration of the platform is 2/sqrt(4 + pi^2)."""
    free = ("--free", "body.driven_mass", "--free-from", "0.5", "--free-to", "2")
    _, out = follow("sweep_pair_kappa.toml", "body.friction", 0.4, 0.7, "--searches", "2", *free)
    friction, mass = curves(out, "stick_onset")
    assert len(mass) > 20
    assert friction / mass == pytest.approx(2 / np.sqrt(4 + np.pi**2), abs=1e-11)


CRANK = """
[body.block]
mass = 1
[spring.frame]
between = ["block"]
stiffness = {stiffness!r}
[friction.guide]
between = ["block"]
force = 1.962
[contact.stop]
between = ["block"]
law = "newton"
restitution = 0.5
upper = 0.38945
[drive.force]
law = "force"
body = "block"
frequency = 8.13
cosine = {cosine!r}
sine = {sine!r}
[run]
duration = 300
[[axis]]
name = "x0"
from = -0.44
to = -0.41
count = 10
[[axis]]
name = "v0"
from = -1.6
to = -1.3
count = 10
"""


def test_a_graze_where_friction_turns_round_with_the_impact(follow, tmp_path: Path):
    """The machine of sweep_coulomb.toml, its crank a force: the graze is that of the one body."""
    case, stiffness, natural = tmp_path / "crank.toml", 88.82643960980423, 3 * np.pi
    foot = stiffness * np.array([0.09495, 0.01 + 0.02849j, -0.02003 - 0.02686j])
    # a cos + b sin of the crank angle is the real part of (a + ib) exp(-i angle)
    foot *= np.exp(-1j * np.radians(191.1) * np.arange(1, 4))
    case.write_text(CRANK.format(stiffness=stiffness, cosine=foot.real.tolist(), sine=foot.imag.tolist()))
    points, _ = follow(case, "drive.force.frequency", 0.8627 * natural, 0.8634 * natural, "--searches", "2")
    grazes = [point["parameter"] / natural for point in points if point["label"].startswith("GR")]
    assert grazes == pytest.approx([0.8628268060133], abs=1e-11)
    assert {point["word"] for point in points} >= {"R....", "R.R..."}
    assert next(point["label"] for point in points if point["label"].startswith("GR")) == "GR-fold"


HARDENING = {
    "structure": """
body.block.mass = 1
spring.frame = { law = "polynomial", between = ["block"], stiffness = 1, cubic = 1, damping = 0.02 }
drive.force = { body = "block", law = "force", amplitude = 0.5, frequency = 3 }
""",
    "one body": """
body.mass = 1
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 0.02 }
effect.cubic_spring.stiffness = 1
drive = { law = "harmonic", amplitude = 0.5, ratio = 3 }
""",
}


@pytest.mark.parametrize(("kind", "largest"), [
    ("structure", 3.00972484), pytest.param("one body", 4.098403, marks=pytest.mark.long),
])  # fmt: skip
def test_the_start_of_the_case_is_at_its_crank_angle(separatrix: Path, tmp_path: Path, kind, largest):
    """Near the resonant orbit of a hardening spring, beyond what is searched, a quarter of a period later."""
    (tmp_path / "case.toml").write_text(HARDENING[kind])
    words = ["--parameter", "drive.force.frequency" if kind == "structure" else "drive.ratio"]
    words += ["--from", 3, "--to", 3.0001, "--searches", 1, "-o", "out.h5"]
    for item in ("x0=1.1487", "v0=-8.4499", f"crank_angle={math.pi / 2}"):
        words += ["--set", f"start.{item}"]
    succeed(separatrix, "branches", "case.toml", *words, folder=tmp_path)
    with open_result(tmp_path / "out.h5") as result:
        assert result["x"].values.max() == pytest.approx(largest, abs=1e-3)
