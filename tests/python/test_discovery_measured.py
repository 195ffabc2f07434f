# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured records: the pendulum whose published model is viscous lacks dry friction and drag."""

import os
import runpy
from pathlib import Path

import pytest
from separatrix.discovery import discover
from separatrix.discovery.options import Options

ROOT = Path(__file__).resolve().parents[2]
FOLDER = os.environ.get("SEPARATRIX_MEASURED")

pytestmark = pytest.mark.skipif(
    not FOLDER, reason="asked for by SEPARATRIX_MEASURED=FOLDER with emps/ and single_pendulum/"
)


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """The records that scripts/measured_records makes."""
    out = tmp_path_factory.mktemp("records")
    main = runpy.run_path(str(ROOT / "scripts" / "measured_records"))["main"]
    assert main([FOLDER, "--out", str(out)]) == 0
    return out


def verdict(records: Path, name: str, **choices) -> dict:
    """The verdict on one pendulum record, its small swings held out."""
    options = Options(partial=True, quick=True, **choices)
    paths = [records / f"{name}.csv"], [records / f"{name}_low.csv"]
    return discover(ROOT / "examples" / "measured_pendulum.toml", *paths, options)


def test_large_swings_lack_dry_friction_and_drag_and_small_ones_have_the_same_dry_friction(records):
    large = verdict(records, "pendulum_large")
    assert (large["outcome"], large["complete"]) == ("named", False)
    assert set(large["effects"]) == {"coulomb", "quadratic_drag"}
    held_out = large["gap"]["held_out"]
    assert held_out["after"] < 0.5 * held_out["before"]
    small = verdict(records, "pendulum_small", segment_seconds=0.4)
    assert "coulomb" in small["effects"]
    path = "effect.coulomb.force"
    assert small["parameters"][path]["value"] == pytest.approx(large["parameters"][path]["value"], rel=0.15)
