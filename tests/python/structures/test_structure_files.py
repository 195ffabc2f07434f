# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures out of files: converted, reduced, flown; and what is refused."""

import h5py
import numpy as np
import pytest
from beams import RATIOS, cantilever, single_impact_orbits
from program import run, succeed
from scipy import io, sparse
from scipy.integrate import solve_ivp
from separatrix.structures.cli import main

ELEMENTS = 12

CASE = """\
[structure.beam]
file = "{file}"
{more}
[contact.stop]
between = ["beam.tip"]
law = "newton"
restitution = 0.8
upper = {stop}
[drive.force]
law = "force"
body = "beam.tip"
amplitude = {force}
frequency = {omega}
[start]
x0 = {x0}
v0 = {v0}
crank_angle = {angle}
[run]
duration = 14
window = 7
[attractors]
max_period = 1
"""


@pytest.fixture(scope="module")
def matrices():
    """M and K of the beam."""
    return cantilever(ELEMENTS)


def _mtx(folder, mass, stiffness):
    for name, matrix in (("mass", mass), ("stiffness", stiffness)):
        io.mmwrite(folder / f"{name}.mtx", sparse.coo_array(matrix), precision=17)
    return ["--mass", folder / "mass.mtx", "--stiffness", folder / "stiffness.mtx"]


def _mat(folder, mass, stiffness):
    io.savemat(folder / "beam.mat", {"M": mass, "K": sparse.csc_array(stiffness)})
    return [folder / "beam.mat"]


def _npz(folder, mass, stiffness):
    np.savez(folder / "beam.npz", inertia=mass, K=stiffness)
    return [folder / "beam.npz", "--names", "mass=inertia"]


def _op4(folder, mass, stiffness):
    op4 = pytest.importorskip("pyyeti.nastran").op4
    op4.write(str(folder / "beam.op4"), {"maa": mass, "kaa": stiffness})
    return [folder / "beam.op4"]


def _hb(folder, mass, stiffness):
    for name, matrix in (("mass", mass), ("stiffness", stiffness)):
        io.hb_write(folder / f"{name}.hb", sparse.csc_matrix(matrix))
    return ["--mass", folder / "mass.hb", "--stiffness", folder / "stiffness.hb"]


def _abaqus(folder, mass, stiffness):
    """One triangle; node 99 is held by 1e36, as Abaqus does it, and has no mass."""
    for name, matrix in (("mass", mass), ("stiffness", stiffness)):
        lines = [
            f"{i // 2 + 1},{2 + 4 * (i % 2)}, {j // 2 + 1},{2 + 4 * (j % 2)}, {matrix[i, j]:.17e}"
            for i in range(len(matrix))
            for j in range(i + 1)
            if matrix[i, j]
        ]
        held = ["99,2, 99,2, 1.0e36"] if name == "stiffness" else []
        (folder / f"{name}.mtx").write_text("\n".join([*lines, *held]) + "\n")
    return ["--mass", folder / "mass.mtx", "--stiffness", folder / "stiffness.mtx"]


@pytest.mark.parametrize("write", [_mtx, _mat, _npz, _op4, _hb, _abaqus])
def test_formats(write, matrices, tmp_path, capsys):
    """Every format gives the same modes, those of the beam."""
    words = write(tmp_path, *matrices)
    tip = f"{ELEMENTS}:y" if write is _abaqus else str(2 * ELEMENTS - 1)
    output = tmp_path / "beam.h5"
    words = [*words, "--point", f"tip={tip}", "--reduce", "modal", "--modes", "4", "-o", output]
    assert main([str(word) for word in words]) == 0, capsys.readouterr().err
    assert "static flexibility" in capsys.readouterr().out
    with h5py.File(output) as file:
        assert file["structure/frequency"][:] * 2 * np.pi == pytest.approx(RATIOS[:4], rel=1e-3)
        assert np.abs(file["structure/point/tip"][:]) == pytest.approx(np.full(4, 2), rel=1e-3)


