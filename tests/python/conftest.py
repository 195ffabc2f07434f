# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where things are, for all Python tests."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from program import make_results, succeed


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


@pytest.fixture(scope="session")
def mpi_separatrix(separatrix: Path) -> Path:
    """The program, where it can be run by mpirun."""
    version = subprocess.run([separatrix, "--version"], capture_output=True, text=True, check=True).stdout
    if "mpi none" in version:
        pytest.skip(f"{separatrix} was built without MPI")
    return separatrix


@pytest.fixture
def library(build_dir: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The library of the build that is tested, as the one in use; skips where it has not been built."""
    path = build_dir / "lib" / "libseparatrix.so"
    if not path.is_file():
        pytest.skip(f"{path} has not been built")
    monkeypatch.setenv("SEPARATRIX_LIBRARY", str(path))
    return path


@pytest.fixture(scope="session")
def results(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Files of every kind, beside the case and the list that they are made from. Not to be changed."""
    return make_results(separatrix, tmp_path_factory.mktemp("results"))


@pytest.fixture(scope="session")
def branch_file(separatrix: Path, results: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Branches of the same machine over the drive's ratio."""
    path = tmp_path_factory.mktemp("branches") / "branches.h5"
    over = ["--parameter", "drive.ratio", "--from", "0.9", "--to", "1.4", "--searches", "2"]
    succeed(
        separatrix, "branches", results["map"].parent / "case.toml", *over, "-o", path, folder=path.parent
    )
    return path


@pytest.fixture(scope="module")
def campaign(source_dir: Path) -> Iterator[SimpleNamespace]:
    """The modules of scripts/evidence/campaign."""
    with pytest.MonkeyPatch.context() as patch:
        for folder in ("scripts/evidence/campaign", "scripts/evidence", "tests/generator", "postprocess"):
            patch.syspath_prepend(str(source_dir / folder))
        import bars
        import figure
        import rates
        import scoring

        yield SimpleNamespace(rates=rates, scoring=scoring, bars=bars, figure=figure)
