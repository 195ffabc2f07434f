# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Springs, forces of position, contacts and drives as members of families; several effects at once."""

import json
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from separatrix.discovery import Options, discover
from separatrix.discovery.decision.verdict import Findings
from separatrix.discovery.fitting.base import fit_base
from separatrix.discovery.fitting.data import gather, scales_of
from separatrix.discovery.fitting.motions import extensions
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.results import replacing, write_results
from separatrix.discovery.workflow import investigate
from separatrix.library import Model

CASE = """[body]
mass = 1.0

[restoring]
law = "linear"
stiffness = 88.8
free_length = 0.4

[friction]
law = "viscous"
damping = 0.6

[contact]
law = "newton"
restitution = 0.62
upper = {upper}

[drive]
law = "harmonic"
ratio = 0.85
amplitude = {amplitude}
"""
SIGMA = 2e-4

pytestmark = pytest.mark.usefixtures("library")


def base(upper: float = 3.0, amplitude: float = 0.1) -> Model:
    """A driven oscillator; with the barrier at 3 m one that never reaches it."""
    return Model.from_text(CASE.format(upper=upper, amplitude=amplitude))


def record_at(true: Model, ratio: float, scale: float, seed: int, seconds: float) -> object:
    """A record at a drive ratio with so many times the drive."""
    t = np.arange(int(seconds * 100)) / 100
    start = np.array([(0.5, 0.6, 0.4)])
    drive = np.array([ratio, scale * true.parameters["drive.amplitude"].value])
    paths = ["drive.ratio", "drive.amplitude"]
    motion = true.segments(paths, drive, start, [0, t.size], t, derivatives=False)
    x = motion.x + SIGMA * np.random.default_rng(seed).standard_normal(t.size)
    header = {"units": "s, m", "drive_ratio": ratio, "phase": 0.4, "drive_scale": scale}
    return make_record(f"r{seed}", {"t": t, "x": x}, header | {"sensor_noise_sigma_m": SIGMA})


def records_of(true: Model, seconds: float = 6.0) -> list:
    """Three records at ratios of their own, the last to be held out."""
    return [record_at(true, ratio, 1.0, seed, seconds) for seed, ratio in enumerate((0.75, 0.95, 0.85))]


def table(knots: str, at: np.ndarray, key: str, values: np.ndarray) -> dict[str, float]:
    """Values of the parameters of a table."""
    found = {f"{knots}[{i}]": float(one) for i, one in enumerate(at, start=1)}
    return found | {f"{key}[{i}]": float(one) for i, one in enumerate(values, start=1)}


def magnet(x: np.ndarray) -> np.ndarray:
    """A force that no effect of the catalogue has: a magnet beside the path."""
    return -20.0 * (x - 0.45) / (1 + ((x - 0.45) / 0.08) ** 2)


def with_magnet(model: Model) -> Model:
    """The model with the magnet as a table of its own knots."""
    positions = np.linspace(-0.1, 1.0, 16)
    return model.with_effect("force_curve", table("position", positions, "force", magnet(positions)))


def ask(true: Model, without: Model, names: tuple[str, ...], **options) -> tuple[dict, Findings]:
    """The verdict of a search for some effects alone."""
    records = records_of(true)
    return investigate(without, records[:2], records[2:], Options(quick=True, candidates=names, **options))


@pytest.mark.parametrize("gap", [0.0, 0.03])
def test_the_extension_of_the_spring_follows_its_foot(gap: float):
    without = base().with_effect("backlash", {"gap": gap}) if gap else base()
    record = records_of(without)[0]
    data = gather([prepare(record, without)], 1.0, None)
    fitted = fit_base(data, without, scales_of(data, without).mass)
    found = extensions(fitted.problem, fitted.fit)
    t = data.prepared[0].samples.t[fitted.problem.segments.index]
    angle = fitted.problem.crank_angle(0, fitted.fit.values, t)
    scale = dict(zip([one.path for one in fitted.problem.free], fitted.fit.values, strict=True))
    foot = 0.4 + scale["nuisance:drive_scale"] * 0.1 * np.cos(angle)
    inside = fitted.problem.segments.inside
    assert found[inside] == pytest.approx((foot - fitted.fit.evaluation.x)[inside], abs=1e-6)