def test_universal_file(tmp_path, capsys):
    """Modes of a test, with modal masses and damping ratios, become mass-normalised."""
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "test.uff"
    masses = [2.0, 0.5]
    for mode, (frequency, mass) in enumerate(zip((10.0, 25.0), masses, strict=True)):
        shape = np.array([0.5, 1.0]) * (1 + mode)
        pyuff.UFF(str(path)).write_sets(
            pyuff.prepare_55(
                model_type=1, id1="a", id2="b", id3="c", id4="d", id5="e", analysis_type=2, data_ch=2,
                spec_data_type=8, data_type=2, load_case=1, mode_n=mode + 1, freq=frequency, modal_m=mass,
                modal_damp_vis=0.01 * (1 + mode), modal_damp_his=0.0, node_nums=[7, 8],
                r1=0 * shape, r2=shape, r3=0 * shape, r4=0 * shape, r5=0 * shape, r6=0 * shape,
            ),
            "add" if mode else "overwrite",
        )  # fmt: skip
    output = tmp_path / "modes.h5"
    assert main([str(path), "--point", "tip=8:y", "--point", "mid=0.5*7:y+0.5*8:y", "-o", str(output)]) == 0
    with h5py.File(output) as file:
        assert file["structure/frequency"][:] == pytest.approx([10, 25])
        assert file["structure/damping_ratio"][:] == pytest.approx([0.01, 0.02])
        assert file["structure/point/tip"][:] == pytest.approx(np.array([1, 2]) / np.sqrt(masses))
        assert file["structure/point/mid"][:] == pytest.approx(np.array([0.75, 1.5]) / np.sqrt(masses))
    assert main([str(path), "--point", "tip=9:y", "-o", str(tmp_path / "no.h5")]) == 65
    assert "there is no coordinate '9:2'" in capsys.readouterr().err


def test_craig_bampton_keeps_the_static_flexibility(matrices, tmp_path):
    """The tip deflects by L^3/(3 E I); the lowest frequencies are those of the beam from above."""
    words = [*_mat(tmp_path, *matrices), "--point", f"tip={2 * ELEMENTS - 1}", "--reduce", "craig-bampton"]
    output = tmp_path / "beam.h5"
    assert main([str(word) for word in [*words, "--modes", "5", "-o", output]]) == 0
    with h5py.File(output) as file:
        mass, stiffness, tip = (file[f"structure/{name}"][:] for name in ("mass", "stiffness", "point/tip"))
    assert tip @ np.linalg.solve(stiffness, tip) == pytest.approx(1 / 3, rel=1e-9)
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    assert np.sqrt(squares[:3]) == pytest.approx(RATIOS[:3], rel=1e-3)
    assert np.all(np.sqrt(squares[:3]) >= RATIOS[:3])


def test_coordinates_without_mass_are_condensed(tmp_path):
    """A massless node between two springs makes one spring of them."""
    np.savez(tmp_path / "s.npz", M=np.diag([2.0, 0.0]), K=np.array([[3.0, -3.0], [-3.0, 9.0]]))
    assert main([str(tmp_path / "s.npz"), "--point", "tip=1", "-o", str(tmp_path / "s.h5")]) == 0
    with h5py.File(tmp_path / "s.h5") as file:
        assert file["structure/mass"][:] == pytest.approx(np.array([[2.0]]))
        assert file["structure/stiffness"][:] == pytest.approx(np.array([[2.0]]))


def _impacts(separatrix, case, folder):
    out = succeed(separatrix, "trajectory", case, "-o", folder / "t.h5", "--force", folder=folder).out
    with h5py.File(folder / "t.h5") as file:
        return file["event_time"][:], file["event_v_before"][:], out


# Impact speeds by number of modes: clamped-free beam, 2 % damping, stop at 0.5, restitution 0.8.
SPEEDS = {1: 0.2205597811, 2: 0.3458546130, 3: 0.4537810705, 4: 0.5216891864, 8: 0.6541392525}


