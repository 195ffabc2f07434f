# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `branches` where a chatter is just completed, against flights in closed form."""

from pathlib import Path

import numpy as np
import pytest
from program import succeed
from separatrix import open_result
from separatrix.open import decode_flags

FREQUENCY, RESTITUTION = 2.8, 0.1
STEADY = 1 / (1 - FREQUENCY**2)


def next_impact(start: float, wall: float, speed: float) -> tuple[float, float]:
    """When and how fast x'' + x = cos w t comes back to the wall that it leaves at a speed."""
    push = np.cos(FREQUENCY * start) - wall
    third = -FREQUENCY * np.sin(FREQUENCY * start) - speed
    fourth = -(FREQUENCY**2) * np.cos(FREQUENCY * start) - push
    fifth = FREQUENCY**3 * np.sin(FREQUENCY * start) - third
    if push > 0 and -2 * speed < 0.002 * push and speed < 0:
        # the way back to the wall over the time, as a series: it keeps its digits in the last bounces
        s = -2 * speed / push
        for _ in range(60):
            way = speed + s * (push / 2 + s * (third / 6 + s * (fourth / 24 + s * fifth / 120)))
            rate = push / 2 + s * (third / 3 + s * (fourth / 8 + s * fifth / 30))
            s -= way / rate
            if not 0 < s < 0.1:
                break
        else:
            return start + s, speed + s * (push + s * (third / 2 + s * (fourth / 6 + s * fifth / 24)))
    free = wall - STEADY * np.cos(FREQUENCY * start), speed + STEADY * FREQUENCY * np.sin(FREQUENCY * start)

    def x(t):
        return STEADY * np.cos(FREQUENCY * t) + free[0] * np.cos(t - start) + free[1] * np.sin(t - start)

    t = start + 1e-3 * np.arange(1, 12_000)
    i = np.flatnonzero((x(t[:-1]) < wall) & (x(t[1:]) >= wall))[0]
    low, high = t[i], t[i + 1]
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if x(middle) < wall else (low, middle)
    end = (low + high) / 2
    v = (
        -STEADY * FREQUENCY * np.sin(FREQUENCY * end)
        - free[0] * np.sin(end - start)
        + free[1] * np.cos(end - start)
    )
    return end, v


def completes(wall: float) -> bool:
    """Whether the impacts after the release from the wall die out while the force presses the body on it."""
    t, v = np.arccos(wall) / FREQUENCY, 0.0
    for n in range(60):
        last = t
        t, v = next_impact(t, wall, v)
        push = np.cos(FREQUENCY * t) - wall
        left = (np.arccos(wall) - FREQUENCY * t) % (2 * np.pi) / FREQUENCY
        # it has left the wall
        if n and (push <= 0 or t - last > 1):
            return False
        v = -RESTITUTION * v
        if push > 0 and -2 * v / (1 - RESTITUTION) < 1e-4 * left * push:
            return True
    raise AssertionError(wall)


def test_both_sides_of_the_onset_of_a_chatter_meet(
    separatrix: Path, source_dir: Path, tmp_path: Path
) -> None:
    """One side rests on the wall after its impacts; the other has ever more, each with a fold and a graze.

    Bounces lower than the rounding of the position keep the other some 1e-6 away from it.
    """
    low, high = 0.1485, 0.1486
    assert completes(low)
    assert not completes(high)
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if completes(middle) else (low, middle)
    case = source_dir / "examples" / "validation" / "budd_dux.toml"
    over = ("--parameter", "contact.upper", "--from", 0.14, "--to", 0.16, "--searches", 6, "--quiet")
    one = ("--set", f"contact.restitution={RESTITUTION}")
    succeed(separatrix, "branches", case, *over, *one, "-o", "out.h5", folder=tmp_path)
    with open_result(tmp_path / "out.h5") as result:
        labels = decode_flags(result["label"]).values
        parameter = result["parameter"].values
    assert parameter[labels == "chatter_onset"] == pytest.approx([low], abs=1e-9)
    assert parameter[labels == "many_impacts"] == pytest.approx([low], abs=3e-6)
    grazes = parameter[labels == "GR-fold"]
    folds = parameter[labels == "SN"]
    for values in (grazes, folds):
        above = np.sort(values[(values > low) & (values < 0.1495)])[::-1] - low
        # a deviation from the chatter grows eightfold with each bounce
        assert len(above) >= 2
        assert (above[1:] / above[:-1] < 0.16).all()
