# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frictional pair as base machine: in the coordinate of its platform the carried body is a point mass."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from separatrix.discovery import Options, discover
from separatrix.errors import SeparatrixError

MASS, FRICTION, AMPLITUDE = 0.5, 0.6, 0.15
NOISE = 3e-5


def record(separatrix: Path, source_dir: Path, folder: Path, frequency: float, speed: float) -> Path:
    """Both bodies are measured; of the platform only its known motion is used for the force."""
    made = folder / f"pair_{frequency:g}.csv"
    settings = {
        "body.friction": FRICTION,
        "contact.restitution": 0.8,
        "drive": f'{{law="sine", amplitude={AMPLITUDE}, frequency={frequency}}}',
        "start.v0": speed,
        "run": "{duration=6}",
        "record": f'{{rate="500 Hz", noise="30 um", seed={int(frequency)}}}',
    }
    command = [separatrix, "trajectory", source_dir / "examples" / "pair_backlash.toml"]
    for key, value in settings.items():
        command += ["--set", f"{key}={value}"]
    command += ["-o", folder / f"{frequency:g}.h5", "--record", made]
    subprocess.run(command, check=True, capture_output=True)
    table = np.genfromtxt(made, delimiter=",", comments="#", names=["t", "x", "driver_x"], skip_header=9)
    acceleration = -AMPLITUDE * frequency**2 * np.sin(frequency * table["t"])
    rows = np.column_stack([table["t"], table["x"] - table["driver_x"], -MASS * acceleration])
    path = folder / f"relative_{frequency:g}.csv"
    head = f"# units: s, m\n# sensor_noise_sigma_m: {np.sqrt(2) * NOISE:.6g}\nt,x,force"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    return path


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(("case", "why"), [
    ("pair_platform.toml", "drive.law: found velocity, allowed for a pair as base machine none, force, sine"),
    ("structure_beam.toml", "structure: found a structure of matrices or modes"),
])  # fmt: skip
def test_what_has_no_joints_is_refused_before_any_record_is_read(
    case: str, why: str, source_dir: Path, tmp_path: Path
) -> None:
    with pytest.raises(SeparatrixError, match=f"{case}: {why}"):
        discover(source_dir / "examples" / case, [tmp_path / "unread.csv"])


@pytest.mark.usefixtures("library")
@pytest.mark.long
def test_the_friction_of_the_interface_is_found(separatrix: Path, source_dir: Path, tmp_path: Path) -> None:
    first, second, held_out = (
        record(separatrix, source_dir, tmp_path, frequency, speed)
        for frequency, speed in ((7.0, 1.0), (6.0, 0.6), (8.0, -0.5))
    )
    base = source_dir / "examples" / "measured_platform.toml"
    options = Options(seed=1, candidates=("coulomb", "viscous", "offset_force"))
    verdict = discover(base, [first, second], [held_out], options)
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["coulomb"])
    assert verdict["gap"]["held_out"]["after"] < 1.1
    found = verdict["parameters"]
    wanted = {
        "effect.coulomb.force": FRICTION,
        "body.mass": MASS,
        "contact.restitution": 0.8,
        "contact.upper": 0.1,
        "contact.lower": -0.1,
    }
    for path, value in wanted.items():
        assert found[path]["value"] == pytest.approx(value, rel=2e-3), path
        assert abs(found[path]["value"] - value) < 4 * found[path]["standard_error"], path
