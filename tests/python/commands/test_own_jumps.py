# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A spring whose foot jumps by an expression over time: the motion, and the work of the jumps."""

import h5py
import numpy as np
import pytest
from program import succeed
from scipy.integrate import solve_ivp

JUMPS = """
[body]
mass = 1
[restoring]
law = "linear"
stiffness = "50 N/m"
[drive]
law = "expression"
position = "if(sin(2*pi*(t - shift)) > 0, 0.1, -0.1)"
shift = "{shift} s"
period = "1 s"
[start]
v0 = 0.1
[run]
duration = 5
average = "window"
{more}
"""
FRICTION = """
[friction]
law = "coulomb"
kinetic_coefficient = 0.1
load = "10 + 2*sin(2*pi*t)"
"""


def balance(separatrix, folder, text: str) -> tuple[h5py.File, np.ndarray, float]:
    """The file of a trajectory, what its balance misses at each sample, and the largest energy [J]."""
    (folder / "case.toml").write_text(text)
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", folder=folder)
    file = h5py.File(folder / "out.h5")
    lost = sum(file[name][()] for name in ("friction_loss", "damping_loss", "contact_loss"))
    missing = file.attrs["energy_start"] + file["drive_work"][()] - lost - file["energy"][()]
    return file, missing, float(np.max(file["energy"][()]))


def by_solver(shift: float, times: np.ndarray) -> np.ndarray:
    """Position at `times`, by pieces of constant foot."""
    edges = np.unique(np.concatenate([[0.0, 5.0], np.arange(-10, 12) / 2 + shift]))
    edges = edges[(edges >= 0) & (edges <= 5)]
    state, found = np.array([0.0, 0.1]), np.full(times.shape, np.nan)
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        foot = 0.1 if np.sin(2 * np.pi * ((first + last) / 2 - shift)) > 0 else -0.1
        piece = solve_ivp(
            lambda _, y, foot=foot: [y[1], 50 * (foot - y[0])],
            (first, last),
            state,
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
            dense_output=True,
        )
        inside = (times >= first) & (times <= last)
        found[inside] = piece.sol(times[inside])[0]
        state = piece.y[:, -1]
    return found


# Jumps at the section, at samples, and between them.
@pytest.mark.parametrize("shift", [0.0, 0.1, 0.25, 0.3, 0.31234])
def test_the_balance_has_the_work_of_the_jumps(separatrix, tmp_path, shift):
    file, missing, size = balance(separatrix, tmp_path, JUMPS.format(shift=shift, more=""))
    assert file.attrs["energy_put_in"] > 10
    assert abs(file.attrs["energy_closing_error"]) < 1e-11 * size
    assert np.max(np.abs(missing)) < 1e-11 * size
    assert file["x"][()] == pytest.approx(by_solver(shift, file["time"][()]), abs=1e-9)


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.31234])
def test_the_balance_has_the_work_of_jumps_beside_friction_and_impacts(separatrix, tmp_path, shift):
    stop = '[contact]\nlaw = "newton"\nrestitution = 0.6\nupper = "0.15 m"\n'
    file, missing, size = balance(separatrix, tmp_path, JUMPS.format(shift=shift, more=FRICTION + stop))
    assert file.attrs["energy_lost_to_friction"] > 0 and file.attrs["energy_lost_to_contacts"] > 0
    assert abs(file.attrs["energy_closing_error"]) < 1e-11 * size
    assert np.max(np.abs(missing)) < 1e-11 * size