@pytest.mark.parametrize("modes", [1, 2, 3, 4, 8])
def test_beam_with_a_stop_by_its_modes(separatrix, modes, tmp_path):
    """The orbit with one impact a period, in closed form, and a flight from it.

    It is a motion for one mode only: with more the tip meets the stop earlier, where the program finds it,
    and its gap up to then is that of the formula.
    """
    omega, stop, restitution, zeta = 0.9, 0.5, 0.8, 0.02
    frequency = RATIOS[:modes] / RATIOS[0]
    tip = np.full(modes, 2.0)
    orbits = single_impact_orbits(
        np.eye(modes), np.diag(2 * zeta * frequency), np.diag(frequency**2), 0.05 * tip, omega, tip, stop,
        restitution,
    )  # fmt: skip
    speed, phase, after = min(orbits, key=lambda orbit: abs(orbit[0] - SPEEDS[modes]))
    assert speed == pytest.approx(SPEEDS[modes], abs=2e-9)
    with h5py.File(tmp_path / "beam.h5", "w") as file:
        group = file.create_group("structure")
        group["frequency"] = frequency
        group["frequency"].attrs["units"] = "rad/s"
        group["damping_ratio"] = np.full(modes, zeta)
        group["point/tip"] = tip
    more = f"x0 = {after[:modes].tolist()}\nv0 = {after[modes:].tolist()}\n"
    (tmp_path / "case.toml").write_text(
        CASE.format(
            file="beam.h5",
            more=more,
            stop=stop,
            force=0.05,
            omega=omega,
            x0=stop,
            v0=-restitution * speed,
            angle=phase,
        )  # fmt: skip
    )
    time, before, out = _impacts(separatrix, tmp_path / "case.toml", tmp_path)
    period = 2 * np.pi / omega
    assert ("a restitution does not converge with their number" in out) == (modes > 1)
    if modes == 1:
        assert time[0] == pytest.approx(period, abs=1e-9)
        assert before[0] == pytest.approx(speed, abs=1e-9)
        return
    # The first return of the closed form to the stop, sampled finely and refined.
    steady = 0.05 * tip / (frequency**2 - omega**2 + 2j * zeta * omega * frequency)
    decay, turn = zeta * frequency, frequency * np.sqrt(1 - zeta**2)
    own_x = after[:modes] - np.real(steady * np.exp(1j * phase))
    own_v = after[modes:] - np.real(1j * omega * steady * np.exp(1j * phase))

    def gap(t: float) -> float:
        wave = own_x * np.cos(turn * t) + (own_v + decay * own_x) / turn * np.sin(turn * t)
        return tip @ (np.exp(-decay * t) * wave + np.real(steady * np.exp(1j * (omega * t + phase)))) - stop

    assert gap(time[0]) == pytest.approx(0, abs=1e-10)
    assert max(gap(t) for t in np.linspace(1e-3, time[0] - 1e-3, 4000)) < 0
    assert time[0] < period - 0.1


def test_native_reduction_equals_the_converter(separatrix, matrices, tmp_path):
    """`modes = 3` of Matrix Market files flies as the reduced file does."""
    words = [
        *_mtx(tmp_path, *matrices),
        "--point",
        f"tip={2 * ELEMENTS - 1}",
        "--reduce",
        "modal",
        "--modes",
        "3",
    ]
    words += ["--damping-ratio", "0.02", "-o", tmp_path / "beam.h5"]
    assert main([str(word) for word in words]) == 0
    fill = {"stop": 0.05, "force": 0.2, "omega": 3.0, "x0": 0.0, "v0": 0.0, "angle": 0.0}
    (tmp_path / "one.toml").write_text(CASE.format(file="beam.h5", more="", **fill))
    native = CASE.format(file="", more="", **fill).replace(
        'file = ""',
        'mass = "mass.mtx"\nstiffness = "stiffness.mtx"\nmodes = 3\ndamping_ratio = 0.02\n'
        f"point.tip = {2 * ELEMENTS - 1}",
    )
    (tmp_path / "two.toml").write_text(native)
    one, two = (_impacts(separatrix, tmp_path / f"{name}.toml", tmp_path) for name in ("one", "two"))
    assert len(one[0]) > 5
    assert one[0][:6] == pytest.approx(two[0][:6], abs=1e-8)
    assert one[1][:6] == pytest.approx(two[1][:6], abs=1e-7)


