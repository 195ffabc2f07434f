# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two bodies in `branches`, `boundary`, `stability`: their structure against their own flights."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from program import run, succeed
from separatrix.open import decode_flags, open_result, table

# the driving body is on a spring and carries the stops; its motion is given, they are soft; they stand still
CARRIED = """
drive = { law = "force", amplitude = 4, frequency = 2.5 }
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 0.1 }
contact = { law = "newton", restitution = 0.7, upper = 0.4, lower = -0.3 }
body = { law = "backlash_pair", mass = 1, driven_mass = 0.5, friction = 0.3 }
"""
SOFT = """
drive = { law = "sine", amplitude = 1, frequency = 0.8 }
contact = { law = "kelvin_voigt", stiffness = 30, damping = 0.4, upper = 0.4, lower = -0.3 }
body = { law = "backlash_pair", mass = 1, driven_mass = 0.5, friction = 0.1 }
"""
GROUND = """
drive = { law = "force", amplitude = 2, frequency = 1.6 }
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 0.1 }
contact = { law = "newton", restitution = 0.3, upper = 0.2, lower = -0.25 }
body = { law = "friction_pair", mass = 1, driven_mass = 0.5, friction = 1.2 }
"""
STARTS = """
run = { duration = 300, window = 100 }
axis = [{ name = "x0", from = -0.24, to = 0.19, count = 8 }, { name = "v0", from = -2, to = 2, count = 8 }]
"""


def in_order(multipliers: np.ndarray) -> np.ndarray:
    """By what rounding leaves: the real parts of a conjugate pair are alike."""
    return multipliers[np.lexsort((multipliers.imag, np.round(multipliers.real, 3)))]


@pytest.mark.parametrize(("laws", "frequency"), [(CARRIED, 2.5), (SOFT, 0.8)])
def test_stable_orbits_are_the_attractors_of_a_map(separatrix: Path, tmp_path: Path, laws, frequency):
    (tmp_path / "pair.toml").write_text(laws + STARTS)
    succeed(separatrix, "basin", "pair.toml", "-o", "map.h5", folder=tmp_path)
    words = (
        "--parameter",
        "drive.frequency",
        "--from",
        frequency,
        "--to",
        1.002 * frequency,
        "--searches",
        2,
    )
    succeed(separatrix, "branches", "pair.toml", *words, "-o", "out.h5", folder=tmp_path)
    with open_result(tmp_path / "map.h5") as result, open_result(tmp_path / "out.h5") as branches:
        catalogue = table(result, "catalogue")
        own = np.stack([catalogue[name].values for name in ("x", "v")])
        here = (abs(branches["parameter"].values - frequency) < 1e-12) & (branches["period"].values == 1)
        here &= branches["stable"].values == 1
        found = np.stack([branches[name].values[here] for name in ("x", "v")])
        of_branches = (branches["multiplier_real"].values + 1j * branches["multiplier_imag"].values)[here]
        of_map = catalogue["multiplier_real"].values + 1j * catalogue["multiplier_imaginary"].values
        assert here.any()
        # one begins its section in the pressed contact: its mirror image was found, it was not
        assert (result["attractor"].values > 0).all()
        for orbit, multipliers in zip(found.T, of_branches, strict=True):
            distance = abs(own - orbit[:, np.newaxis]).max(axis=0)
            assert distance.min() < 1e-8
            # those of the map are differences of flights
            expected = in_order(of_map[distance.argmin()])
            assert in_order(multipliers) == pytest.approx(expected, abs=3e-5)


def test_multipliers_of_a_motion_that_chatters_and_sticks(separatrix: Path, tmp_path: Path):
    """Differences of two flights follow, period by period, the two that are not zero."""
    (tmp_path / "pair.toml").write_text(GROUND + STARTS)
    succeed(separatrix, "basin", "pair.toml", "-o", "map.h5", folder=tmp_path)
    words = ("--parameter", "drive.frequency", "--from", 1.6, "--to", 1.6032, "--searches", 2)
    succeed(separatrix, "branches", "pair.toml", *words, "-o", "out.h5", folder=tmp_path)
    with open_result(tmp_path / "map.h5") as result, open_result(tmp_path / "out.h5") as branches:
        names = ("x", "v", "driver_x", "driver_v")
        x, v, driver_x, driver_v = (table(result, "catalogue")[name].values[0] for name in names)
        here = int(np.flatnonzero(abs(branches["parameter"].values - 1.6) < 1e-12)[0])
        assert [branches[name].values[here] for name in ("x", "v")] == pytest.approx([x, v], abs=1e-8)
        pair = (branches["multiplier_real"].values + 1j * branches["multiplier_imag"].values)[here]
        assert abs(pair[2:]).max() < 1e-12
    positions = []
    for k, there in enumerate((driver_x, driver_x + 1e-4)):
        values = {"start.x0": x, "start.v0": v, "body.driver_x0": there, "body.driver_v0": driver_v}
        values |= {"run.duration": 20, "run.window": 5, "trajectory.samples_per_period": 64}
        settings = [word for key, value in values.items() for word in ("--set", f"{key}={value!r}")]
        settings = [word.replace("np.float64(", "").replace(")", "") for word in settings]
        succeed(separatrix, "trajectory", "pair.toml", *settings, "-o", f"{k}.h5", folder=tmp_path)
        with open_result(tmp_path / f"{k}.h5") as result:
            positions.append(result["driver_x"].values[64:256:64])
    apart = positions[1] - positions[0]
    predicted = (pair[0] + pair[1]).real * apart[1] - (pair[0] * pair[1]).real * apart[0]
    assert apart[2] == pytest.approx(predicted, rel=1e-2)


