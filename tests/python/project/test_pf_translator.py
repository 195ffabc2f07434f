# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stand-in for pFUnit: a suite passes if, and only if, all that it asserts holds."""

import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "support"))
from pf_forms import REFUSED, TAKEN, case, mpi_case, suite  # noqa: E402

SERIAL = [
    "pfunit_names.f90",
    "test_outcome.f90",
    "comparisons.f90",
    "assertions.f90",
    "test_runner.f90",
    "funit.f90",
]
PARALLEL = ["mpi_test_method.f90", "mpi_test_runner.f90", "pfunit.f90"]
FLAGS = ["-O0", "-ffree-line-length-none", "-fimplicit-none"]


@dataclass
class Fallback:
    """The translator, and a folder with its support modules compiled."""

    folder: Path
    support: Path
    compiler: str
    sources: list[str]

    def translate(self, text: str, *options: str) -> subprocess.CompletedProcess:
        (self.folder / "test_it.pf").write_text(text)
        command = [sys.executable, str(self.support / "pf_to_fortran.py"), "test_it.pf", *options]
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True)

    def build(self, text: str) -> subprocess.CompletedProcess:
        translated = self.translate(text, "test_it.F90")
        if translated.returncode != 0:
            return translated
        objects = [source.replace(".f90", ".o") for source in self.sources]
        command = [self.compiler, *FLAGS, "test_it.F90", *objects, "-o", "test_it"]
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True)

    def run(self, text: str, ranks: int = 0) -> subprocess.CompletedProcess:
        built = self.build(text)
        assert built.returncode == 0, built.stderr
        command = ["./test_it"]
        if ranks:
            command = ["mpirun", "-n", str(ranks), *command]
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True, timeout=60)


def compiled(folder: Path, source_dir: Path, compiler: str, sources: list[str]) -> Fallback:
    support = source_dir / "tests" / "support"
    writer = [sys.executable, str(support / "write_assertions.py"), str(folder / "assertions.f90")]
    subprocess.run(writer, check=True)
    for source in sources:
        path = folder / source if source == "assertions.f90" else support / source
        subprocess.run([compiler, *FLAGS, "-std=f2018", "-c", str(path)], cwd=folder, check=True)
    return Fallback(folder, support, compiler, sources)


@pytest.fixture(scope="session")
def serial(tmp_path_factory, source_dir):
    if not shutil.which("gfortran"):
        pytest.skip("no gfortran")
    return compiled(tmp_path_factory.mktemp("serial"), source_dir, "gfortran", SERIAL)


@pytest.fixture(scope="session")
def parallel(tmp_path_factory, source_dir):
    if not shutil.which("mpifort"):
        pytest.skip("no MPI")
    folder = tmp_path_factory.mktemp("parallel")
    return compiled(folder, source_dir, "mpifort", SERIAL + PARALLEL)


def test_all_that_holds_passes(serial):
    body = [
        "@assertEqual(1, 1)",
        "@assertEqual(5000000000_8, 5000000000_8)",
        "@assertEqual(3, 3_1)",
        "@assertEqual([1, 2], [1, 2])",
        "@assertEqual(0, [0, 0])",
        "@assertEqual(reshape([1, 2, 3, 4], [2, 2]), reshape([1, 2, 3, 4], [2, 2]))",
        "@assertEqual(0.5, 0.5d0)",
        "@assertEqual(1d0, 1d0 + 1d-9, tolerance=1d-8)",
        "@assertEqual([1d0, 2d0], [1d0, 2d0 + 1d-9], tolerance=1e-8, message='near')",
        "@assertEqual(.true., .true.)",
        "@assertEqual('text', 'text')",
        "@assertEqual(['a', 'b'], ['a', 'b'])",
        "@assertRelativelyEqual(1d6, 1d6 + 1, tolerance=1d-5)",
        "@assertTrue(1 < 2)",
        "@assertFalse([.false., .false.], message='none (of them)')",
        "@assertLessThan(1, 2)",
        "@assertLessThanOrEqual(2, [2d0, 3d0])",
        "@assertGreaterThan(2.0, 1.0)",
        "@assertGreaterThanOrEqual(2_8, 2_8)",
        "@assertIsFinite(1d0)",
        "@assertIsNaN(sqrt(-merge(1d0, 2d0, command_argument_count() == 0)))",
        "@assertEqual('a & b ! c', 'a & b ! c')",
    ]
    result = serial.run(suite(case("holds", *body)))
    assert result.returncode == 0, result.stdout
    assert result.stdout.splitlines()[-1] == "1 passed, 0 failed"