GENERAL = """\
[structure.rig]
mass = {mass}
stiffness = {stiffness}
damping = {damping}
x0 = [0.0, 0.2, -0.1]
v0 = [0.3, 0.0, 0.1]
point = {{ left = 1, middle = [0.5, 0.5, 0], right = 3 }}
[drive.force]
law = "force"
body = "rig.middle"
amplitude = 0.7
frequency = 1.3
{more}
[start]
x0 = 0.0
v0 = 0.3
[run]
duration = 15
window = 5
[attractors]
max_period = 1
"""


def _trajectory(separatrix, folder, text):
    (folder / "case.toml").write_text(text)
    succeed(separatrix, "trajectory", folder / "case.toml", "-o", folder / "t.h5", "--force", folder=folder)
    with h5py.File(folder / "t.h5") as file:
        return {name: file[name][()] for name in file if isinstance(file[name], h5py.Dataset)}


def test_any_linear_structure_follows_its_equation(separatrix, tmp_path):
    """A free structure, overdamped modes and a damping matrix without any symmetry, against an integrator."""
    mass = np.array([[2, 0.3, 0], [0.3, 1, 0.1], [0, 0.1, 0.5]])
    stiffness = np.array([[3.0, -3, 0], [-3, 5, -2], [0, -2, 2]])
    damping = np.array([[0.4, 0.6, 0.0], [-0.6, 9.0, -0.2], [0.1, -0.3, 6.0]])
    text = GENERAL.format(
        mass=mass.tolist(), stiffness=stiffness.tolist(), damping=damping.ravel().tolist(), more=""
    )
    found = _trajectory(separatrix, tmp_path, text)
    row, inverse = np.array([0.5, 0.5, 0]), np.linalg.inv(mass)

    def rates(t, y):
        push = 0.7 * np.cos(1.3 * t) * row - damping @ y[3:] - stiffness @ y[:3]
        return np.concatenate([y[3:], inverse @ push])

    times = found["time"]
    flown = solve_ivp(
        rates, (0, times[-1]), [0.0, 0.2, -0.1, 0.3, 0.0, 0.1], "DOP853", times, rtol=1e-11, atol=1e-12
    )
    assert found["x"] == pytest.approx(flown.y[0], abs=1e-8)
    assert found["rig_left_x"] == pytest.approx(flown.y[0], abs=1e-8)
    assert found["rig_3_v"] == pytest.approx(flown.y[5], abs=1e-8)


def test_base_motion_of_a_point_and_friction_between_points(separatrix, tmp_path):
    """Friction between two points, one of whose motions is given; the same machine put together of bodies."""
    text = GENERAL.format(
        mass=np.diag([2.0, 1, 0.5]).tolist(),
        stiffness=[[3.0, -3, 0], [-3, 5, -2], [0, -2, 2]],
        damping=[0.3, -0.1, 0, -0.1, 0.3, -0.1, 0, -0.1, 0.2],
        more='[drive.base]\nlaw = "motion"\nbody = "rig.right"\namplitude = 0.4\n'
        '[friction.pad]\nbetween = ["rig.middle", "rig.right"]\nforce = 0.3',
    )
    found = _trajectory(separatrix, tmp_path, text)
    assert {"rig_left_x", "rig_2_x"} <= set(found)
    assert "rig_right_x" not in found
    balance = found["energy"] - found["drive_work"] + found["friction_loss"] + found["damping_loss"]
    assert balance == pytest.approx(np.full(len(balance), balance[0]), abs=1e-9)
    assert np.all(np.diff(found["friction_loss"]) >= -1e-12)
    # The same machine with bodies.
    bodies = """\
[body.one]
mass = 2
[body.two]
mass = 1
x0 = 0.2
[body.three]
mass = 0.5
[spring.a]
between = ["one", "two"]
stiffness = 3
damping = 0.1
[spring.b]
between = ["two", "three"]
stiffness = 2
damping = 0.1
[spring.c]
between = ["one"]
damping = 0.2
[spring.d]
between = ["two"]
damping = 0.1
[spring.e]
between = ["three"]
damping = 0.1
[drive.one]
law = "force"
body = "one"
amplitude = 0.35
frequency = 1.3
[drive.two]
law = "force"
body = "two"
amplitude = 0.35
[drive.base]
law = "motion"
body = "three"
amplitude = 0.4
"""
    tail = text[text.index("[start]") :]
    free = _trajectory(separatrix, tmp_path, text.replace("force = 0.3", "force = 0"))
    same = _trajectory(separatrix, tmp_path, bodies + tail)
    assert free["x"][:200] == pytest.approx(same["x"][:200], abs=1e-9)


