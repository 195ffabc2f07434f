# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction with memory in force records: what each law leaves, and none where nothing has memory."""

import numpy as np
import pytest
import test_discovery_forces as forces
from separatrix.discovery import Options, discover

pytestmark = pytest.mark.usefixtures("library")


def bouc_wen(x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Bouc and Wen's hysteresis of exponent 2, in place of dry friction."""
    found, z = np.zeros(x.size), 0.0
    for k, step in enumerate(np.diff(x), start=1):
        z += step / 0.006 * (1 - z**2 * (0.5 + 0.5 * np.sign(z * step)))
        found[k] = forces.DRY * z
    return found - forces.DRY * np.sign(v)


def dead_band(x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A spring that slips, behind a dead band of 4 mm to each side, in place of dry friction."""
    found, extension, gap, length = np.zeros(x.size), 0.0, 0.004, 0.006
    for k, step in enumerate(np.diff(x), start=1):
        extension = np.clip(extension + step, -gap - length, gap + length)
        found[k] = forces.DRY * np.sign(extension) * max(abs(extension) - gap, 0.0) / length
    return found - forces.DRY * np.sign(v)


def slips(x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Three springs that slip, in place of dry friction."""
    elements = ((0.4, 0.002), (0.35, 0.008), (0.25, 0.03))
    found = sum(share * forces.memory(x, forces.DRY / length, True) for share, length in elements)
    return found - forces.DRY * np.sign(v)


LAWS = {"bouc_wen": bouc_wen, "dead_band": dead_band, "maxwell_slip": slips}
NAMES = {
    "bouc_wen": {"dahl", "maxwell_slip", "lugre"},
    "dead_band": {"dead_band"},
    "maxwell_slip": {"maxwell_slip"},
    "elastic": {"maxwell_slip"},
    "dahl": {"dahl"},
}


def memory_of(law: str, noise: float, candidates: tuple[str, ...] = ("quadratic_drag",)) -> dict:
    """The verdict on a law that the candidates lack."""
    return forces.ask(law, noise, candidates=candidates)


@pytest.mark.parametrize("noise", [0.005, pytest.param(0.02, marks=pytest.mark.long)])
@pytest.mark.parametrize("law", NAMES)
def test_what_has_memory_is_named_or_in_a_set(law: str, noise: float, monkeypatch) -> None:
    if law in LAWS:
        monkeypatch.setitem(forces.LAWS, law, LAWS[law])
    verdict = memory_of(law, noise)
    assert verdict["effects"] == []
    found = verdict["memory"]
    assert NAMES[law] & set(found["names"])
    left = {one["name"]: one for one in found["laws"]}
    best = left[found["names"][0]]
    for use in ("training", "held_out"):
        assert best[use]["share"] < 0.3 * left["base"][use]["share"]
    assert ("not known" in found["text"]) == (len(found["names"]) > 1)
    assert "held out" in found["text"]


@pytest.mark.parametrize("law", ["stribeck", "cogging", "bump", "position_dependent_friction", "viscous"])
def test_a_force_without_memory_is_no_memory(law: str) -> None:
    found = memory_of(law, 0.005)["memory"]
    assert found is None or found["names"] == []


def test_dry_and_viscous_friction_are_no_memory() -> None:
    records = forces.records_of("nothing", 0.005)
    options = Options(quick=True, compare="force", candidates=("quadratic_drag",))
    assert discover(forces.base(), records[:2], records[2:], options)["memory"] is None
