# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Captions of machines of several bodies and structures."""

from pathlib import Path

import pytest
import separatrix as sx
from separatrix.figures.caption import raised
from separatrix.figures.parts import numbers_of_parts, parts

EXAMPLES = ("structure_two_masses", "structure_impact_damper", "structure_blocks_on_a_belt", "structure_beam")
FAMILIES = ("body", "structure", "spring", "friction", "contact", "drive")


def pieces_of(case: sx.Case, axes: frozenset = frozenset()) -> list[str]:
    units = {path: raised(one.unit) for path, one in case.model.parameters.items()}
    return parts(case.resolved, axes, units)


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_number_and_every_end_of_a_part_is_named(source_dir: Path, library: Path, name: str) -> None:
    """Nothing that differs from zero is left out, and no joint without what it joins."""
    case = sx.load(source_dir / "examples" / f"{name}.toml")
    pieces = pieces_of(case)
    for family in FAMILIES:
        for part, keys in case.resolved.get(family, {}).items():
            if not isinstance(keys, dict):
                continue
            (mine,) = [
                piece
                for piece in pieces
                if piece.split(" (")[0].split(":")[0] == (part if family == "body" else f"{family} {part}")
            ]
            for key, value in keys.items():
                for one in value if isinstance(value, list) else [value]:
                    if isinstance(one, str) and key != "law":
                        assert one in mine, (part, key)
                    if isinstance(one, float) and one != 0 and abs(one) < 1e300 and key != "damping_ratio":
                        assert f"{one:.6g}" in mine, (part, key)
    assert pieces[-1] == f"$x$, $v$: {case.resolved['watch']['body']}"


def test_units_zeros_axes_and_long_lists() -> None:
    case = {
        "body": {"in_sequence": 1.0, "roof": {"mass": 8.0, "load": 0.0}},
        "structure": {"beam": {"law": "modes", "frequency": [1.0, 6.25], "point": {"tip": [2.0, -2.0]}}},
        "contact": {
            "stop": {"law": "kelvin_voigt", "between": ["roof", "beam.tip"], "upper": 0.0, "stiffness": 3e4}
        },
        "spring": {"plate": {"law": "linear", "between": ["ground", "roof"], "stiffness": 5.0}},
    }
    units = {
        "structure.beam.frequency[1]": "rad/s",
        "contact.stop.stiffness": "N/m",
        "contact.stop.upper": "m",
    }
    assert numbers_of_parts(case) == "1 body, 1 structure, 1 joint"
    assert parts(case, {"structure_beam_frequency_2", "spring_plate_stiffness"}, units) == [
        "roof: mass 8",
        "structure beam: modes, frequency (1, -) rad/s, point tip (2, -2)",
        "spring plate (ground to roof)",
        "contact stop (roof to beam.tip): kelvin-voigt, upper 0 m, stiffness 30000 N/m",
        "impacts of several contacts at once: one after the other",
    ]
    long = {"structure": {"frame": {"law": "matrices", "mass": [1.0] * 25}}}
    assert parts(long, set(), {}) == ["structure frame: matrices, mass of 25 numbers, in the result file"]