def test_lists_have_axes_and_the_map_is_proved(separatrix, tmp_path):
    """A frequency of a structure is an axis; labels hold in quadruple precision."""
    (tmp_path / "case.toml").write_text(
        "[structure.beam]\nfrequency = [1.0, 6.27]\ndamping_ratio = 0.05\npoint.tip = [1.0, 1.0]\n"
        '[contact.stop]\nbetween = ["beam.tip"]\nlaw = "newton"\nrestitution = 0.6\nupper = 0.8\n'
        '[drive.force]\nlaw = "force"\nbody = "beam.tip"\namplitude = 1\nfrequency = 0.9\n'
        "[run]\nduration = 300\nwindow = 50\n[attractors]\nsample = 16\nmax_period = 4\n"
        '[[axis]]\nname = "x0"\nfrom = -1\nto = 0.5\ncount = 4\n'
        '[[axis]]\nname = "structure.beam.frequency[1]"\nfrom = 0.8\nto = 1.2\ncount = 3\n'
    )
    path = tmp_path / "map.h5"
    succeed(separatrix, "basin", tmp_path / "case.toml", "-o", path, folder=tmp_path)
    with h5py.File(path) as file:
        assert file["structure_beam_frequency_1"][:] == pytest.approx([0.8, 1.0, 1.2])
        assert len(np.unique(file["mean_impact_speed"][:].round(6))) == 3
    text = succeed(separatrix, "verify", path, "--sample", "4", folder=tmp_path).out
    assert "0 differ from the file" in text
    assert " 0 label flips" in text


