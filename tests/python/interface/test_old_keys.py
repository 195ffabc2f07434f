# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases with keys of format version 1 are those of today in Python, too."""

from pathlib import Path

import separatrix as sx

HAMMER = Path(__file__).parents[3] / "examples" / "hammer.toml"


def test_a_case_with_older_keys_is_the_same_case() -> None:
    case = sx.load(HAMMER)
    older = HAMMER.read_text().replace("impulse_time =", "blow_time =").replace("impulse =", "blow =")
    assert "blow = 1" in older
    assert sx.Case.from_text(older) == case


def test_values_of_parameters_are_found_by_their_older_names() -> None:
    case = sx.load(HAMMER)
    assert case.in_si("body.blow", "2 N s") == case.in_si("body.impulse", "2 N s") == 2.0
    assert case.in_si("body.blow_time", "250 ms") == 0.25
