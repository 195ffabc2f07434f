# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Captions: the machine in numbers, in the symbols of the documents, with units."""

import re
from pathlib import Path

import numpy as np
import pytest
import separatrix as sx
import xarray as xr
from program import CASE
from separatrix import cli
from separatrix.figures.caption import raised
from separatrix.figures.look import Look
from separatrix.figures.regions import limit_texts


def test_captions_hold_every_number_of_the_machine(tmp_path: Path, library: Path) -> None:
    result = sx.basin(sx.Case.from_text(CASE), x0=5, v0=5, progress=False)
    caption = result.separatrix.plot(caption="full").separatrix_caption
    case = result.separatrix.case.resolved
    for family in ("body", "restoring", "friction", "contact", "drive"):
        for value in case[family].values():
            for number in value if isinstance(value, list) else [value]:
                if isinstance(number, float) and number != 0:
                    assert f"{number:.6g}" in caption, (family, number)
    assert "N/m" in caption
    assert "duration 50 s" in caption
    short = result.separatrix.plot().separatrix_caption
    assert "N/m" not in short
    assert short == result.separatrix.plot(caption="short").separatrix_caption
    assert cli._parser().parse_args(["basin.h5"]).caption == Look().caption == "short"
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


@pytest.mark.parametrize(("law", "name"), [("dahl", "Dahl"), ("bouc_wen", "Bouc-Wen"), ("lugre", "LuGre")])
def test_friction_with_memory_has_the_name_of_its_authors(law: str, name: str, library: Path) -> None:
    friction = {"law": law, "stiffness": 100, "force": 1}
    case = sx.Case.from_dict(
        {
            "body": {"mass": 0.5},
            "restoring": {"law": "linear", "stiffness": 200},
            "friction": friction
            | ({"static_force": 1.5, "stribeck_velocity": 0.1} if law == "lugre" else {}),
            "start": {"v0": 1},
            "run": {"duration": 1.0},
        }
    )
    assert f"{name} friction" in sx.trajectory(case).separatrix.plot("phase").separatrix_caption


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
        # of an angle: moment of inertia and damping of a rotation
        rotation = "$J$ = 1 kg m$^{2}$", "$c$ = 0.5 N m s"
        line = "$m$ = 1 kg;", "$c$ = 0.5 N s/m"
        assert all(text in caption for text in (rotation if unit == "N m" else line))


def test_limits_and_powers_have_units() -> None:
    ends = {"lower": ("limit", [0.5], {"units": "N"}), "upper": ("limit", [0.6], {"units": "N"})}
    limits = xr.Dataset({"name": ("limit", ["sticking_to_stuck_up"]), **ends})
    assert limit_texts(limits) == ["sticking to stuck at 0.5 to 0.6 N (run-up)"]
    narrow = limits.assign(lower=limits.lower + 0.4999997, upper=limits.upper + 0.4)
    assert limit_texts(narrow) == ["sticking to stuck at 0.9999997 to 1 N (run-up)"]
    assert [raised(unit) for unit in ("N/m^1.5", "N/m^n", "s^-2")] == ["N/m$^{1.5}$", "N/m$^{n}$", "s$^{-2}$"]


def test_boundaries_are_known_to_lengths_and_speeds(library: Path) -> None:
    """The error along each axis, in its unit."""
    result = sx.boundary(sx.basin(sx.Case.from_text(CASE), x0=12, v0=12, progress=False))
    captions = [result.separatrix.plot(units=units).separatrix_caption for units in ([], ["mm", "cm/s"])]
    found = [re.search(r"known to (\S+) (\S+) along \$x_0\$, (\S+) (\S+) along", text) for text in captions]
    assert [one.group(2, 4) for one in found] == [("m", "m/s"), ("mm", "cm/s")]
    for column, factor in ((1, 1e3), (3, 1e2)):
        first, second = (float(one.group(column)) for one in found)
        assert second == pytest.approx(factor * first, rel=0.2)