def test_what_is_refused(separatrix, matrices, tmp_path):
    """File, key, what was found, what is allowed; 66 where a file is not there."""
    beam, case = tmp_path / "beam.h5", tmp_path / "case.toml"
    fill = {"stop": 0.5, "force": 0.05, "omega": 0.9, "x0": 0.0, "v0": 0.0, "angle": 0.0}

    def refused(expected, code=65, more="", file="beam.h5", change=("", "")):
        case.write_text(CASE.format(file=file, more=more, **fill).replace(*change))
        outcome = run(separatrix, "trajectory", case, "-o", tmp_path / "no.h5", folder=tmp_path)
        assert outcome.code == code, outcome.err
        assert "case.toml:" in outcome.err
        assert expected in outcome.err
        assert not (tmp_path / "no.h5").exists()

    def store(**content):
        with h5py.File(beam, "w") as file:
            for name, value in content.items():
                file[f"structure/{name.replace('__', '/')}"] = value

    refused("there is no file", code=66)
    beam.write_bytes(b"no structure at all\n")
    refused("is a text, allowed an HDF5 file")
    store(mass=np.eye(2), stiffness=np.eye(2), point__tip=[1.0, 0])
    whole = beam.read_bytes()
    for cut in (300, len(whole) // 2):
        beam.write_bytes(whole[:cut] + bytes(100))
        refused("key 'structure.beam.file'")
    store(mass=np.eye(2), stiffness=np.eye(3), point__tip=[1.0, 0])
    refused("/structure/stiffness: found 3 x 3 numbers, allowed 2 x 2")
    store(mass=np.diag([1.0, 0]), stiffness=np.eye(2), point__tip=[1.0, 0])
    refused("singular or indefinite mass matrix")
    store(mass=np.eye(2), stiffness=[[1.0, 0.5], [0.4, 1]], point__tip=[1.0, 0])
    refused("stiffness matrix that is not symmetric")
    store(mass=np.eye(2), stiffness=[[1.0, np.nan], [np.nan, 1]], point__tip=[1.0, 0])
    refused("/structure/stiffness: found a number that is not finite")
    store(mass=np.eye(2), stiffness=np.eye(2), point__tip=[1.0, 0, 0])
    refused("/structure/point/tip: found 3 numbers, allowed 2")
    store(frequency=[1.0, 2], damping_ratio=[0.1, -0.1], point__tip=[1.0, 0])
    refused("damping ratio below zero")
    store(frequency=np.arange(1.0, 71), point__tip=np.ones(70))
    refused("found 70 coordinates, allowed at most 64: modes = 64")
    refused("found 71, allowed at most the 70 there are", more="modes = 71")
    store(frequency=[1.0, 2], point__top=[1.0, 0])
    refused('found "beam.tip" (did you mean "beam.top"?)')
    store(frequency=[1.0, 2], point__tip=[1.0, 0])
    refused("found 3 numbers, allowed one for each of the 2 coordinates", more="x0 = [1, 2, 3]")
    refused("found beside a file", more="mass = [1]")
    refused('found "tup" (did you mean "tip"?)', more='point.end = "tup"')
    refused("unknown (did you mean 'modes'?)", more="mode = 3")
    _mtx(tmp_path, *matrices)
    native = ('file = ""', 'mass = "mass.mtx"\nstiffness = "stiffness.mtx"\nmodes = 3\npoint.tip = 1')
    text = (tmp_path / "mass.mtx").read_text()
    (tmp_path / "mass.mtx").write_text(text[: len(text) // 2])
    refused("mass.mtx:", file="", change=native)
    (tmp_path / "mass.mtx").write_text("%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1 0\n")
    refused("mass.mtx:1: found", file="", change=native)
    (tmp_path / "mass.mtx").unlink()
    refused("mass.mtx", code=66, file="", change=native)


def test_the_library_flies_what_the_program_flies(matrices, tmp_path, separatrix):
    """An HDF5 file, by its matrices and by its modes: the same bits from Python as from the program."""
    import separatrix as sx

    words = [*_mat(tmp_path, *matrices), "--point", f"tip_y={2 * ELEMENTS - 1}", "--reduce", "modal"]
    main([str(word) for word in [*words, "--modes", 3, "-o", tmp_path / "beam.h5"]])
    numbers = {"stop": 0.02, "force": 0.1, "omega": 0.9, "x0": 0.01, "v0": 0, "angle": 0}
    more = 'point.tip = "tip_y"\ndamping_ratio = 0.02'
    case = tmp_path / "case.toml"
    case.write_text(CASE.format(file="beam.h5", more=more, **numbers))
    succeed(separatrix, "trajectory", case, "-o", tmp_path / "motion.h5", folder=tmp_path)
    with h5py.File(tmp_path / "motion.h5") as file:
        position = file["x"][:]
    assert np.array_equal(sx.trajectory(case)["x"], position)
    softer = sx.load(case).with_({"structure.beam.damping_ratio": 0.05})
    assert not np.array_equal(sx.trajectory(softer)["x"], position)
    for file, found in (("none.h5", "no such file"), ("case.toml", "cannot be read as a structure file")):
        with pytest.raises(sx.CaseError, match=found) as refused:
            softer.with_({"structure.beam.file": file})
        assert "structure.beam.file" in str(refused.value)
