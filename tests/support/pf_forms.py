# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forms of a .pf file: those that pFUnit takes and those that it refuses, each in a suite `test_it`.

tests/python/project/test_pf_translator.py tries the translator with them, `pfunit_check` pFUnit.
"""

HEAD = "module test_it\n  use {uses}\n  implicit none\n{declarations}contains\n"
TAIL = "end module test_it\n"


def suite(*tests: str, uses: str = "funit", declarations: str = "") -> str:
    return HEAD.format(uses=uses, declarations=declarations) + "".join(tests) + TAIL


def case(name: str, *body: str) -> str:
    lines = "".join(f"    {line}\n" for line in body)
    return f"  @test\n  subroutine {name}()\n{lines}  end subroutine {name}\n"


def mpi_case(name: str, npes: str, *body: str) -> str:
    lines = "".join(f"    {line}\n" for line in body)
    argument = "    class(MpiTestMethod), intent(inout) :: this\n"
    return f"  @test({npes})\n  subroutine {name}(this)\n{argument}{lines}  end subroutine {name}\n"


def procedure(mark: str, name: str, *arguments: str) -> str:
    """A subroutine without statements, under a mark if one is given."""
    above = f"  @{mark}\n" if mark else ""
    declared = "".join(f"    class(MpiTestMethod), intent(inout) :: {a}\n" for a in arguments)
    return f"{above}  subroutine {name}({', '.join(arguments)})\n{declared}  end subroutine {name}\n"


def asserting(*body: str, **options: str) -> str:
    return suite(case("a", *body), **options)


HOLDS = "@assertTrue(.true.)"
TAKEN = {
    "all marks": suite(procedure("before", "b"), procedure("after", "c"), case("a", HOLDS)),
    "a comment line below a mark": suite(case("a", HOLDS).replace("@test\n", "@test\n  ! why\n")),
    "default integer expected": asserting("@assertEqual(3, 3_8)", "@assertLessThan(2, 3_1)"),
    "default real expected": asserting("@assertEqual(0.5, 0.5d0, tolerance=1e-6)"),
    "integer expected of a real": asserting("@assertEqual(1, [1d0, 1d0])", "@assertLessThan(0, 1.0)"),
    "one expected of many": asserting("@assertEqual(1, [1, 1])", "@assertEqual('a', ['a', 'a'])"),
    "positional message": asserting("@assertEqual(1, 1, 'one')", "@assertLessThan(1d0, 2d0, 'two')"),
    "an exclamation mark in a string": asserting("@assertEqual('a!b', 'a!b')"),
    "blanks before and behind the parenthesis": asserting("@assertTrue (.true.)  "),
    "a name of pFUnit's in a procedure": asserting(
        "integer :: any_of", "any_of = 1", "@assertEqual(1, any_of)"
    ),
    "an MPI test": suite(mpi_case("a", "npes=[1, 2]", HOLDS), uses="pfunit"),
    "a serial test beside it": suite(mpi_case("a", "npes=[1]", HOLDS), case("b", HOLDS), uses="pfunit"),
    "mpi_f08 beside MpiTestMethod alone": suite(
        mpi_case(
            "a", "npes=[1]", "type(MPI_Comm) :: comm", "comm%mpi_val = this%getMpiCommunicator()", HOLDS
        ),
        uses="funit\n  use mpi_f08, only: MPI_Comm\n  use pfunit, only: MpiTestMethod",
    ),
}
REFUSED = {
    # lines
    "an assertion on two lines": asserting("@assertEqual(1, &", "  1)"),
    "a comment behind an assertion": asserting("@assertTrue(.true.) ! so"),
    "a comment with a parenthesis": asserting("@assertTrue(.true.) ! (so)"),
    "an assertion in an if": asserting("if (.true.) @assertTrue(.true.)"),
    "no closing parenthesis": asserting("@assertTrue(.true."),
    "no arguments": asserting("@assertTrue"),
    "an unknown assertion": asserting("@assertMaybe(.true.)"),
    "a comment behind @test": suite(case("a", HOLDS).replace("@test\n", "@test ! a\n")),
    "a comment behind @before": suite(procedure("before ! b", "b"), case("a", HOLDS)),
    "a C comment": asserting("! all of tests/*.pf", HOLDS),
    # names
    "a procedure named like an export": suite(case("a", HOLDS), procedure("", "any_of")),
    "a variable named like an export": asserting(HOLDS, declarations="  integer :: near = 1\n"),
    "a test named like an export": suite(case("every", HOLDS)),
    "an import named like an export": asserting(
        HOLDS, "print *, starts_with", uses="iso_c_binding, only: starts_with => c_int\n  use funit"
    ),
    "an intrinsic function named like an export": asserting("@assertEqual(-1, not(0))"),
    "a public variable named suite": asserting(HOLDS, declarations="  integer :: suite = 1\n"),
    "another test_suite": suite(case("a", HOLDS), procedure("", "test_it_suite")),
    "a private test": asserting(HOLDS, declarations="  private\n"),
    "mpi_f08 beside all of pfunit": suite(
        mpi_case("a", "npes=[1]", "integer :: n", "call MPI_Comm_size(MPI_COMM_WORLD, n)", HOLDS),
        uses="pfunit\n  use mpi_f08, only: MPI_Comm_size, MPI_COMM_WORLD",
    ),
    "the communicator as a component": suite(
        mpi_case("a", "npes=[1]", "print *, this%comm", HOLDS), uses="pfunit"
    ),
    # procedures
    "npes without an argument": suite(case("a", HOLDS).replace("@test", "@test(npes=[2])"), uses="pfunit"),
    "an argument without npes": suite(mpi_case("a", "", HOLDS).replace("@test()", "@test"), uses="pfunit"),
    "npes with a comma at its end": suite(mpi_case("a", "npes=[1, ]", HOLDS), uses="pfunit"),
    "@before alone in an MPI suite": suite(
        procedure("before", "b", "this"), mpi_case("a", "npes=[1]", HOLDS), uses="pfunit"
    ),
    "@before and @after without the tests' argument": suite(
        procedure("before", "b"), procedure("after", "c"), mpi_case("a", "npes=[1]", HOLDS), uses="pfunit"
    ),
    # argument lists
    "an array below a scalar": asserting("@assertLessThan([1, 2], 3)"),
    "an array expected of a scalar": asserting("@assertEqual([1, 1], 1)"),
    "int64 expected of int32": asserting("@assertEqual(1_8, 1)"),
    "int64 below int32": asserting("@assertLessThan(1_8, 2)"),
    "real64 expected of real32": asserting("@assertEqual(1d0, 1.0)"),
    "real64 below real32": asserting("@assertLessThan(1d0, 2.0)"),
    "a real expected of an integer": asserting("@assertEqual(1.0, 1)"),
    "tolerance of another kind": asserting("@assertEqual(1.0, 1.0, tolerance=1d-6)"),
    "tolerance of integers": asserting("@assertEqual(1, 1, tolerance=0)"),
    "relatively equal without tolerance": asserting("@assertRelativelyEqual(1d0, 1d0)"),
    "positional message of logicals": asserting("@assertEqual(.true., .true., 'so')"),
    "positional message of an order of integers": asserting("@assertLessThan(1, 2, 'so')"),
    "other keywords": asserting("@assertEqual(expected=1, found=1)"),
    "a matrix of conditions": asserting("@assertTrue(reshape([.true.], [1, 1]))"),
    "an array of NaN": asserting("@assertIsNaN([1d0])"),
}
