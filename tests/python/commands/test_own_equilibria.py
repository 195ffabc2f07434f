# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Equilibria of one body by expressions over a parameter: normal forms of their bifurcations, a barrier."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from program import succeed

BARRIER = '[contact]\nlaw = "expression"\nupper = 0.5\nrestitution = 0.5\n'
STATE = '[state.z]\nrate = "x - 2*z"\n'
FRICTION = '[friction]\nlaw = "expression"\nforce = 0.1\n'


class Equilibria:
    """Those of a result, and what was printed."""

    def __init__(
        self, separatrix, folder: Path, force: str, ends: tuple[float, float], more: str = ""
    ) -> None:
        (folder / "case.toml").write_text(
            f'[body]\nmass = 1\n[force.f]\nforce = "{force}"\nmu = 1\n{more}'
            "[start]\nx0 = 0.3\n[run]\nduration = 20\n"
        )
        asked = ("--parameter", "force.f.mu", "--from", ends[0], "--to", ends[1], "--searches", "1")
        self.out = succeed(separatrix, "branches", "case.toml", "-o", "b.h5", *asked, folder=folder).out
        with h5py.File(folder / "b.h5") as file:
            self.names = file["equilibrium_label"].attrs["flag_meanings"].split()
            values = [
                file[f"equilibrium_{name}"][:] for name in ("branch", "parameter", "x", "stable", "label")
            ]
            self.branch, self.parameter, self.x, self.stable, self.label = values
            self.values = file["eigenvalue_real"][:] + 1j * file["eigenvalue_imag"][:]

    def at(self, label: str) -> np.ndarray:
        """Indices of the points with a label."""
        return np.flatnonzero(self.label == self.names.index(label))


def test_fold(separatrix, tmp_path) -> None:
    """x = +-sqrt(mu), of which one is stable."""
    found = Equilibria(separatrix, tmp_path, "mu - x^2 - v", (-0.5, 1))
    assert set(found.branch) == {1}
    assert found.x**2 == pytest.approx(found.parameter, abs=1e-9)
    inside = found.parameter > 1e-6
    assert (found.stable[inside] == (found.x[inside] > 0)).all()
    assert found.parameter[found.at("SN")] == pytest.approx([0], abs=1e-12)


def test_pitchfork(separatrix, tmp_path) -> None:
    found = Equilibria(separatrix, tmp_path, "mu*x - x^3 - v", (-0.5, 1))
    assert found.parameter[found.at("BP")] == pytest.approx([0], abs=1e-9)
    arms = np.abs(found.x) > 1e-3
    assert found.x[arms] ** 2 == pytest.approx(found.parameter[arms], abs=1e-9)
    assert found.stable[arms].all()
    trivial = ~arms & (np.abs(found.parameter) > 1e-5)
    assert (found.stable[trivial] == (found.parameter[trivial] < 0)).all()
    # Of the trivial branch s^2 + s - mu = 0.
    assert found.values[trivial].sum(axis=1) == pytest.approx(-1, abs=1e-12)
    assert found.values[trivial].prod(axis=1) == pytest.approx(-found.parameter[trivial], abs=1e-12)


@pytest.mark.parametrize(
    ("more", "at", "period"),
    [
        ("", 0, 2 * np.pi),
        # s^3 + (2 - mu) s^2 + (1 - 2 mu) s + 1.7 with a pair on the axis.
        (STATE, (5 - np.sqrt(22.6)) / 4, 2 * np.pi / np.sqrt(1 - 2 * (5 - np.sqrt(22.6)) / 4)),
    ],
)
def test_cycles_are_born_at_a_hopf_point(separatrix, tmp_path, more, at, period) -> None:
    force = "(mu - x^2)*v - x" + (" + 0.3*z" if more else "")
    found = Equilibria(separatrix, tmp_path, force, (-0.3, 0.5), more)
    (hopf,) = found.at("HB")
    assert found.parameter[hopf] == pytest.approx(at, abs=1e-9)
    with h5py.File(tmp_path / "b.h5") as file:
        names = file["label"].attrs["flag_meanings"].split()
        (birth,) = np.flatnonzero(file["label"][:] == names.index("HB"))
        assert file["parameter"][birth] == pytest.approx(at, abs=1e-9)
        assert file["cycle_time"][birth] == pytest.approx(period, rel=1e-9)
        multipliers = file["multiplier_real"][birth]
    if more:
        third = np.min(found.values[hopf].real)
        assert np.sort(multipliers) == pytest.approx([np.exp(third * period), 1], rel=1e-6)


def test_an_equilibrium_comes_to_a_barrier(separatrix, tmp_path) -> None:
    found = Equilibria(separatrix, tmp_path, "mu - x - v/2", (0, 1), BARRIER)
    free = found.branch == found.branch[found.parameter.argmin()]
    assert found.x[free] == pytest.approx(found.parameter[free], abs=1e-9)
    assert found.x[~free] == pytest.approx(0.5, abs=1e-12)
    assert found.parameter[found.at("BE")] == pytest.approx([0.5, 0.5], abs=1e-5)
    assert found.stable.all()
    assert "1 stops pressed" in found.out


def test_of_dry_friction_none_is_followed(separatrix, tmp_path) -> None:
    """Positions of rest are a continuum; cycles are found beside them."""
    (tmp_path / "case.toml").write_text(
        f'[body]\nmass = 1\n[force.f]\nforce = "(mu - x^2)*v - x"\nmu = 1\n{FRICTION}[start]\nx0 = 1.5\n'
        "[run]\nduration = 20\n"
    )
    asked = ("--parameter", "force.f.mu", "--from", "1", "--to", "1.1", "--searches", "1")
    out = succeed(separatrix, "branches", "case.toml", "-o", "b.h5", *asked, folder=tmp_path).out
    assert "equilibria" not in out
