# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lost samples among scattered stamps: by their definition, in time proportional to the record."""

import time

import numpy as np
import pytest
from separatrix.discovery.measured import clock
from separatrix.discovery.policy import RECORDS


def scattered(count: int, seed: int, size: float = 0.3) -> np.ndarray:
    """Stamps of even samples, each late by chance, with some samples lost."""
    random = np.random.default_rng(seed)
    lost = np.sort(random.integers(1, count, max(1, count // 40)))
    even = np.arange(count) + np.searchsorted(lost, np.arange(count), "right")
    return np.sort(even + size * random.standard_normal(count))


def lost_by_definition(t: np.ndarray, usual: float) -> list[int]:
    """Row by row: the largest jump of the means beside it within reach, or a step that is wide in itself."""
    late, steps, reach = t - usual * np.arange(t.size), np.diff(t), RECORDS.around_step
    jump = {
        row: late[row : row + reach].mean() - late[max(0, row - reach) : row].mean()
        for row in range(1, t.size)
        if steps[row - 1] > RECORDS.late * usual
    }
    return [
        row
        for row, size in jump.items()
        if steps[row - 1] > RECORDS.lost * usual
        or (size > 0.5 * usual and size == max(jump[k] for k in jump if abs(k - row) < reach))
    ]


@pytest.mark.parametrize("seed", range(20))
def test_lost_samples_are_those_of_the_definition(seed: int) -> None:
    count = [8, 40, 300, 1500][seed % 4]
    t = scattered(count, seed, [0.1, 0.3, 0.6][seed % 3])
    usual = float(np.median(np.diff(t)))
    wanted = lost_by_definition(t, usual)
    assert clock._lost(t, np.diff(t), usual).tolist() == wanted
    assert wanted or count < 40


def test_lost_samples_of_a_long_record_are_found_in_no_time() -> None:
    """Each row was held against all others."""
    t = scattered(400_000, 1)
    began = time.process_time()
    clock._lost(t, np.diff(t), 1.0)
    assert time.process_time() - began < 1.0
