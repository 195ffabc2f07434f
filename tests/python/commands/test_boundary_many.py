# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `boundary` where five basins are interwoven: all points known, no pairs mixed."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
import separatrix as sx
import xarray as xr
from matplotlib.figure import Figure
from program import succeed
from separatrix.figures import boundary
from separatrix.figures.look import DEFAULT
from separatrix.open import decode_flags, open_result, table

CASE = """
title = "A weakly damped oscillator and a stiff wall: motions that hit it every third to fifth period"
body.mass = 1
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 0.01 }
contact = { law = "newton", restitution = 0.95, upper = 1 }
drive = { law = "harmonic", amplitude = 1, ratio = 5.2 }
run.duration = 1000
axis = [
  { name = "x0", from = -5, to = 1, count = 10 },
  { name = "v0", from = -6, to = 6, count = 10 },
]
"""
# of the section: the drive period, and how far the motion from a boundary point is followed
PERIOD, FOLLOWED = 2 * np.pi / 5.2, 300


@pytest.fixture(scope="module")
def woven(separatrix: Path, tmp_path_factory) -> Path:
    """The boundaries of that machine."""
    case = tmp_path_factory.mktemp("many") / "many.toml"
    case.write_text(CASE)
    out = case.with_suffix(".boundary.h5")
    for arguments in (("basin", case, "-o", case.with_suffix(".h5")), ("boundary", case.with_suffix(".h5"))):
        subprocess.run(
            [str(separatrix), *map(str, arguments)], check=True, capture_output=True, cwd=case.parent
        )
    return out


@pytest.mark.long
def test_every_point_is_known_to_1e_10_and_has_the_labels_of_its_piece(separatrix, woven):
    with open_result(woven) as result:
        across, error = result["across"].values, result["error"].values
        for axis, width in ((0, 6), (1, 12)):
            assert error[across == axis].size > 50
            assert np.mean(error[across == axis] <= 1e-10 * width) > 0.95
            # a sliver of starts that were not captured in time, not wider than a thousandth of its edge
            assert error[across == axis].max() <= 1e-3 * width / 9
        pairs = set(
            zip(result["label_one"].values.tolist(), result["label_two"].values.tolist(), strict=True)
        )
        assert len(pairs) > 5 and len({one for pair in pairs for one in pair}) > 3
    # labels on both sides run again, to the bit
    ended = subprocess.run(
        [separatrix, "verify", woven, "--sample", "30"], capture_output=True, text=True, check=False
    )
    assert "30 points run again: 0 differ from the file" in ended.stdout, ended.stderr


@pytest.mark.long
def test_a_motion_from_a_named_point_comes_to_its_saddle(woven):
    with open_result(woven) as result:
        names, numbers = decode_flags(result["name"]).values, result["saddle"].values
        saddles = table(result, "saddles")
        periods, at, x, v = (saddles[name].values for name in ("period", "saddle", "x", "v"))
        # those of the attractors of periods 3, 4, and 5 among them
        assert {3, 4, 5} <= set(periods.tolist())
        np.testing.assert_array_less(1, np.abs(saddles["multipliers"].values[:, 0]))
        case = result.separatrix.case.with_(
            {"run.duration": FOLLOWED * PERIOD, "run.window": FOLLOWED * PERIOD}
        )
        assert ((names == "stable_set") == (numbers > 0)).all()
        tried = 0
        for number in range(1, len(periods) + 1):
            orbit = np.stack([x[at == number], v[at == number] / 5.2])
            for k in np.flatnonzero((numbers == number) & (result["across"].values >= 0))[:60:4]:
                motion = sx.trajectory(case, float(result["x0"][k]), float(result["v0"][k]), samples=4)
                turns = motion["time"].values / PERIOD
                on = np.abs(turns - np.round(turns)) < 1e-9
                section = np.stack([motion["x"].values[on], motion["v"].values[on] / 5.2])
                away = np.hypot(*(section[:, :, None] - orbit[:, None, :])).min()
                assert away < 0.02, (number, k, away)
                tried += 1
        assert tried > 25


def test_no_two_saddles_look_alike():
    """Eight pieces, each of another saddle, the last between labels of which one is not known."""
    flags = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "not_known stable_set"}
    pieces = {
        "piece_name": ("piece", np.ones(8, np.int8), flags),
        "piece_saddle": ("piece", np.arange(8, 0, -1)),
        "label_one": ("piece", np.r_[0, np.ones(7, int)]),
        "label_two": ("piece", np.full(8, 2)),
        "closed": ("piece", np.zeros(8, int)),
        "first": ("piece", np.arange(0, 16, 2)),
        "points": ("piece", np.full(8, 2)),
    }
    coordinates = {name: ("point", np.arange(16.0), {"units": "1"}) for name in ("a", "b")}
    ax = Figure().add_subplot()
    handles = boundary.draw(ax, xr.Dataset(pieces | coordinates), "a", "b", DEFAULT, {})
    texts = [handle.get_label() for handle in handles]
    assert texts == [
        *(f"boundary: stable set of saddle {k}" for k in range(1, 8)),
        "edge of the unlabelled region",
    ]
    looks = {(handle.get_color(), str(handle._dash_pattern)) for handle in handles}
    assert len(looks) == 8


THREE = """
body.mass = 1
restoring = { law = "linear", stiffness = 1 }
friction = { law = "viscous", damping = 0.005 }
contact = { law = "newton", restitution = 0.95, upper = 0.5 }
drive = { law = "harmonic", amplitude = 1, ratio = 4.2 }
run.duration = 1000
axis = [
  { name = "x0", from = -4, to = 0.5, count = 4 },
  { name = "v0", from = -5, to = 5, count = 4 },
]
"""


def test_pairs_that_meet_a_third_basin_name_no_recurrent_set(separatrix, tmp_path):
    """Three basins so interwoven that pairs of two meet the third: they wander on with other labels."""
    (tmp_path / "three.toml").write_text(THREE)
    succeed(separatrix, "basin", "three.toml", "-o", "three.h5", folder=tmp_path)
    succeed(separatrix, "boundary", "three.h5", "-o", "out.h5", "--grow", 0, folder=tmp_path)
    with open_result(tmp_path / "out.h5") as result:
        labels = {*result["label_one"].values.tolist(), *result["label_two"].values.tolist()}
        assert labels >= {1, 2, 3}
        names = decode_flags(result["name"]).values
        assert names.size > 15
        assert "recurrent" not in names
