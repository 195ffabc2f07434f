# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Short and long form of the fault tests, and the record of what they counted."""

import importlib.util
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

PYTHON_TESTS = Path(__file__).resolve().parents[1] / "python"
sys.path.insert(0, str(PYTHON_TESTS))

import life  # noqa: E402

# The fixtures that locate the program.
_shared = importlib.util.spec_from_file_location("python_tests_conftest", PYTHON_TESTS / "conftest.py")
_fixtures = importlib.util.module_from_spec(_shared)
_shared.loader.exec_module(_fixtures)
source_dir = _fixtures.source_dir
mpi_environment = _fixtures.mpi_environment
build_dir = _fixtures.build_dir
separatrix = _fixtures.separatrix
mpi_separatrix = _fixtures.mpi_separatrix


def pytest_addoption(parser: pytest.Parser) -> None:
    """The form, and where the figures go."""
    parser.addoption("--long", action="store_true", help="the long form of the fault tests")
    parser.addoption(
        "--figures", type=Path, help="JSON file to which the figures of the fault tests are added"
    )


@pytest.fixture(scope="session")
def long_form(request: pytest.FixtureRequest) -> bool:
    """Whether the long form was asked for."""
    return request.config.getoption("--long")


@pytest.fixture(scope="session")
def amount(long_form: bool) -> Callable[[int, int], int]:
    """Choose between the numbers of the short and of the long form."""
    return lambda short, long: long if long_form else short


@pytest.fixture(scope="session")
def long_if(long_form: bool) -> Callable[[bool], None]:
    """Skip a test in the short form if a condition holds."""

    def skip(condition: bool) -> None:
        if condition and not long_form:
            pytest.skip("in the long form")

    return skip


@pytest.fixture
def figures(request: pytest.FixtureRequest) -> Iterator[dict[str, object]]:
    """What a test counted; kept under the name of the test if it passed."""
    started = time.monotonic()
    found: dict[str, object] = {}
    yield found
    path = request.config.getoption("--figures")
    if path is None or not found:
        return
    found["seconds"] = round(time.monotonic() - started, 1)
    known = json.loads(path.read_text()) if path.exists() else {}
    known[request.node.name] = found
    path.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")


@pytest.fixture(scope="session")
def faulty_calls(build_dir: Path) -> Path:
    """The library that makes calls fail; absent where the sanitizers are, which it would have to follow."""
    library = build_dir / "bin" / "tests" / "libfaulty_calls.so"
    if not library.is_file():
        pytest.skip(f"{library} has not been built")
    return library


@pytest.fixture(scope="session")
def reference(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the run when nothing disturbs it."""
    folder = tmp_path_factory.mktemp("reference")
    life.write_case(folder)
    life.succeed(separatrix, *life.RUN, folder=folder)
    return folder / life.NAME
