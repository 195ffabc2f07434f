# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `branches` beside grazes of soft contacts."""

from pathlib import Path

import numpy as np
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
  { name = "x0", from = -3, to = 0.567, count = 20 },
  { name = "v0", from = -4, to = 4, count = 20 },
]
"""


def test_a_fold_beside_a_soft_graze_has_one_label(separatrix: Path, tmp_path: Path) -> None:
    """The step over the fold is taken anew at the graze, which is 3e-8 from it; labels on it stand once."""
    (tmp_path / "case.toml").write_text(SOFT)
    over = ("--parameter", "drive.amplitude", "--from", 0.147, "--to", 0.736, "--searches", 4)
    succeed(separatrix, "branches", "case.toml", *over, "-o", "out.h5", folder=tmp_path)
    with open_result(tmp_path / "out.h5") as result:
        labels = decode_flags(result["label"]).values
        special = [label for label in labels if label not in ("none", "end_of_range")]
        assert sorted(special) == ["GR", "SN", "SN"]
        words = decode_words(result["event_word"]).values
        hits = np.array([word.count("R") + word.count("L") for word in words])
        assert set(hits) == {0, 1}
        plain = labels == "none"
        assert (result["impacts"].values[plain] == hits[plain]).all()