@pytest.mark.parametrize(
    "assertion, message",
    [
        ("@assertEqual(1, 2)", "expected 1, found 2"),
        ("@assertEqual([1, 2], [1, 3])", "expected 2, found 3 at (2)"),
        ("@assertEqual([1, 2], [1, 2, 3])", "expected shape (2), found (3)"),
        ("@assertEqual(0, reshape([0, 0, 7, 0], [2, 2]))", "expected 0, found 7 at (1,2)"),
        ("@assertEqual(1d0, 1d0 + 1d-7, tolerance=1d-8)", "difference 1.00E-007"),
        ("@assertEqual(1d0, log(-1d0 * (1 + command_argument_count())))", "found NaN"),
        ("@assertRelativelyEqual(1d0, 1.1d0, tolerance=1d-2)", "allowed 1.00E-002"),
        ("@assertEqual('one', 'two')", 'expected "one", found "two"'),
        ("@assertEqual(.true., .false.)", "expected true, found false"),
        ("@assertTrue([.true., .false.])", "expected true, found false at (2)"),
        ("@assertFalse(.true., message='why')", "expected false, found true (why)"),
        ("@assertLessThan(2, 2)", "expected 2 < 2"),
        ("@assertLessThanOrEqual(3, 2)", "expected 3 <= 2"),
        ("@assertGreaterThan(2, 2)", "expected 2 > 2"),
        ("@assertGreaterThanOrEqual(1, 2)", "expected 1 >= 2"),
        ("@assertIsNaN(1.0)", "expected NaN, found 1.0"),
        ("@assertIsFinite(1d308 * (10 + command_argument_count()))", "expected a finite number"),
    ],
)
def test_a_failure_names_line_expected_and_found(serial, assertion, message):
    text = suite(case("before_it", "@assertTrue(.true.)"), case("fails", assertion, "stop 'here'"))
    line = text.splitlines().index(f"    {assertion}") + 1
    result = serial.run(text)
    assert result.returncode == 1
    assert f"test_it.pf:{line}: " in result.stdout
    assert message in result.stdout
    assert result.stdout.splitlines()[-1] == "1 passed, 1 failed"


def test_a_test_that_asserts_nothing_fails(serial):
    result = serial.run(suite(case("asserts_none", "continue")))
    assert result.returncode == 1
    assert "asserts_none asserts nothing" in result.stdout


def test_before_and_after_run_around_each_test(serial):
    setup = "  @before\n  subroutine setup()\n    depth = depth + 1\n  end subroutine setup\n"
    teardown = "  @after\n  subroutine clean()\n    depth = depth - 1\n  end subroutine clean\n"
    fails = case("fails", "@assertEqual(2, depth)")
    text = suite(setup, fails, case("passes", "@assertEqual(1, depth)"), teardown)
    text = text.replace("implicit none\n", "implicit none\n  integer :: depth = 0\n")
    result = serial.run(text)
    assert result.stdout.splitlines()[-1] == "1 passed, 1 failed"
    assert "expected 2, found 1" in result.stdout


