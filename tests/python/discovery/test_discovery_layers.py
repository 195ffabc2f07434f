# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The folders of the discovery workflow know only those below them."""

import ast
from pathlib import Path

import pytest

# lowest first; what lies beside the folders puts them together
LAYERS = ["measured", "fitting", "decision", "report"]
# choices, thresholds and words: known to all, knowing no layer
SHARED = {"options", "policy", "wording"}


def imported(file: Path) -> set[str]:
    """First names below separatrix.discovery that a module imports; "" for the package itself."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: a relative import"
            names = [node.module]
        found |= {
            name.removeprefix("separatrix.discovery").lstrip(".").split(".")[0]
            for name in names
            if name.startswith("separatrix.discovery")
        }
    return found


@pytest.mark.parametrize("layer", LAYERS)
def test_a_layer_knows_only_those_below(source_dir: Path, layer: str) -> None:
    folder = source_dir / "postprocess" / "separatrix" / "discovery" / layer
    files = sorted(folder.rglob("*.py"))
    assert len(files) > 3
    below = {*LAYERS[: LAYERS.index(layer) + 1], *SHARED}
    wrong = {file.name: imported(file) - below for file in files if imported(file) - below}
    assert wrong == {}


def test_the_shared_know_nobody(source_dir: Path) -> None:
    folder = source_dir / "postprocess" / "separatrix" / "discovery"
    files = [folder / "options.py", folder / "wording.py", *(folder / "policy").glob("*.py")]
    assert all(imported(file) <= {"policy"} for file in files)
    folders = {path.name for path in folder.iterdir() if path.is_dir()} - {"__pycache__"}
    assert folders == {*LAYERS, "policy"}
