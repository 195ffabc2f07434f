# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The struct of segments: the same members in C, Fortran and Python, and no array that is missing."""

import ctypes
import re
from pathlib import Path

import numpy as np
import pytest
from program import CASE
from separatrix.binding import call, pointer
from separatrix.library import CaseError, Model
from separatrix.segments import SegmentsCall

OF_PYTHON = {ctypes.c_int: "int", ctypes.c_double: "double", ctypes.c_void_p: "pointer"}
OF_FORTRAN = {"integer(c_int)": "int", "real(c_double)": "double", "type(c_ptr)": "pointer"}


def of_header(text: str) -> list[tuple[str, str]]:
    """Members of the struct in the header."""
    body = text.split("typedef struct separatrix_segments {")[1].split("} separatrix_segments;")[0]
    body = re.sub(r"/\*.*?\*/", "", body, flags=re.DOTALL)
    found = []
    for member in filter(None, (one.strip() for one in body.split(";"))):
        kind, name = re.fullmatch(r"(?:const )?(int|double) (\*?\w+)", member).groups()
        found.append((name.strip("*"), "pointer" if "*" in name else kind))
    return found


def of_fortran(text: str) -> list[tuple[str, str]]:
    """Members of the type of the library."""
    body = text.split("type, bind(c) :: segments_t\n")[1].split("end type")[0]
    pairs = (line.strip().split(" :: ") for line in body.splitlines() if "::" in line)
    return [(name, OF_FORTRAN[kind]) for kind, name in pairs]


def test_c_fortran_and_python_have_the_same_members(source_dir: Path) -> None:
    """Name by name, in one order, with the same types."""
    wanted = of_header((source_dir / "include" / "separatrix.h").read_text())
    assert len(wanted) > 20
    assert of_fortran((source_dir / "src" / "capi" / "c_segments.f90").read_text()) == wanted
    assert [(name, OF_PYTHON[kind]) for name, kind in SegmentsCall._fields_] == wanted


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(
    ("missing", "expected"),
    [
        ({"start": None}, "start: found NULL"),
        ({"motion": None}, "motion: found NULL"),
        ({"derivatives": 1}, "jacobian: found NULL"),
        ({"impact_capacity": 1}, "impact_segment: found NULL"),
        ({"segment_count": -1}, "start: found a negative size"),
        ({"start_numbers": 2}, "start_numbers: found 2, allowed 3"),
        ({"sample_numbers": 5}, "sample_numbers: found 5, allowed 2"),
    ],
)
def test_a_wrong_struct_is_refused(missing: dict, expected: str) -> None:
    """Instead of a crash, or of numbers from elsewhere."""
    model = Model.from_text(CASE)
    start, first, times = np.array([0.5, 1.0, 0.3]), np.array([0, 2], np.int32), np.array([0.0, 0.1])
    motion, report = np.zeros((2, 2)), np.zeros((3, 1), np.int32)
    given = SegmentsCall(
        segment_count=1, start_numbers=3, sample_numbers=2, tolerance=1e-9, start=pointer(start),
        first=pointer(first), times=pointer(times), motion=pointer(motion), impacts=pointer(report[0]),
        steady=pointer(report[1]), reason=pointer(report[2]),
    )  # fmt: skip
    call("separatrix_propagate", model._handle, ctypes.byref(given))
    np.testing.assert_allclose(motion[0], [0.5, 1.0], rtol=1e-12)
    for name, value in missing.items():
        setattr(given, name, value)
    with pytest.raises(CaseError, match=expected) as refusal:
        call("separatrix_propagate", model._handle, ctypes.byref(given))
    assert refusal.value.code == 64
