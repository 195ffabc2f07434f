# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sections of one motion, and Lyapunov exponents along a parameter beside the bifurcation diagram."""

from pathlib import Path

import numpy as np
import pytest
import separatrix as sx

CRANK = {"x0": 0.4, "v0": 0.0}


@pytest.fixture(autouse=True)
def tools(library: Path, separatrix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program and the library of the build that is tested."""
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))


@pytest.fixture
def examples(source_dir: Path) -> Path:
    return source_dir / "examples"


@pytest.fixture
def linear() -> sx.Case:
    """x'' + 0.2 x' + x = cos 2t, whose steady motion is known."""
    return sx.Case.from_dict(
        {
            "body": {"mass": 1}, "restoring": {"law": "linear", "stiffness": 1},
            "friction": {"law": "viscous", "damping": 0.2},
            "drive": {"law": "harmonic", "amplitude": 1, "ratio": 2.0}, "run": {"duration": 100},
        }
    )  # fmt: skip


@pytest.mark.parametrize(("start", "at", "angle"), [(0, 0.0, 0), (0, "45 deg", np.pi / 4), (1, np.pi, np.pi)])
def test_a_stroboscopic_section_is_the_steady_motion_at_its_phase(
    linear: sx.Case, start: float, at: float | str, angle: float
) -> None:
    points = sx.section(linear, 0.0, 0.0, start, at=at, periods=7, transient=100)
    response = 1 / (1 - 4 + 0.4j)
    assert points.sizes["time"] == 7
    assert points["x"].values == pytest.approx(np.real(response * np.exp(1j * angle)), abs=1e-12)
    assert points["v"].values == pytest.approx(np.real(2j * response * np.exp(1j * angle)), abs=1e-12)
    turns = (start + 2 * points["time"].values - angle) / (2 * np.pi)
    assert turns == pytest.approx(np.rint(turns), abs=1e-9)
    assert np.diff(points["time"].values) == pytest.approx(np.pi)
    assert points["time"][0] >= 100 * np.pi - 1e-6


def test_a_section_at_impacts_has_the_law_of_impact(examples: Path) -> None:
    case = sx.load(examples / "basin_coulomb.toml")
    points = sx.section(case, **CRANK, event="impact_upper", periods=30, transient=20)
    assert points.sizes["time"] == 30
    assert points["x"].values == pytest.approx(1.1)
    restitution = case.resolved["contact"]["restitution"]
    assert points["v_after"].values == pytest.approx(-restitution * points["v_before"].values)
    assert np.ptp(points["phase"].values) < 1e-6
    assert points.separatrix.plot().axes[0].get_xlim() == pytest.approx((0, 2 * np.pi))


def test_sections_of_bodies_have_their_motions(examples: Path) -> None:
    damper = examples / "structure_impact_damper.toml"
    points = sx.section(damper, periods=4, transient=2)
    motion = sx.trajectory(damper, duration="50 s", samples=100)
    for name in ("x", "particle_v"):
        seen = np.interp(points["time"], motion["time"], motion[name])
        assert points[name].values == pytest.approx(seen, abs=1e-9)
    impacts = sx.section(damper, event=["impact_upper", "impact_lower"], periods=4, transient=2)
    assert set(np.unique(impacts["kind"])) == {1, 2} and "joint_v_before" in impacts
    assert len(impacts.separatrix.plot().axes[0].lines) == 2
    belt = sx.section(examples / "structure_blocks_on_a_belt.toml", event="stick", periods=4, transient=2)
    assert "phase" not in belt and belt.separatrix.plot() is not None


def test_sections_that_make_no_sense_are_refused(examples: Path) -> None:
    case = sx.load(examples / "basin_coulomb.toml")
    for asked, message in (
        ({"at": 1.0}, "^at: found 1 rad, allowed parts n/N"),
        ({"event": "kick"}, "^event: found 'kick', allowed impact_upper"),
        ({"periods": 0}, "^periods: found 0"),
        ({"transient": 0.5}, "^transient: found 0.5"),
    ):
        with pytest.raises(sx.SeparatrixError, match=message):
            sx.section(case, **CRANK, **asked)
    with pytest.raises(sx.SeparatrixError, match="no drive; event"):
        sx.section(examples / "structure_blocks_on_a_belt.toml", periods=2)
    with pytest.raises(sx.SeparatrixError, match="a motor last no equal times"):
        sx.section(examples / "motor_impact.toml", periods=2)
    with pytest.raises(sx.SeparatrixError, match="no such event"):
        sx.section(case, **CRANK, periods=2, event="stick").separatrix.plot()


def test_exponents_of_a_linear_machine_are_half_its_damping(linear: sx.Case) -> None:
    reported: list[tuple] = []
    found = sx.exponents_along(
        linear, "friction.damping", (0.1, 0.3, 3), x0=0.0, v0=0.0, periods=400, points=5,
        progress=lambda *what: reported.append(what),
    )  # fmt: skip
    assert found["friction_damping"].values == pytest.approx([0.1, 0.2, 0.3])
    half = np.broadcast_to(-found["friction_damping"].values[:, None] / 2, (3, 2))
    away = np.abs(found["exponent"].values - half)
    assert (away <= 4 * found["exponent_error"].values + 1e-9).all()
    assert set(sx.decode_flags(found["motion"]).values) == {"periodic"}
    assert reported[-1] == ("values", 3, 3)
    assert np.ptp(found["section_x"].values, axis=1) == pytest.approx(0, abs=1e-6)


def test_exponents_of_a_sweep_are_those_of_its_motions(examples: Path) -> None:
    sweep = sx.sweep(
        examples / "sweep_coulomb.toml", "drive.ratio", (1.05, 1.15, 3), directions="up", starts=(0, 0)
    )
    found = sx.exponents_along(sweep, periods=64, threads=1)
    assert found["section_x"].values.tolist() == sweep["section_x"].values[0].tolist()
    alone = sx.stability(
        sweep.separatrix.case.with_(drive__ratio=1.1),
        *(float(sweep[name][0, 1, -1]) for name in ("section_x", "section_v")), 0.0, periods=64,
    )  # fmt: skip
    assert found["exponent"].values[1] == pytest.approx(alone.exponents)
    section, exponents = found.separatrix.plot().axes
    assert section.get_shared_x_axes().joined(section, exponents)
    with pytest.raises(sx.SeparatrixError, match="direction: found 'down'"):
        sx.exponents_along(sweep, direction="down")
    with pytest.raises(sx.SeparatrixError, match="those of the sweep"):
        sx.exponents_along(sweep, "drive.ratio", [1.0])
    with pytest.raises(sx.SeparatrixError, match="its values are needed"):
        sx.exponents_along(sweep.separatrix.case, "drive.ratio")
    with pytest.raises(sx.CaseError, match="drive.ration"):
        sx.exponents_along(sweep.separatrix.case, "drive.ration", [1.0])