def test_stick_and_slip_on_a_shaken_platform_begin_where_the_closed_form_has_them(
    separatrix: Path, source_dir: Path, tmp_path: Path
):
    """Friction by mass and acceleration: 2/sqrt(4 + pi^2) where sticking begins, 1 where slipping ends."""
    case = source_dir / "examples" / "sweep_pair_kappa.toml"
    words = ("--parameter", "body.friction", "--from", 0.3, "--to", 1.3, "--searches", 4, "--json")
    output = succeed(separatrix, "branches", case, *words, "-o", "out.h5", folder=tmp_path).out
    points = [line for line in map(json.loads, output.splitlines()) if line["event"] == "point"]
    onsets = sorted(point["parameter"] for point in points if point["label"] == "stick_onset")
    assert onsets == pytest.approx([2 / math.sqrt(4 + math.pi**2), 1], abs=1e-9)


@pytest.mark.long
def test_boundary_of_backlash(separatrix: Path, source_dir: Path, tmp_path: Path):
    """Most of it is the stable sets of saddles, that of the symmetric orbit of one period among them."""
    case = source_dir / "examples" / "basin_pair_backlash.toml"
    sizes = ("--set", "axis.x0.count=9", "--set", "axis.v0.count=9")
    succeed(separatrix, "basin", case, *sizes, "-o", "map.h5", folder=tmp_path)
    succeed(separatrix, "boundary", "map.h5", "-o", "curves.h5", folder=tmp_path)
    with open_result(tmp_path / "curves.h5") as result:
        saddles = table(result, "saddles")
        one = saddles["multipliers"].values[saddles["period"].values == 1]
        assert one[0] == pytest.approx([31.8978034, 0.0163649591], rel=1e-7)
        assert np.mean(decode_flags(result["piece_name"]).values == "stable_set") > 0.5


def test_exponents_are_the_logarithms_of_the_multipliers(separatrix: Path, tmp_path: Path):
    (tmp_path / "pair.toml").write_text(CARRIED)
    settings = ("--set", "body.driver_x0=-0.4", "--set", "body.driver_v0=0.5", "--set", "start.x0=-0.45")
    output = succeed(
        separatrix, "stability", "pair.toml", *settings, "--periods", 400, "--json", folder=tmp_path
    ).out
    lines = list(map(json.loads, output.splitlines()))
    found = [line["value"] for line in lines if line["event"] == "exponent" and line["value"] is not None]
    # of the orbit that the maps above find
    multipliers = [0.9043218, 0.9043218, 0.4591962]
    expected = [math.log(one) * 2.5 / (2 * math.pi) for one in multipliers]
    assert found[:3] == pytest.approx(expected, rel=2e-2)


@pytest.mark.parametrize(
    ("case", "message"),
    [
        ("pair_free", "drive.law: found two bodies without a periodic drive, allowed force, sine"),
        ("pair_platform", "drive.law: found two bodies without a periodic drive, allowed force, sine"),
    ],
)
def test_what_has_no_variations_is_refused(separatrix: Path, source_dir: Path, tmp_path: Path, case, message):
    path = source_dir / "examples" / f"{case}.toml"
    words = ("--parameter", "body.friction", "--from", 0.1, "--to", 0.2)
    ended = run(separatrix, "branches", path, *words, folder=tmp_path)
    assert ended.code == 65 and message in ended.err
    assert not list(tmp_path.glob("*.h5"))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (("body.impulse=1",), "body.impulse: found an impulse"),
        (
            ("drive={law='pid_sine', amplitude=1, frequency=1, proportional=5}",),
            "drive.law: found a controller",
        ),
    ],
)
def test_laws_that_a_structure_lacks_are_named(
    separatrix: Path, source_dir: Path, tmp_path: Path, settings, message
):
    path = source_dir / "examples" / "sweep_pair_kappa.toml"
    words = [word for one in settings for word in ("--set", one)]
    ended = run(separatrix, "stability", path, *words, folder=tmp_path)
    assert ended.code == 65 and message in ended.err
