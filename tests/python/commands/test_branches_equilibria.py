# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Equilibria of a machine without a clock in the output of `branches`, in its file and its figure."""

import json
import math
from pathlib import Path

import pytest
from program import succeed
from separatrix.errors import SeparatrixError
from separatrix.figures.branches import figures
from separatrix.open import decode_flags, open_result

BODY = """
[body.block]
mass = 1
load = 0.1
[spring.spring]
between = ["block"]
stiffness = 2
damping = 0.4
[contact.wall]
between = ["block"]
law = "newton"
restitution = 0.5
upper = 1
[run]
duration = 300
"""


def test_a_body_comes_to_lie_against_its_stop(separatrix: Path, tmp_path: Path) -> None:
    """F = k x until the stop is reached, where nothing is free to move; no orbit but these."""
    (tmp_path / "case.toml").write_text(BODY)
    words = ("--parameter", "body.block.load", "--from", "0", "--to", "3", "--searches", "1", "-o", "out.h5")
    output = succeed(separatrix, "branches", "case.toml", *words, "--json", folder=tmp_path).out
    lines = [json.loads(line) for line in output.splitlines()]
    points = [line for line in lines if line["event"] == "equilibrium"]
    stops = [point for point in points if point["label"] == "BE"]
    assert [point["parameter"] for point in stops] == pytest.approx([2, 2], abs=1e-11)
    assert sorted(len(point["eigenvalues"]) for point in stops) == [0, 4]
    pressed = {line["pressed"]: line["ends"] for line in lines if line["event"] == "equilibria_branch"}
    assert pressed == {0: ["end_of_range", "BE"], 1: ["BE", "end_of_range"]}
    with open_result(tmp_path / "out.h5") as result:
        assert "branch" not in result
        free = result["equilibrium_pressed"].values == 0
        load, position = result["equilibrium_parameter"].values, result["equilibrium_x"].values
        assert position[free] == pytest.approx(load[free] / 2, abs=1e-12)
        assert position[~free] == pytest.approx(1, abs=1e-12)
        assert result["eigenvalue_real"].values[free] == pytest.approx(-0.2, abs=1e-12)
        assert result["eigenvalue_imag"].values[free, 0] == pytest.approx((2 - 0.04) ** 0.5, abs=1e-12)
        assert (decode_flags(result["equilibrium_stable"]).values == "stable").all()
        drawn = figures(result, "")["branches"].axes[0]
        assert drawn.get_ylabel().startswith("position at rest")
        assert sum(len(lines.get_segments()) for lines in drawn.collections) == 2
        with pytest.raises(SeparatrixError, match="no periodic orbits"):
            _ = result.separatrix.labelled_points


RESTING = """
title = "A block on a floor and a running belt"
body.block.mass = 1
body.tip.mass = 1
spring.frame = { between = ["block"], stiffness = 2, damping = 0.05 }
spring.tip = { between = ["block", "tip"], stiffness = 1, damping = 0.05 }
friction.floor = { between = ["block"], force = 0.5, static_force = 0.8 }
friction.belt = { between = ["tip"], force = 1, velocity = 0.5 }
run.duration = 100
"""


WALL = 'contact.wall = { between = ["block"], law = "newton", restitution = 0.5, upper = 0.95 }'


@pytest.mark.parametrize("stop", ["", WALL], ids=["free", "wall"])
def test_where_friction_holds_the_positions_of_rest_are_an_interval(separatrix, tmp_path, stop):
    """2 x = 1 + h: the belt pulls with 1 N, the floor holds with |h| <= 0.8 N, stops are not asked."""
    (tmp_path / "rest.toml").write_text(RESTING + stop)
    words = (
        "--parameter",
        "friction.belt.velocity",
        "--from",
        0.3,
        "--to",
        1,
        "--searches",
        2,
        "-o",
        "rest.h5",
    )
    output = succeed(separatrix, "branches", "rest.toml", *words, folder=tmp_path).out
    assert (
        "dry friction holds friction.floor: positions of rest are a family, not followed; x from 0.1000000000"
        in output
    )
    assert "to 0.9000000000 as far as no stop is in the way" in output
    with open_result(tmp_path / "rest.h5") as result:
        assert result.attrs["rest_joints"] == "friction.floor; friction.floor"
        assert result["rest_parameter"].values == pytest.approx([0.475, 0.825], abs=1e-12)
        assert result["rest_x_low"].values == pytest.approx(0.1, abs=1e-12)
        assert result["rest_x_high"].values == pytest.approx(0.9, abs=1e-12)
        assert result["rest_x_low"].attrs["units"] == "m"
        assert "as far as no stop is in the way" in result["rest_x_high"].attrs["long_name"]
        unknown = {name: result[name] * math.nan for name in ("rest_x_low", "rest_x_high")}
        texts = figures(result.assign(unknown), "")["branches"].axes[0].texts
        assert [text.get_text() for text in texts] == ["between which positions is not known"]
        drawn = figures(result, "")["branches"].axes[0]
        assert not drawn.texts
        assert drawn.get_ylabel().startswith("position at rest")
        assert [piece.tolist() for piece in drawn.collections[0].get_segments()] == [
            [[value, pytest.approx(0.1)], [value, pytest.approx(0.9)]] for value in (0.475, 0.825)
        ]


COMES_TO_REST = """
body.a.mass = 1
spring.g = { between = ["a"], stiffness = 1.3, damping = 0.3 }
watch.body = "a"
start = { x0 = 1 }
run = { duration = 300 }
"""


def test_a_motion_that_comes_to_rest_is_reported_so(separatrix: Path, tmp_path: Path) -> None:
    """It has no section any more: its exponents are the eigenvalues of an equilibrium."""
    (tmp_path / "case.toml").write_text(COMES_TO_REST)
    output = succeed(separatrix, "stability", "case.toml", folder=tmp_path).out
    assert "not known: the motion comes to rest: after" in output
    assert "the eigenvalues of an equilibrium are those that `separatrix branches` gives" in output
