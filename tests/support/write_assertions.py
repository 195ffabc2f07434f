#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes module `assertions`: pFUnit's assertions for the kinds and ranks (up to 2) that it takes.

write_assertions.py OUTPUT.f90
"""

import sys
from pathlib import Path

INTEGERS = ("int8", "int16", "int32", "int64")
REALS = ("real32", "real64")
SAME_RANK = ((0, 0), (1, 1), (2, 2))
SCALAR_AGAINST_ARRAY = ((0, 1), (0, 2))
# The first argument is of the second's kind or of default kind; with a real second also a default integer.
INTEGER_PAIRS = [(a, b) for b in INTEGERS for a in INTEGERS if a in (b, "int32")]
REAL_PAIRS = [(a, b) for b in REALS for a in ("int32", *REALS) if a in (b, "int32", "real32")]
ORDER = {
    "assertLessThan": "<",
    "assertLessThanOrEqual": "<=",
    "assertGreaterThan": ">",
    "assertGreaterThanOrEqual": ">=",
}


def declaration(kind: str) -> str:
    if kind in INTEGERS:
        return f"integer({kind})"
    if kind in REALS:
        return f"real({kind})"
    return {"logical": "logical", "character": "character(len=*)"}[kind]


def dimensions(rank: int) -> str:
    return "(" + ",".join(":" * rank) + ")" if rank else ""


def row(name: str, kind: str, rank: int, other: str, other_rank: int, wide: str) -> str:
    """`name` converted to the widest kind and laid out in a row as long as its partner's."""
    value = f"{'int' if wide == 'int64' else 'real'}({name}, {wide})" if wide else name
    if rank == 0:
        return f"spread({value}, 1, size({other}))" if other_rank else f"[{value}]"
    return f"[{value}]" if kind == "character" or rank == 2 else value


class Writer:
    """Collects specific procedures and the generics that they belong to."""

    def __init__(self) -> None:
        self.generics: dict[str, list[str]] = {}
        self.procedures: list[str] = []

    def add(
        self, generic: str, arguments: list[tuple], call: list[str], guard: str = "", keyword: bool = False
    ) -> None:
        """arguments: (name, kind, rank) of the dummies before message and location.

        With `keyword` the message can be given by its keyword alone.
        """
        specifics = self.generics.setdefault(generic, [])
        name = f"{generic}_{len(specifics) + 1}"
        specifics.append(name)
        names = ", ".join([argument[0] for argument in arguments] + ["keyword"] * keyword)
        self.procedures += [
            f"  subroutine {name}({names}, message, location)",
            *(
                f"    {declaration(kind)}, intent(in) :: {dummy}{dimensions(rank)}"
                for dummy, kind, rank in arguments
            ),
            *(["    class(keyword_t), intent(in), optional :: keyword"] if keyword else []),
            "    character(len=*), intent(in), optional :: message",
            "    type(SourceLocation), intent(in), optional :: location",
            *([guard] if guard else []),
            "    call " + ", &\n      ".join(call) + ", message, location)",
            f"  end subroutine {name}",
            "",
        ]

    def pair(
        self, generic, kinds, ranks, wide, routine, extra=(), names=("expected", "actual"), keyword=False
    ):
        """An assertion about two values; extra = arguments after them: (dummy, kind, expression)."""
        (a, b), (kind_a, kind_b), (rank_a, rank_b) = names, kinds, ranks
        array = b if rank_b else a
        guard = ""
        if rank_a and rank_b:
            guard = f"    if (.not. same_shape(shape({a}), shape({b}), message, location)) return"
        arguments = [(a, kind_a, rank_a), (b, kind_b, rank_b)]
        arguments += [(dummy, kind, 0) for dummy, kind, _ in extra if dummy]
        call = [
            f"{routine}({row(a, kind_a, rank_a, b, rank_b, wide)}",
            row(b, kind_b, rank_b, a, rank_a, wide),
            f"shape({array})",
            *(expression for _, _, expression in extra),
        ]
        self.add(generic, arguments, call, guard, keyword)

    def text(self) -> str:
        lines = [
            "!> Written by write_assertions.py.",
            "module assertions",
            "  use, intrinsic :: iso_fortran_env, only: int8, int16, int32, int64, real32, real64",
            "  use comparisons, only: same_shape, compare, compare_relatively, compare_order, &",
            "    check_all, check_nan, check_finite",
            "  use test_outcome, only: SourceLocation",
            "  implicit none",
            "  private",
            "",
            "  type :: keyword_t",
            "  end type keyword_t",
            "",
        ]
        for generic, specifics in self.generics.items():
            lines += [f"  public :: {generic}", f"  interface {generic}"]
            lines += [f"    module procedure {specific}" for specific in specifics]
            lines += [f"  end interface {generic}"]
        return "\n".join([*lines, "", "contains", "", *self.procedures, "end module assertions", ""])


def write_equal(out: Writer) -> None:
    for pair in SAME_RANK + SCALAR_AGAINST_ARRAY:
        for kinds in INTEGER_PAIRS:
            out.pair("assertEqual", kinds, pair, "int64", "compare")
        out.pair("assertEqual", ("logical", "logical"), pair, "", "compare", keyword=True)
        for kinds in REAL_PAIRS:
            out.pair("assertEqual", kinds, pair, "real64", "compare", [("", "", "0.0_real64")])
            for tolerance in sorted({"real32", kinds[1]}):
                extra = [("tolerance", tolerance, "real(tolerance, real64)")]
                out.pair("assertEqual", kinds, pair, "real64", "compare", extra)
                out.pair("assertRelativelyEqual", kinds, pair, "real64", "compare_relatively", extra)
    for pair in ((0, 0), (0, 1), (1, 1)):
        kinds = ("character", "character")
        out.pair("assertEqual", kinds, pair, "", "compare", names=("expected", "found"))


def write_order(out: Writer) -> None:
    for generic, relation in ORDER.items():
        extra = [("", "", f"'{relation}'")]
        for pair in SAME_RANK + SCALAR_AGAINST_ARRAY:
            for kinds in INTEGER_PAIRS:
                out.pair(generic, kinds, pair, "int64", "compare_order", extra, ("lhs", "rhs"), keyword=True)
            for kinds in REAL_PAIRS:
                out.pair(generic, kinds, pair, "real64", "compare_order", extra, ("lhs", "rhs"))


def write_conditions(out: Writer) -> None:
    for rank in (0, 1):
        values = "condition" if rank else "[condition]"
        for generic, wanted in (("assertTrue", ".true."), ("assertFalse", ".false.")):
            call = [f"check_all({wanted}", values, "shape(condition)"]
            out.add(generic, [("condition", "logical", rank)], call)
    for kind in REALS:
        for generic, routine in (("assertIsNaN", "check_nan"), ("assertIsFinite", "check_finite")):
            call = [f"{routine}([real(x, real64)]", "shape(x)"]
            out.add(generic, [("x", kind, 0)], call)


def main() -> int:
    out = Writer()
    write_equal(out)
    write_order(out)
    write_conditions(out)
    Path(sys.argv[1]).write_text(out.text(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
