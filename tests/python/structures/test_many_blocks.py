# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A row of blocks on springs that stick and slide, after Burridge and Knopoff, beside SciPy with events."""

from pathlib import Path

import numpy as np
import pytest
import separatrix as sx
from program import run, succeed
from scipy.integrate import solve_ivp

COUNT, DURATION = 25, 1.0
ANCHOR, COUPLING, DAMPING, SLIDING, STATIC = 1.0, 10.0, 0.05, 0.5, 0.8


def machine() -> tuple[np.ndarray, np.ndarray]:
    """Masses and initial positions."""
    random = np.random.default_rng(3)
    return 1 + 0.3 * random.random(COUNT), 0.6 * random.standard_normal(COUNT)


def case() -> str:
    """The row as a case; its first block is the one that is watched."""
    mass, x0 = machine()
    lines = ["[start]", f"x0 = {x0[0]}", "[watch]", 'body = "b0"']
    lines += ["[run]", f"duration = {DURATION}", 'average = "window"']
    for i in range(COUNT):
        lines += [f"[body.b{i}]", f"mass = {mass[i]}", *([f"x0 = {x0[i]}"] if i else [])]
        lines += [
            f"[spring.anchor{i}]",
            f'between = ["b{i}"]',
            f"stiffness = {ANCHOR}",
            f"damping = {DAMPING}",
        ]
        lines += [f"[friction.f{i}]", f'between = ["b{i}"]', f"force = {SLIDING}", f"static_force = {STATIC}"]
        if i:
            lines += [f"[spring.s{i}]", f'between = ["b{i - 1}", "b{i}"]', f"stiffness = {COUPLING}"]
    return "\n".join(lines) + "\n"


def independent() -> tuple[np.ndarray, int]:
    """Positions at the end, and how many events there were."""
    mass, x = machine()
    stiffness = ANCHOR * np.eye(COUNT)
    for i in range(1, COUNT):
        pair = np.ix_([i - 1, i], [i - 1, i])
        stiffness[pair] += COUPLING * np.array([[1, -1], [-1, 1]])
    v, t, events = np.zeros(COUNT), 0.0, 0

    def pull(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return -stiffness @ x - DAMPING * v

    side = np.where(abs(pull(x, v)) > STATIC, np.sign(pull(x, v)), 0.0)
    while True:
        now = side.copy()

        def rates(_: float, y: np.ndarray, now: np.ndarray = now) -> np.ndarray:
            x, v = np.split(y, 2)
            moves = now != 0
            return np.r_[v * moves, (pull(x, v) - SLIDING * now) / mass * moves]

        watched = []
        for i in range(COUNT):

            def ends(_: float, y: np.ndarray, i: int = i, now: np.ndarray = now) -> float:
                x, v = np.split(y, 2)
                return now[i] * v[i] if now[i] else STATIC - abs(pull(x, v)[i])

            ends.terminal, ends.direction = True, -1
            watched.append(ends)
        found = solve_ivp(
            rates, (t, DURATION), np.r_[x, v], method="DOP853", rtol=1e-12, atol=1e-13, events=watched
        )
        t, (x, v) = found.t[-1], np.split(found.y[:, -1], 2)
        if found.status != 1:
            return x, events
        events += 1
        for i in np.flatnonzero([one.size for one in found.t_events]):
            if side[i]:
                v[i] = 0.0
            force = pull(x, v)[i]
            side[i] = 0.0 if side[i] and abs(force) <= STATIC else np.sign(force)


def test_every_block_is_where_an_independent_integrator_has_it(separatrix: Path, tmp_path: Path) -> None:
    (tmp_path / "row.toml").write_text(case())
    succeed(separatrix, "trajectory", "row.toml", "-o", "row.h5", folder=tmp_path)
    motion = sx.open_result(tmp_path / "row.h5")
    expected, events = independent()
    found = [float(motion["x" if i == 0 and "b0_x" not in motion else f"b{i}_x"][-1]) for i in range(COUNT)]
    assert found == pytest.approx(expected, abs=1e-10)
    assert motion.sizes["event"] == events > 20
    assert abs(motion.attrs["energy_closing_error"]) < 1e-9


def test_too_many_are_refused(separatrix: Path, tmp_path: Path) -> None:
    row = "".join(
        f"[body.b{i}]\nmass = 1\n[spring.s{i}]\nbetween = ['b{i}']\nstiffness = 1\n" for i in range(65)
    )
    (tmp_path / "row.toml").write_text(row + "[watch]\nbody = 'b0'\n")
    done = run(separatrix, "trajectory", "row.toml", "-o", "row.h5", folder=tmp_path)
    assert done.code == 65
    assert "found 65 coordinates, allowed at most 64" in done.err
