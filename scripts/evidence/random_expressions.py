#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes two suites of tests/expressions: values, derivatives and Taylor coefficients of expressions.

One has every function and functions of random expressions, the other has operators between them.

The expected numbers are of mpmath, which must be installed: values, and derivatives as differences
with 450 digits.
"""

import argparse
import operator
import random
from collections.abc import Callable
from pathlib import Path

import mpmath

FOLDER = Path(__file__).resolve().parents[2] / "tests" / "expressions"
ORDERS = 8
POINT = (mpmath.mpf(3) / 4, mpmath.mpf(-5) / 4)
SPEED = (mpmath.mpf(1), mpmath.mpf(-1) / 2)
Number = mpmath.mpf
Function = Callable[[Number, Number], Number]
FUNCTIONS: dict[str, Callable[[Number], Number]] = {
    "sqrt": mpmath.sqrt,
    "exp": mpmath.exp,
    "log": mpmath.log,
    "sin": mpmath.sin,
    "cos": mpmath.cos,
    "tan": mpmath.tan,
    "asin": mpmath.asin,
    "acos": mpmath.acos,
    "atan": mpmath.atan,
    "sinh": mpmath.sinh,
    "cosh": mpmath.cosh,
    "tanh": mpmath.tanh,
    "abs": abs,
    "sign": mpmath.sign,
}
OPERATORS: dict[str, Callable[[Number, Number], Number]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "^": operator.pow,
}
# with the text of the exponent
EXPONENTS = {"2": 2, "3": 3, "-1": -1, "-2": -2, "1.5": mpmath.mpf("1.5"), "0.375": mpmath.mpf("0.375")}

HEADER = """! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> {what}, against values, derivatives and Taylor coefficients of mpmath.
!> Written by scripts/evidence/random_expressions.py.
module {suite}
  use errors, only: error_t
  use expression_text, only: read_expression
  use funit
  use kinds, only: real64, wp
  use tape, only: new_tape, tape_t, variable, constant
  use tape_derivative, only: differentiate
  use tape_parts, only: prune
  use tape_series, only: expand, prepare_series, series_t
  use tape_value, only: evaluate, starting_branches
  implicit none

  real(wp), parameter :: point(2) = [0.75_wp, -1.25_wp]

contains

  !> Value, derivatives by x and y, and coefficients along x = 3/4 + t, y = -5/4 - t/2.
  subroutine expect(text, slopes, coefficients)
    character(len=*), intent(in) :: text
    real(wp), intent(in) :: slopes(2), coefficients(0:)
    type(tape_t) :: tape
    type(error_t), allocatable :: error
    type(series_t) :: series
    integer :: states(2), rates(2), nodes(3), fault, i
    integer, allocatable :: branches(:), faults(:)
    real(wp), allocatable :: value(:)
    call new_tape(tape)
    do i = 1, 2
      call variable(tape, i, states(i))
    end do
    call read_expression(text, ['x', 'y'], states, tape, nodes(1), error)
    @assertFalse(allocated(error), message=text)
    do i = 1, 2
      call differentiate(tape, nodes(1:1), states(i), nodes(i + 1:i + 1))
    end do
    call prune(tape, nodes)
    allocate (value(tape%count), faults(tape%count))
    call evaluate(tape, point, point, value, faults)
    @assertEqual(0, maxval(faults(nodes)), message=text)
    @assertLessThanOrEqual(apart(coefficients(:0), value(nodes(:1))), 1.0_real64, message=text)
    @assertLessThanOrEqual(apart(slopes, value(nodes(2:))), 1.0_real64, message=text)

    call constant(tape, 1.0_wp, rates(1))
    call constant(tape, -0.5_wp, rates(2))
    allocate (branches(size(tape%switches)))
    call starting_branches(tape, point, point, branches)
    call prepare_series(tape, ubound(coefficients, 1), rates, nodes(1:1), branches, series)
    call expand(tape, point, point, series, fault)
    @assertEqual(0, fault, message=text)
    @assertLessThanOrEqual(apart(coefficients, series%c(:, nodes(1))), 1.0_real64, message=text)
  end subroutine expect

  !> Largest difference in units of what rounding may make.
  pure real(real64) function apart(expected, found)
    real(wp), intent(in) :: expected(:), found(:)
    real(wp), parameter :: rounding = 2000*epsilon(1.0_wp)
    apart = real(maxval(abs(expected - found))/(rounding*max(1.0_wp, maxval(abs(expected)))), real64)
  end function apart
