# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Captions: the machine in numbers, in the symbols of the documents, with units."""

from pathlib import Path

import numpy as np
import separatrix as sx
from program import CASE


def test_captions_hold_every_number_of_the_machine(tmp_path: Path, library: Path) -> None:
    result = sx.basin(sx.Case.from_text(CASE), x0=5, v0=5, progress=False)
    caption = result.separatrix.plot().separatrix_caption
    case = result.separatrix.case.resolved
    for family in ("body", "restoring", "friction", "contact", "drive"):
        for value in case[family].values():
            for number in value if isinstance(value, list) else [value]:
                if isinstance(number, float) and number != 0:
                    assert f"{number:.6g}" in caption, (family, number)
    assert "N/m" in caption
    assert "duration 50 s" in caption
    short = result.separatrix.plot(caption="short").separatrix_caption
    assert "N/m" not in short
    assert result.separatrix.plot(caption="none").separatrix_caption == ""


def test_captions_use_the_symbols_of_the_documents_and_name_every_unit(library: Path) -> None:
    """m, c, k, e and omega as in docs/start.md; gravity only where it acts."""
    soft = {"law": "kelvin_voigt", "stiffness": 87125, "damping": 0, "upper": 1.26e-3}
    for friction, contact, holds, absent in (
        ({"law": "viscous", "damping": 0.4}, soft, "$c$ = 0.4 N s/m|$k_c$ = 87125 N/m|$k$ = 200 N/m", "$g$"),
        (
            {"law": "coulomb", "kinetic_coefficient": 0.2},
            {"law": "newton", "restitution": 0.8, "upper": 1.26e-3},
            r"$g$ = 9.81 m/s$^{2}$|restitution $e$ = 0.8|$\mu$ = 0.2|$\omega/\omega_0$ = 2.6",
            "$c$",
        ),
    ):
        case = sx.Case.from_dict(
            {
                "body": {"mass": 0.5},
                "restoring": {"law": "linear", "stiffness": 200},
                "friction": friction,
                "contact": contact,
                "drive": {"law": "harmonic", "amplitude": 0.001, "ratio": 2.6},
                "run": {"duration": 1.0},
            }
        )
        caption = sx.trajectory(case).separatrix.plot("phase", caption="full").separatrix_caption
        assert [piece for piece in holds.split("|") if piece not in caption] == []
        assert absent not in caption


def test_a_caption_describes_a_measured_force_by_its_samples(library: Path) -> None:
    """How many, of what size, how often, with units; those of a pendulum are a torque."""
    force = (2.0 * np.cos(2 * np.pi * np.arange(40) / 40)).tolist()
    for law, unit in (({"law": "linear", "stiffness": 1}, "N"), ({"law": "pendulum", "moment": 1}, "N m")):
        case = sx.Case.from_dict(
            {
                "body": {"mass": 1},
                "restoring": law,
                "friction": {"law": "viscous", "damping": 0.5},
                "drive": {"law": "measured_force", "interval": 0.1, "force": force, "periodic": 1},
                "run": {"duration": 60.0},
            }
        )
        result = sx.basin(case, x0=(-1.0, 1.0, 3), v0=(-1.0, 1.0, 3), progress=False)
        caption = result.separatrix.plot(caption="full").separatrix_caption
        assert "measured force drive, interval = 0.1 s" in caption
        assert f"force: 40 values from -2 to 2 {unit}, repeated;" in caption
