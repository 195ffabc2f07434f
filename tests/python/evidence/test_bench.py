# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparison with other programs: its command line, and that everybody solves the same problem."""

import os
import subprocess

import h5py
import numpy as np
import pytest
from program import succeed

STARTS = ((0.4, 0.0), (0.8, 0.0), (0.25, 5.5))


def test_help_needs_nothing_installed(source_dir):
    result = subprocess.run([source_dir / "scripts/evidence/bench", "--help"], capture_output=True, text=True)
    assert result.returncode == 0
    assert "--quick" in result.stdout


def test_an_unknown_option_is_named(source_dir):
    result = subprocess.run([source_dir / "scripts/evidence/bench", "--fast"], capture_output=True, text=True)
    assert result.returncode == 64
    assert "--fast" in result.stderr


@pytest.mark.parametrize("peer", ["cvode", "gsl"])
def test_the_driver_of_a_peer_agrees_with_ours(
    source_dir, build_dir, separatrix, tmp_path, monkeypatch, peer
):
    library = build_dir / "bench_peers" / f"libbench_{peer}.so"
    if not library.is_file():
        pytest.skip(f"{library} has not been built; scripts/evidence/bench does")
    for folder in ("scripts/evidence", "scripts/evidence/bench_peers"):
        monkeypatch.syspath_prepend(str(source_dir / folder))
    from compiled import Compiled

    from machine import CASE, TOLERANCE, published_machine

    peers = Compiled(library, published_machine(), TOLERANCE).run(np.array(STARTS))
    (tmp_path / "list.csv").write_text("x0,v0\n" + "".join(f"{x},{v}\n" for x, v in STARTS))
    succeed(separatrix, "points", CASE, "--list", "list.csv", "-o", "ours.h5", "--quiet", folder=tmp_path)
    with h5py.File(tmp_path / "ours.h5") as ours:
        assert peers.impacts.tolist() == ours["impacts"][()].tolist()
        np.testing.assert_allclose(peers.x, ours["x"][()], atol=1e-6)
        np.testing.assert_allclose(peers.v, ours["v"][()], atol=1e-6)


@pytest.mark.parametrize("key", ["hunt_crossley", "kelvin_voigt_cut", "cubic", "power", "dahl"])
def test_a_peer_has_the_machine_of_the_row(source_dir, separatrix, tmp_path, monkeypatch, key):
    for folder in ("scripts/evidence", "scripts/evidence/bench_peers"):
        monkeypatch.syspath_prepend(str(source_dir / folder))
    from compiled import Compiled, build
    from rows import ROWS

    from machine import TOLERANCE, machine_of, read_case

    case = next(row for row in ROWS if row.key == key).write(tmp_path)
    library = build("gsl", tmp_path)
    peers = Compiled(library, machine_of(read_case(case)), TOLERANCE).run(np.array(STARTS))
    (tmp_path / "list.csv").write_text("x0,v0\n" + "".join(f"{x},{v}\n" for x, v in STARTS))
    succeed(separatrix, "points", case, "--list", "list.csv", "-o", "ours.h5", "--quiet", folder=tmp_path)
    with h5py.File(tmp_path / "ours.h5") as ours:
        assert peers.impacts.tolist() == ours["impacts"][()].tolist()
        np.testing.assert_allclose(peers.x, ours["x"][()], atol=1e-6)


def test_every_row_is_a_case(source_dir, separatrix, tmp_path, monkeypatch):
    for folder in ("scripts/evidence", "scripts/evidence/bench_peers"):
        monkeypatch.syspath_prepend(str(source_dir / folder))
    from rows import ROWS

    for row in ROWS:
        succeed(separatrix, "basin", row.write(tmp_path), "--validate", folder=tmp_path)


def test_the_quadruple_reference_agrees_with_ours(source_dir, build_dir, separatrix, tmp_path, monkeypatch):
    for folder in ("scripts/evidence", "scripts/evidence/bench_peers"):
        monkeypatch.syspath_prepend(str(source_dir / folder))
    import reference_run

    from machine import CASE

    monkeypatch.setattr(reference_run, "SHARE", 2)
    library = build_dir / "lib" / "libseparatrix_reference.so"
    found = reference_run.run_on_all_cores(library, separatrix, np.array(STARTS))
    (tmp_path / "list.csv").write_text("x0,v0\n" + "".join(f"{x},{v}\n" for x, v in STARTS))
    succeed(separatrix, "points", CASE, "--list", "list.csv", "-o", "ours.h5", "--quiet", folder=tmp_path)
    with h5py.File(tmp_path / "ours.h5") as file:
        assert found.x == pytest.approx(file["x"][()], abs=1e-11)
        assert found.v == pytest.approx(file["v"][()], abs=1e-10)
        assert found.impacts.tolist() == file["impacts"][()].tolist()


def test_the_kernel_that_counts_does_the_same(source_dir, build_dir, separatrix, tmp_path):
    """The labels of the usual kernel; an event takes an evaluation of the motion or more."""
    program = build_dir / "bin" / "separatrix_counted"
    if not program.is_file():
        pytest.skip(f"{program} has not been built")
    words = ["--set", "axis[1].count=10", "--set", "axis[2].count=10", "--set", 'run.stop="duration"']
    case = source_dir / "examples" / "basin_coulomb.toml"
    maps = []
    for name in (separatrix, program):
        out = tmp_path / f"{name.name}.h5"
        env = {**os.environ, "LANE_COUNTS": str(tmp_path / "counts")}
        subprocess.run([name, "basin", case, "-o", out, "-q", *words], check=True, env=env)
        with h5py.File(out) as file:
            maps.append({key: file[key][:] for key in ("attractor", "impacts_per_period")})
    assert all(np.array_equal(maps[0][key], maps[1][key]) for key in maps[0])
    evaluations, events, left = map(int, (tmp_path / "counts").read_text().split())
    assert evaluations >= events > left >= 0