"""


def combined(name: str, left: Function, right: Function) -> Function:
    return lambda x, y: OPERATORS[name](left(x, y), right(x, y))


def applied(name: str, inner: Function) -> Function:
    return lambda x, y: FUNCTIONS[name](inner(x, y))


def number(value: float) -> Function:
    return lambda _x, _y: mpmath.mpf(value)


def grow(source: random.Random, depth: int) -> tuple[str, Function]:
    """A random expression, as text and as function of x and y."""
    if depth == 0 or source.random() < 0.1:
        value = source.randint(1, 31) / 8
        return source.choice([("x", lambda x, _y: x), ("y", lambda _x, y: y), (str(value), number(value))])
    if source.random() < 0.45:
        name = source.choice(list(FUNCTIONS))
        text, inner = grow(source, depth - 1)
        return f"{name}({text})", applied(name, inner)
    first, left = grow(source, depth - 1)
    if source.random() < 0.2:
        exponent = source.choice(list(EXPONENTS))
        return f"({first})^{exponent}", combined("^", left, number(EXPONENTS[exponent]))
    second, right = grow(source, depth - 1)
    name = source.choice("+-*/")
    return f"({first} {name} {second})", combined(name, left, right)


def numbers_of(function: Function) -> tuple[list[Number], list[Number]] | None:
    """Derivatives by x and y, and Taylor coefficients; None where they are no moderate real numbers."""
    step = mpmath.mpf(10) ** -45
    try:
        slopes = [
            mpmath.diff(lambda x: function(x, POINT[1]), POINT[0], h=step, relative=False),
            mpmath.diff(lambda y: function(POINT[0], y), POINT[1], h=step, relative=False),
        ]
        found = slopes + mpmath.taylor(
            lambda t: function(POINT[0] + SPEED[0] * t, POINT[1] + SPEED[1] * t),
            0,
            ORDERS,
            h=step,
            direction=0,
        )
    except (TypeError, ValueError, ZeroDivisionError, OverflowError, mpmath.libmp.ComplexResult):
        return None
    if any(isinstance(value, mpmath.mpc) for value in found):
        return None
    if not all(mpmath.isfinite(value) and abs(value) < 1000 for value in found):
        return None
    return found[:2], found[2:]


def literal(value: Number) -> str:
    # differences are that exact
    text = (
        mpmath.nstr(value, 36, strip_zeros=False, min_fixed=-1, max_fixed=4) if abs(value) > 1e-38 else "0.0"
    )
    return f"{text}_wp"


def wrapped(numbers: list[Number]) -> str:
    words = [literal(value) for value in numbers]
    return ", &\n      ".join(", ".join(words[i : i + 2]) for i in range(0, len(words), 2))


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    mpmath.mp.dps = 450
    source = random.Random(20261127)
    rows: list[tuple[str, list[Number], list[Number]]] = []

    def inner(x: Number, y: Number) -> Number:
        return x * y / 4 + POINT[0]

    singles: list[tuple[str, Function]] = [
        (f"{name}(x*y/4 + 0.75)", applied(name, inner)) for name in FUNCTIONS
    ]
    singles += [
        ("atan2(y, x)", lambda x, y: mpmath.atan2(y, x)),
        ("hypot(x, y)", mpmath.hypot),
        ("x^x", lambda x, _y: x**x),
        ("max(x, y, x*y)", lambda x, _y: x),
        ("min(x, y, x*y)", lambda _x, y: y),
        ("if(x*y < x, x^5, y^5)", lambda x, _y: x**5),
        ("x^2.75", lambda x, _y: x ** mpmath.mpf("2.75")),
    ]
    for text, meaning in singles:
        numbers = numbers_of(meaning)
        if numbers is None:
            raise SystemExit(f"no numbers for {text}")
        rows.append((text, *numbers))
    while len(rows) < 80:
        text, meaning = grow(source, 4)
        # an arc of its own function magnifies rounding
        if not 25 <= len(text) <= 90 or "asin(sin" in text or "acos(cos" in text:
            continue
        numbers = numbers_of(meaning)
        if numbers is not None and any(numbers[0]):
            rows.append((text, *numbers))
    write_suite("test_function_expressions", "Functions, also of random expressions", [
        row for row in rows if has_function_outside(row[0])
    ])  # fmt: skip
    write_suite("test_random_expressions", "Operators between random expressions", [
        row for row in rows if not has_function_outside(row[0])
    ])  # fmt: skip


def has_function_outside(text: str) -> bool:
    """Whether the last thing done is a function."""
    return text[0].isalpha() and text.endswith(")")


def write_suite(suite: str, what: str, rows: list[tuple[str, list[Number], list[Number]]]) -> None:
    parts = [HEADER.replace("{suite}", suite).replace("{what}", what)]
    for first in range(0, len(rows), 10):
        name = f"expressions_{first + 1}_to_{min(first + 10, len(rows))}"
        parts.append(f"\n  @test\n  subroutine {name}()\n")
        for text, slopes, coefficients in rows[first : first + 10]:
            numbers = f"[ &\n      {wrapped(slopes)}], [ &\n      {wrapped(coefficients)}]"
            parts.append(f"    call expect('{text}', {numbers})\n")
        parts.append(f"  end subroutine {name}\n")
    parts.append(f"\nend module {suite}\n")
    (FOLDER / f"{suite}.pf").write_text("".join(parts), encoding="utf-8")
    print(f"{len(rows)} expressions in {suite}")


if __name__ == "__main__":
    main()
