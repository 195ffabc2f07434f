# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where things are, for all Python tests."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def source_dir() -> Path:
    """The top of the repository."""
    return Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session", autouse=True)
def mpi_environment(source_dir: Path) -> None:
    """The variables that mpirun needs, also where pytest is started by hand."""
    for line in (source_dir / "scripts" / "environment.sh").read_text().splitlines():
        if line.startswith("export "):
            name, value = line.removeprefix("export ").split("=", 1)
            os.environ.setdefault(name, value)


@pytest.fixture(scope="session")
def build_dir(source_dir: Path) -> Path:
    """The build to test: $SEPARATRIX_BUILD or build/."""
    return Path(os.environ.get("SEPARATRIX_BUILD", source_dir / "build"))


@pytest.fixture(scope="session")
def separatrix(build_dir: Path) -> Path:
    """The program; tests that need it are skipped where it has not been built."""
    program = build_dir / "bin" / "separatrix"
    if not program.is_file():
        pytest.skip(f"{program} has not been built")
    return program