def test_a_force_without_a_name_is_added_as_a_table_and_the_case_runs(separatrix: Path, tmp_path: Path):
    """It depends on position, has no name, and its basin map is computed with the table."""
    without = base(upper=1.1)
    verdict, findings = ask(with_magnet(without), without, ("drive_ripple",))
    assert (verdict["outcome"], verdict["effects"]) == ("characterised", [])
    assert ["position"] in [one["depends_on"] for one in verdict["character"]]
    assert verdict["added"] == ["force_curve"]
    for gap in verdict["gap"].values():
        assert gap["after"] - 1 < 0.05 * (gap["before"] - 1)
    part = verdict["function"]["parts"][0]
    at, value, band = (np.array(part[key]) for key in ("at", "value", "band_95"))
    # free length and spring absorb parts that are constant or linear in the position: the shape counts
    fitted = np.polyval(np.polyfit(at, value - magnet(at), 1), at)
    assert np.max(np.abs(value - magnet(at) - fitted)) < 0.1 * np.ptp(magnet(at))
    assert np.all(band[1] > band[0])
    with replacing(tmp_path / "found") as draft:
        write_results(draft, verdict, findings)
    assert json.loads((tmp_path / "found" / "verdict.json").read_text())["added"] == ["force_curve"]
    case = (tmp_path / "found" / "extended.toml").read_text()
    assert "[effect.force_curve]" in case
    axes = "axis=[{name='x0', from=0.1, to=1, count=4}, {name='v0', from=-1, to=1, count=3}]"
    words = ["--set", axes]
    subprocess.run(
        [separatrix, "basin", tmp_path / "found" / "extended.toml", *words, "-o", tmp_path / "map.h5", "-q"],
        check=True,
    )
    with h5py.File(tmp_path / "map.h5") as file:
        assert np.all(file["reason"][:] == 1)


def test_free_play_in_the_spring_is_named_and_no_cubic_spring():
    without = base(amplitude=0.2)
    true = without.with_effect("backlash", {"gap": 0.03})
    verdict, _ = ask(true, without, ("backlash", "cubic_spring", "quadratic_drag"))
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["backlash"])
    assert verdict["families"] == ["spring over extension"]
    found = verdict["parameters"]["effect.backlash.gap"]
    assert found["interval_95"][0] < 0.03 < found["interval_95"][1] or abs(found["value"] - 0.03) < 3e-5


@pytest.mark.long
def test_a_soft_wall_is_reported_by_its_family():
    without = base(upper=0.55, amplitude=0.2)
    true = without.with_effect("kelvin_voigt_contact", {"stiffness": 3000.0, "damping": 12.0})
    verdict, _ = ask(true, without, ("compliant_contact", "kelvin_voigt_contact", "restitution_slope"))
    assert verdict["outcome"] in ("named", "ambiguous")
    assert verdict["families"] == ["contact over penetration"]
    assert verdict["effects"] == ["kelvin_voigt_contact"]
    assert verdict["parameters"]["effect.kelvin_voigt_contact.stiffness"]["value"] == pytest.approx(
        3000, rel=0.02
    )


def test_another_exponent_of_a_soft_wall_is_named():
    """A wall that is soft in the case too: its force grows faster, and its damper stays."""
    text = CASE.replace('"newton"', '"kelvin_voigt"').replace(
        "restitution = 0.62", "stiffness = 3000\ndamping = 12\ntension = 0"
    )
    without = Model.from_text(text.format(upper=0.55, amplitude=0.2))
    true = without.with_effect("contact_hardening", {"change": 0.4, "penetration": 0.02})
    names = ("contact_hardening", "compliant_contact", "cubic_spring", "quadratic_drag")
    verdict, _ = ask(true, without, names)
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["contact_hardening"])
    assert verdict["families"] == ["contact over penetration"]
    low, high = verdict["parameters"]["effect.contact_hardening.change"]["interval_95"]
    assert low < 0.4 < high
    assert high - low < 0.1
    # a wall that nothing is wrong with has no other exponent
    verdict, _ = ask(without, without, names)
    assert (verdict["outcome"], verdict["effects"]) == ("none", [])


def test_the_force_of_a_soft_wall_is_drawn_as_a_function_and_is_that_of_hertz():
    without = base(upper=0.55, amplitude=0.2)
    true = without.with_effect("compliant_contact", {"stiffness": 20000.0, "damping": 0.3})
    part = _force_of_hertz(true, without, 0.0)
    # what a processor rounds otherwise changes next to nothing of it
    other = _force_of_hertz(true, without, 1e-11)
    half = np.diff(part["band_95"], axis=0)[0] / 2
    assert np.all(np.abs(np.interp(part["at"], other["at"], other["value"]) - part["value"]) < 0.2 * half)


def _force_of_hertz(true: Model, without: Model, rounding: float) -> dict:
    """The part of the function of records that are moved by as much [m], held against the law of Hertz."""
    records = records_of(true)
    for number, record in enumerate(records):
        record.x += rounding * np.random.default_rng(number).standard_normal(record.x.size)
    names = ("compliant_contact", "kelvin_voigt_contact", "restitution_slope")
    verdict, _ = investigate(without, records[:2], records[2:], Options(quick=True, candidates=names))
    assert verdict["effects"] == ["compliant_contact"]
    found = verdict["function"]
    assert found["effect"] == "contact_curve"
    part = found["parts"][0]
    right, (low, high) = 20000 * part["at"] ** 1.5, part["band_95"]
    assert np.mean((low <= right) & (right <= high)) >= 0.8
    assert np.all((high - low)[7:] < 0.1 * right[7:])
    fitting = {name: one["fits"] for name, one in found["closed_forms"].items()}
    assert fitting == {"linear": False, "hertz": True, "power": True}
    return part


