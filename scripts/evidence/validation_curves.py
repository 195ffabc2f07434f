# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of docs/validation.md: points of codimension two, by `separatrix branches --free`."""

from evidence_rows import Row
from separatrix import open_result
from separatrix.open import decode_flags
from validation_program import Program, row


def resonant_grazes(program: Program) -> list[Row]:
    """Where the folds of the impact oscillator end on its grazes, over two parameters of the drive."""
    return [
        _fold_on_graze(program, "coco.resonant.2", (0.08, 0.12), 1.0, (0.95, 1.05)),
        _fold_on_graze(program, "coco.resonant.1", (1.0, 4.0), 1.95, (1.9, 2.1)),
    ]


def _fold_on_graze(
    program: Program, key: str, range_: tuple[float, float], ratio: float, free: tuple[float, float]
) -> Row:
    asked = (
        *("--parameter", "drive.amplitude", "--from", repr(range_[0]), "--to", repr(range_[1])),
        *("--set", f"drive.ratio={ratio}", "--searches", "4"),
        *("--free", "drive.ratio", "--free-from", repr(free[0]), "--free-to", repr(free[1])),
    )
    with open_result(program.run("branches", "impact_coco", options=asked)) as result:
        fold = decode_flags(result["curve_label"]).values == "SN"
        graze = decode_flags(result["curve_second"]).values == "GR"
        (crossing,) = result["curve_free"].values[fold & graze]
    how = f"`separatrix branches examples/validation/impact_coco.toml {' '.join(asked)}`"
    return row(f"{key}.branches", crossing, how)


COMPUTED = (resonant_grazes,)
