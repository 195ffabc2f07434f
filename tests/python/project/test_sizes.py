# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Procedures and files are short enough to be read at once."""

import re
from pathlib import Path

SOURCE = Path(__file__).parents[3] / "src"
POSTPROCESS = SOURCE.parent / "postprocess"
MOST = 60
MOST_OF_A_FILE = 400
#: Kernels that are one algorithm; files that are still to be split.
WHOLE_FILES = {
    "fit.py": 431,
    "lane_contact.hpp": 411,
    "lane_kernel.hpp": 488,
    "lane_series.hpp": 493,
    "noise.py": 427,
    "series_flight.f90": 477,
    "single_trajectory.f90": 403,
    "structure_search.hpp": 406,
    "toml_shim.cpp": 417,
    "verdict.py": 404,
    "verdict_sections.py": 419,
}
#: Searches and loops of the flights, which run faster in one piece.
WHOLE = {
    "advance_multibody": 73,
    "answer": 63,
    "find_first": 62,
    "fly_series": 61,
    "note_peaks": 63,
    "prepare_search": 62,
    "raise_together": 71,
    "salt": 71,
    "set_guards": 61,
}
HEAD = re.compile(r"\s*(?!end\b)(?:[\w*]+(?:\([^()]*\))?\s+)*?(?:subroutine|function)\s+(\w+)\b", re.I)
END = re.compile(r"\s*end (?:subroutine|function) (\w+)", re.I)


def lengths(text: str) -> dict[str, int]:
    """Lines of every procedure, from its head to its end, by its name."""
    found: dict[str, int] = {}
    begun: list[tuple[str, int]] = []
    for number, line in enumerate(text.splitlines()):
        if end := END.match(line):
            while begun:
                name, first = begun.pop()
                if name == end[1]:
                    found[name] = max(found.get(name, 0), number - first + 1)
                    break
        elif not line.lstrip().startswith("!") and (head := HEAD.match(line)):
            begun.append((head[1], number))
    return found


def test_a_procedure_is_measured_with_what_it_contains() -> None:
    text = "\n".join(
        [
            "  pure real(wp) function outer(x) result(y)",
            "    y = inner(x)",
            "  contains",
            "    pure real(wp) function inner(x)",
            "    end function inner",
            "  end function outer",
            "  subroutine next()",
            "  end subroutine next",
        ]
    )
    assert lengths(text) == {"inner": 2, "outer": 6, "next": 2}


def test_procedures_are_short() -> None:
    every = {
        name: n for path in SOURCE.rglob("*.f90") for name, n in lengths(path.read_text()).items() if n > MOST
    }
    assert {name: n for name, n in every.items() if n > WHOLE.get(name, MOST)} == {}
    assert set(WHOLE) == set(every), "a procedure that is short now leaves the list"


def test_files_are_short() -> None:
    every = {
        path.name: n
        for folder in (SOURCE, POSTPROCESS)
        for path in folder.rglob("*")
        if path.suffix in (".f90", ".hpp", ".cpp", ".py")
        and (n := path.read_text().count("\n")) > MOST_OF_A_FILE
    }
    assert {name: n for name, n in every.items() if n > WHOLE_FILES.get(name, MOST_OF_A_FILE)} == {}