def test_a_function_that_cannot_do_what_an_effect_does_is_not_drawn_for_it():
    """A force k p + c p' of penetration and rate is no force f(p) (1 + d p')."""
    without = base(upper=0.55, amplitude=0.2)
    true = without.with_effect("kelvin_voigt_contact", {"stiffness": 3000.0, "damping": 12.0})
    verdict, _ = ask(true, without, ("kelvin_voigt_contact", "restitution_slope"))
    assert (verdict["effects"], verdict["function"]) == (["kelvin_voigt_contact"], None)
    # one harmonic of the drive is its own formula
    without = base()
    verdict, _ = ask(without.with_effect("drive_ripple", {"sine": 0.003}), without, ("drive_ripple",))
    assert (verdict["effects"], verdict["function"]) == (["drive_ripple"], None)


def test_what_ripples_with_a_measured_crank_moves_its_first_harmonic_too():
    """A crank that runs ahead and behind twice a turn: the phase is measured and cannot take that in."""
    without = base()
    harmonics = {"cosine[1]": 0.0, "cosine[2]": 0.0, "cosine[3]": 0.002}
    harmonics |= {"sine[1]": -0.002, "sine[2]": 0.0, "sine[3]": 0.002}
    true = without.with_effect("drive_harmonics", harmonics)
    random = np.random.default_rng(7)
    records = []
    for record in records_of(true):
        ratio = record.header["drive_ratio"]
        angle = 0.4 + without.drive_frequency({"drive.ratio": ratio}) * record.t
        angle += 1e-4 * random.standard_normal(angle.size)
        columns = {"t": record.t, "x": record.x, "phi": angle}
        header = {"units": "s, m, rad", "sensor_noise_sigma_m": SIGMA}
        records.append(make_record(record.name, columns, header))
    options = Options(quick=True, candidates=("drive_ripple",))
    verdict, _ = investigate(without, records[:2], records[2:], options)
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["drive_harmonics"])
    for path, value in harmonics.items():
        if path != "cosine[1]":
            found = verdict["parameters"][f"effect.drive_harmonics.{path}"]
            assert abs(found["value"] - value) < 4 * found["standard_error"] + 1e-5


def test_harmonics_of_the_drive_are_found_as_a_function():
    without = base()
    harmonics = {"cosine[1]": 0.0, "cosine[2]": 0.004, "cosine[3]": -0.002}
    harmonics |= {"sine[1]": 0.0, "sine[2]": 0.0, "sine[3]": 0.003}
    verdict, _ = ask(without.with_effect("drive_harmonics", harmonics), without, ("drive_ripple",))
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["drive_harmonics"])
    part = verdict["function"]["parts"][0]
    phase, value = np.array(part["at"]), np.array(part["value"])
    right = 0.004 * np.cos(2 * phase) - 0.002 * np.cos(3 * phase) + 0.003 * np.sin(3 * phase)
    assert np.max(np.abs(value - right)) < 2e-4


@pytest.mark.long
def test_three_effects_are_found_one_by_one():
    without = base(upper=0.6, amplitude=0.2)
    true = without.with_effect("quadratic_drag", {"coefficient": 0.06})
    true = true.with_effect("cubic_spring", {"stiffness": 12.0})
    true = true.with_effect("restitution_slope", {"slope": 0.05})
    names = ("quadratic_drag", "cubic_spring", "restitution_slope", "drive_ripple")
    records = records_of(true, seconds=8.0)
    verdict = discover(without, records[:2], records[2:], Options(quick=True, candidates=names))
    assert verdict["outcome"] == "named"
    assert set(verdict["effects"]) == {"quadratic_drag", "cubic_spring", "restitution_slope"}
    assert verdict["gates"]["drop"]
    for path, value in (("quadratic_drag.coefficient", 0.06), ("cubic_spring.stiffness", 12.0)):
        found = verdict["parameters"][f"effect.{path}"]
        assert abs(found["value"] - value) < 4 * found["standard_error"]


def test_the_experiment_that_is_asked_for_settles_an_ambiguous_verdict():
    """Drag too small to be predicted by the records there are; measured as asked, it is named."""
    without = base()
    true = without.with_effect("quadratic_drag", {"coefficient": 0.0007})
    records = records_of(true)
    options = Options(quick=True, candidates=("quadratic_drag", "stribeck", "coulomb", "cubic_spring"))
    verdict = discover(without, records[:2], records[2:], options)
    assert (verdict["outcome"], verdict["effects"]) == ("ambiguous", ["quadratic_drag"])
    sizes = [one["d_prime"] for one in verdict["experiments"]]
    assert sizes == sorted(sizes, reverse=True)
    asked = verdict["experiments"][0]
    assert asked["text"] in verdict["separating_experiment"]
    # no other record bears it out, and that is what is asked for
    assert asked["use"] == "held out"
    assert asked["text"].endswith("; hold it out")
    # so small an effect needs it once to be fitted, too
    further = [record_at(true, asked["drive_ratio"], asked["scale"], seed, 12.0) for seed in (5, 6)]
    verdict = discover(without, [*records[:2], further[0]], [records[2], further[1]], options)
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["quadratic_drag"])
