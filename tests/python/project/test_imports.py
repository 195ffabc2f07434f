# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Modules of the package use each other in one direction."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

PACKAGE = Path(__file__).parents[3] / "postprocess" / "separatrix"


def modules() -> dict[str, Path]:
    """Every module by its full name."""
    names = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        names[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return names


def used_by(path: Path, known: dict[str, Path]) -> set[str]:
    """Modules that a file imports, also within functions; not what only a type checker reads."""
    found = set()
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}
    return found & set(known)


def test_no_module_uses_itself_by_way_of_others() -> None:
    known = modules()
    assert "separatrix.maps" in used_by(known["separatrix.motions"], known)
    # A package is entered before its modules and uses none of them by a statement.
    graph = {name: used_by(path, known) - {name, "separatrix"} for name, path in known.items()}
    try:
        order = list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        raise AssertionError(f"modules use each other: {' -> '.join(error.args[1])}") from None
    assert len(order) == len(known)
