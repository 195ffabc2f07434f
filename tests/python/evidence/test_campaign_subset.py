# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A few hidden effects, found: the part of the discovery campaign that every change has to pass."""

import json
import os
import subprocess
import sys

import pytest


@pytest.mark.long
def test_a_few_hidden_effects_are_found(source_dir, build_dir, separatrix, tmp_path):
    library = build_dir / "lib" / "libseparatrix.so"
    environment = {
        **os.environ,
        "SEPARATRIX_LIBRARY": str(library),
        "PYTHONPATH": str(source_dir / "postprocess"),
        "OPENBLAS_NUM_THREADS": "1",
    }
    program = source_dir / "scripts/evidence/campaign/campaign.py"
    words = [program, "--subset", "ci", "--out", tmp_path, "--output", tmp_path / "page.md"]
    result = subprocess.run(
        [sys.executable, *map(str, words)], env=environment, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    right = 0
    for path in sorted((tmp_path / "seed_1" / "results").glob("*.json")):
        verdict = json.loads(path.read_text())["verdict"]
        truth = json.loads((tmp_path / "seed_1" / "sealed" / path.name).read_text())
        named = [*verdict["effects"], *verdict["alternatives"]]
        assert verdict["outcome"] != "failed", verdict
        if verdict["outcome"] == "named":
            assert verdict["effects"] == truth["names"], verdict
        right += named == [] if truth["kind"] == "none" else truth["names"][0] in named
    assert right >= 5
    assert "wrong name, all cases | <= 3 % | 0.0 %" in (tmp_path / "page.md").read_text()