@pytest.mark.parametrize(
    "text, message",
    [
        (suite("  subroutine a()\n  end subroutine a\n"), "no @test"),
        (suite(case("a", "@assertMaybe(1)")), "8: unknown annotation @assertMaybe"),
        (suite(case("a", "@assertTrue(.true.")), "7: @assertTrue has no closing parenthesis"),
        (suite("  @test(cases=[1])\n" + case("a")), "5: @test(cases=[1]) is not understood"),
        (suite("  @test\n  integer function a()\n  end function a\n"), "no subroutine"),
        (suite(case("a", "@assertTrue(.true.)"), case("A", "@assertTrue(.true.)")), "two tests"),
        (suite(mpi_case("a", "npes=[2]", "@assertTrue(.true.)")), "needs `use pfunit`"),
        (suite(case("a")).replace("module test_it", "module other"), "must be named test_it"),
        (suite(case("a")).replace("module test_it", "module test_it ! it", 1), "must be named test_it"),
    ],
)
def test_what_cannot_be_translated_is_an_error(serial, text, message):
    text = text.replace("@assertMaybe", "continue\n    @assertMaybe")
    result = serial.translate(text, "test_it.F90")
    assert result.returncode == 1
    assert result.stderr.startswith("test_it.pf:")
    assert message in result.stderr


def test_compiler_messages_name_the_lines_of_the_suite(serial):
    text = suite(case("a", "@assertEqual(1, 1)", "call missing_name(undeclared)"))
    line = text[: text.index("call missing_name")].count("\n") + 1
    assert f"test_it.pf:{line}:" in serial.build(text).stderr


@pytest.mark.parametrize("form", TAKEN)
def test_it_takes_what_pfunit_takes(parallel, form):
    built = parallel.build(TAKEN[form])
    assert built.returncode == 0, built.stderr


@pytest.mark.parametrize("form", REFUSED)
def test_it_refuses_what_pfunit_refuses(parallel, form):
    built = parallel.build(REFUSED[form])
    assert built.returncode != 0
    assert "test_it" in built.stderr


def test_ranks_are_the_largest_npes(serial):
    tests = [mpi_case("a", "npes=[1, 4]", "continue"), mpi_case("b", "npes=[2]", "continue")]
    assert serial.translate(suite(*tests, uses="pfunit"), "--ranks").stdout == "4\n"


def test_an_mpi_test_runs_once_per_npes_on_that_many_ranks(parallel):
    body = ["@assertTrue(any(this%getNumProcesses() == [1, 3]))"]
    text = suite(mpi_case("a", "npes=[1, 3]", *body), uses="pfunit")
    result = parallel.run(text, ranks=3)
    assert result.returncode == 0, result.stdout
    assert [line for line in result.stdout.splitlines() if line.startswith("ok")] == [
        "ok      a [npes=1]",
        "ok      a [npes=3]",
    ]


def test_a_failure_on_any_rank_fails(parallel):
    text = suite(mpi_case("a", "npes=[1, 2]", "@assertEqual(0, this%getProcessRank())"), uses="pfunit")
    result = parallel.run(text, ranks=2)
    assert result.returncode == 1
    assert "expected 0, found 1" in result.stdout
    assert "1 passed, 1 failed" in result.stdout


def test_too_few_ranks_fail(parallel):
    text = suite(mpi_case("a", "npes=[2]", "@assertTrue(.true.)"), uses="pfunit")
    result = parallel.run(text, ranks=1)
    assert result.returncode == 1
    assert "needs more ranks" in result.stdout


@pytest.mark.long
def test_ranks_left_waiting_by_a_failure_do_not_hang(parallel):
    body = [
        "integer :: error",
        "@assertEqual(0, this%getProcessRank())",
        "call MPI_Barrier(this%getMpiCommunicator(), error)",
    ]
    text = suite(mpi_case("a", "npes=[2]", *body), uses="pfunit")
    result = parallel.run(text, ranks=2)
    assert result.returncode != 0
    assert "still waiting" in result.stdout
