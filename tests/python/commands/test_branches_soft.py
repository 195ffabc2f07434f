# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `branches` beside grazes of soft contacts."""

from pathlib import Path

import numpy as np
import pytest
from program import succeed
from separatrix import open_result
from separatrix.open import decode_flags, decode_words

SOFT = """
body = { mass = 1.566, gravity = 0.6385696040868455 }
restoring = { law = "linear", stiffness = 3.654 }
friction.law = "coulomb_viscous"
friction.kinetic_coefficient = 0.403
friction.static_coefficient = 0.4584
friction.damping = 0.0505
contact = { law = "kelvin_voigt", stiffness = 365.4, damping = 0.239, tension = 1, upper = 0.567 }
drive = { law = "harmonic", amplitude = 0.368, ratio = 1.045 }
start = { x0 = -0.05 }
run = { duration = 200 }
axis = [
  { name = "x0", from = -3, to = 0.567, count = 5 },
  { name = "v0", from = -4, to = 4, count = 5 },
]
"""
MIRROR = (
    SOFT.replace("upper = 0.567", "lower = -0.567")
    .replace("ratio = 1.045", "ratio = 1.045, angle = 3.141592653589793")
    .replace("from = -3, to = 0.567", "from = -0.567, to = 3")
    .replace("x0 = -0.05", "x0 = 0.05")
)
OVER = ("--parameter", "drive.amplitude", "--from", 0.147, "--to", 0.736, "--searches", 4)


def test_a_fold_beside_a_soft_graze_has_one_label(separatrix: Path, tmp_path: Path) -> None:
    """The step over the fold is taken anew at the graze, which is 3e-8 from it; labels on it stand once."""
    (tmp_path / "case.toml").write_text(SOFT)
    succeed(separatrix, "branches", "case.toml", *OVER, "-o", "out.h5", folder=tmp_path)
    with open_result(tmp_path / "out.h5") as result:
        labels = decode_flags(result["label"]).values
        special = [label for label in labels if label not in ("none", "end_of_range")]
        assert sorted(special) == ["GR", "SN", "SN"]
        words = decode_words(result["event_word"]).values
        hits = np.array([word.count("R") + word.count("L") for word in words])
        assert set(hits) == {0, 1}
        plain = labels == "none"
        assert (result["impacts"].values[plain] == hits[plain]).all()


@pytest.mark.parametrize(
    ("damping", "tension", "expected"),
    [
        pytest.param(0.239, 1, ["GR", "SN", "SN"], marks=pytest.mark.long),
        (1, 0, ["GR", "SN", "SN"]),
        pytest.param(4, 0, ["GR-fold", "SN"], marks=pytest.mark.long),
    ],
)
def test_a_branch_turns_in_a_soft_graze_only_where_it_does(
    separatrix: Path, tmp_path: Path, damping: float, tension: int, expected: list[str]
) -> None:
    """A machine and its mirror image, whose branches are followed in other steps, are alike. Folds 3e-8 and
    2e-9 behind a graze are no part of it. A barrier that does not pull and damps more turns the branch in the
    graze itself: there det(1 - M) changes its sign with the first touch (Feigin)."""
    found = []
    for case in (SOFT, MIRROR):
        text = case.replace("damping = 0.239, tension = 1", f"damping = {damping}, tension = {tension}")
        (tmp_path / "case.toml").write_text(text)
        succeed(separatrix, "branches", "case.toml", *OVER, "-o", "out.h5", "--force", folder=tmp_path)
        with open_result(tmp_path / "out.h5") as result:
            labels = decode_flags(result["label"]).values
            values = result["parameter"].values
            special = [k for k, label in enumerate(labels) if label not in ("none", "end_of_range")]
            assert [labels[k] for k in special] == expected
            found.append(values[special])
            # The parameter turns at a fold, in the contact or in the graze, and nowhere else.
            turns = np.flatnonzero(np.diff(np.sign(np.diff(values)))) + 1
            assert [labels[k] for k in turns] == [label for label in expected if label != "GR"]
            folds = labels == "SN"
            multipliers = result["multiplier_real"].values[folds]
            assert np.abs(multipliers - 1).min(axis=1) == pytest.approx(0, abs=1e-8)
            graze = special[0]
            first = result["multiplier_real"].values[graze + 1]
            if expected[0] == "GR-fold":
                assert np.prod(1 - first) < 0 < np.prod(1 - result["multiplier_real"].values[graze])
    assert found[0] == pytest.approx(found[1], abs=1e-11)
