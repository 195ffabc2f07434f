# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of structures as real packages write them: read as they stand, or refused with what is allowed."""

import os
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest
from beams import cantilever
from scipy import io, sparse
from separatrix.errors import SeparatrixError
from separatrix.structures import read_matrices, read_modes
from separatrix.structures.cli import main
from separatrix.structures.harwell_boeing import read_harwell_boeing
from separatrix.structures.matrix_market import read_matrix_market
from separatrix.trial import read_apart

HEAD = "%%MatrixMarket matrix "
MASS, STIFFNESS = cantilever(4)


def _refused(read, path, *words):
    with pytest.raises(SeparatrixError) as refused:
        read(path)
    assert str(path) in str(refused.value)
    for word in words:
        assert word in str(refused.value), str(refused.value)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        (
            "coordinate real general\n% note\n\n2 2 3\n1 1 2.5D+03\n2 1 +1e-1\n2 2 -3\n",
            [[2500, 0], [0.1, -3]],
        ),
        ("Coordinate Double SYMMETRIC\r\n\t2 2 2\r\n1\t2 4.\r\n2 2 .5", [[0, 4], [4, 0.5]]),
        ("coordinate integer skew-symmetric\n2 2 1\n2 1 7\n", [[0, -7], [7, 0]]),
        ("array real general\n2 2\n1\n2\n3\n4", [[1, 3], [2, 4]]),
        ("array real symmetric\n2 2\n1\n2\n3\n% end\n", [[1, 2], [2, 3]]),
        ("array integer skew-symmetric\n2 2\n5\n", [[0, -5], [5, 0]]),
    ],
)
def test_matrix_market_of_every_kind(text, values, tmp_path):
    """What tests/config/test_matrix_market.pf asks of the program's reader."""
    (tmp_path / "a.mtx").write_bytes((HEAD + text).encode())
    assert read_matrix_market(tmp_path / "a.mtx").toarray().tolist() == values


TWO = "coordinate real general\n2 2 2\n1 1 5.0\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TWO + "2 2 3,25\n", ":4: found '2 2 3,25', allowed row, column and number"),
        *((TWO + row, f":4: found '{row}'") for row in ("2 2 /", "2*2 5.0", "2 2 5.0 6.0", "2,2,5.0", "2 2")),
        *((TWO + row, f":4: found '{row}'") for row in ("2 2 nan", "2 2 1e999", "2.0 2 1", "2 2 1_0")),
        (TWO + "3 1 1", ":4: found '3 1 1', allowed rows up to 2"),
        (TWO + "0 1 1", ":4: found '0 1 1', allowed rows up to 2"),
        (TWO + "1 1 5.0", ":4: found '1 1 5.0', this row and column again"),
        (TWO, ":2: found 1 entries after this line, allowed 2"),
        ("coordinate real symmetric\n2 2 2\n1 2 1\n2 1 1", "symmetric: one triangle is the whole"),
        ("coordinate real skew-symmetric\n2 2 1\n2 2 1", "on the diagonal of a skew-symmetric"),
        ("coordinate integer general\n1 1 1\n1 1 1.5", "whole, as the header states integer"),
        ("array real general\n2 2\n1 2\n3 4", ":3: found '1 2', allowed one number a line"),
        ("coordinate complex general\n1 1 1\n1 1 1 0", ":1: found"),
        ("coordinate pattern general\n1 1 1\n1 1", ":1: found"),
        ("coordinate real general more\n1 1 1\n1 1 1", ":1: found"),
        ("coordinate real general\n2*1 1\n1 1 1", ":2: found '2*1 1', allowed the numbers of rows"),
        ("coordinate real general\n", "the end of the file"),
        ("coordinate real general\n2 3 1\n1 1 1", "found 2 rows and 3 columns"),
        ("array real general\n1000000000 1000000000\n1", "found 1000000000 rows"),
    ],
)
def test_matrix_market_is_what_it_looks_like(text, message, tmp_path):
    """SciPy takes several of these for another matrix."""
    (tmp_path / "a.mtx").write_text(HEAD + text)
    _refused(read_matrix_market, tmp_path / "a.mtx", message, "allowed")


def _harwell_boeing(matrix, kind="RSA", letter="D", rhs=0):
    """The text of the lower triangle, numbers without a blank between them, as Fortran writes it."""
    matrix = sparse.csc_array(sparse.tril(matrix) if kind == "RSA" else matrix)
    matrix.sort_indices()

    def lines(words, count):
        return ["".join(words[at : at + count]) for at in range(0, len(words), count)]

    pointers = lines([f"{value + 1:6d}" for value in matrix.indptr], 13)
    rows = lines([f"{value + 1:6d}" for value in matrix.indices], 13)
    values = lines([f"{value: 20.12E}".replace("E", letter)[:20].rjust(20) for value in matrix.data], 4)
    counts = [len(pointers), len(rows), len(values), rhs]
    size = matrix.shape[0]
    return [
        f"{'a beam':72}KEY",
        "".join(f"{value:14d}" for value in [sum(counts), *counts]),
        f"{kind:14}" + "".join(f"{value:14d}" for value in (size, size, matrix.nnz, 0)),
        f"{'(13I6)':16}{'(13I6)':16}{'(4D20.12)':20}{'(4D20.12)':20}",
        *(["F              1             0"] if rhs else []),
        *pointers, *rows, *values, *["0.0"] * rhs,
    ]  # fmt: skip


def test_harwell_boeing_of_solvers(tmp_path):
    """RSA and RUA with D exponents and right-hand sides, as Ansys HBMAT writes; damage is found."""
    path = tmp_path / "k.matrix"
    for kind, letter, rhs in (("RSA", "D", 0), ("RUA", "E", 0), ("rsa", "d", 2)):
        lines = _harwell_boeing(STIFFNESS, kind.upper(), letter, rhs)
        path.write_text("\n".join(lines).replace(kind.upper(), kind) + "\n")
        assert read_harwell_boeing(path).toarray() == pytest.approx(STIFFNESS, rel=1e-12, abs=1e-9)
    lines = _harwell_boeing(STIFFNESS)
    for number, change, message in (
        (2, ("RSA", "CSA"), ":3: found the type 'CSA', allowed RSA"),
        (2, ("RSA", "PSA"), "allowed RSA"),
        (3, ("(4D20.12)", "(4A20)"), ":4: found the format '(4A20)', allowed"),
        (4, ("     1", "     2"), "column pointers"),
        (-1, ("D+", ",+"), f":{len(lines)}: found '"),
        (5, ("     1", "    99"), "found row 99 of column 1, allowed rows up to 8"),
        (5, ("     1", "     3"), "found row 3 of column 1, this row and column again"),
    ):
        text = [*lines]
        text[number] = text[number].replace(*change, 1)
        assert text != lines
        path.write_text("\n".join(text))
        _refused(read_harwell_boeing, path, message)
    path.write_text("\n".join(lines[:-1]))
    _refused(read_harwell_boeing, path, "found the end of the file")
    path.write_text("\n".join(lines)[:-1] + "\n")
    _refused(read_harwell_boeing, path, "characters of the line, allowed")
    # SciPy writes narrower columns
    io.hb_write(tmp_path / "k.hb", sparse.csc_matrix(STIFFNESS))
    text = (tmp_path / "k.hb").read_text().rstrip("\n")
    for end, cut in (("\n", 1), ("", 3)):
        path.write_text(text[:-cut] + end)
        _refused(read_harwell_boeing, path, "cut off")


def test_a_last_number_that_is_cut_off_is_refused(tmp_path):
    """Where the last line has no end and all numbers before have one length."""
    path = tmp_path / "k.mtx"
    rows = [f"{node},1, {node},1, {value:.15e}" for node, value in ((1, 2.0), (2, -3.0), (3, 2.0), (4, 5.0))]
    path.write_text("\n".join(rows))
    assert read_matrices({"mass": path, "stiffness": path}).mass.diagonal().tolist() == [2, -3, 2, 5]
    for cut in (1, 4, 10):
        path.write_text("\n".join(rows)[:-cut])
        with pytest.raises(SeparatrixError, match=r"k.mtx:4: found '4,1, 4,1, .*"):
            read_matrices({"mass": path, "stiffness": path})
    path.write_text("1,1, 1,1, 1000.0\n2,1, 2,1, 20.0\n3,1, 3,1, 5.0")
    assert read_matrices({"mass": path, "stiffness": path}).size == 3


def test_coordinates_without_mass_are_named(tmp_path, capsys):
    for name, nodes in (("m", (1, 2)), ("k", (1, 2, 3))):
        (tmp_path / f"{name}.mtx").write_text("".join(f"{node},1, {node},1, 2.0\n" for node in nodes))
    words = ["--mass", f"{tmp_path}/m.mtx", "--stiffness", f"{tmp_path}/k.mtx", "--point", "tip=1:1"]
    assert main([*words, "-o", str(tmp_path / "o.h5")]) == 0
    assert "note: 1 of 3 coordinates without mass: 3:1" in capsys.readouterr().out


def test_modes_without_an_end_are_refused(tmp_path):
    whole = _modes(tmp_path / "a.unv", (1, 1.0, 1.0)).read_bytes()
    first = whole.index(b"    -1", 1)
    for cut, message in (
        (whole[: len(whole) - 30], "has no end"),
        (whole[:first] + whole[whole.index(b"    -1", first + 1) :], "allowed an even number"),
    ):
        (tmp_path / "cut.unv").write_bytes(cut)
        _refused(read_modes, tmp_path / "cut.unv", message)


def _mat73(path, content):
    """A file as MATLAB 7.3 writes it: transposed, sparse matrices and structures as groups."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in content.items():
            if sparse.issparse(value):
                value = sparse.csc_array(value)
                group = file.create_group(name)
                group.attrs["MATLAB_sparse"] = np.uint64(value.shape[0])
                group["data"], group["ir"], group["jc"] = value.data, value.indices, value.indptr
            else:
                file[name] = np.asarray(value).T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


def _same(structure):
    assert structure.mass.toarray() == pytest.approx(MASS)
    assert structure.stiffness.toarray() == pytest.approx(STIFFNESS)


def test_matlab_files_of_every_kind(tmp_path):
    """Version 7.3, dense and sparse; a structure that holds K and M; two of them by their names."""
    path = tmp_path / "m.mat"
    _mat73(path, {"M": MASS, "K": sparse.csc_array(STIFFNESS)})
    _same(read_matrices({}, both=path))
    _mat73(path, {"model/M": MASS, "model/K": STIFFNESS, "t": np.arange(3.0)})
    _same(read_matrices({}, both=path))
    io.savemat(path, {"model": {"M": sparse.csc_array(MASS), "K": STIFFNESS, "name": "beam"}})
    _same(read_matrices({}, both=path))
    io.savemat(path, {"one": {"M": MASS, "K": STIFFNESS}, "two": {"M": MASS, "K": 2 * STIFFNESS}})
    with pytest.raises(SeparatrixError, match=r"found one.M, two.M, allowed one mass matrix"):
        read_matrices({}, both=path)
    _same(read_matrices({}, {"mass": "one.M", "stiffness": "one.K"}, path))
    io.savemat(path, {"M": MASS, "K": STIFFNESS + 1j})
    with pytest.raises(SeparatrixError, match="'K': found complex numbers"):
        read_matrices({}, both=path)


def test_sparse_files_of_scipy(tmp_path):
    """Every layout of save_npz; one matrix alone does for no structure."""
    files = {"mass": tmp_path / "m.npz", "stiffness": tmp_path / "k.npz"}
    sparse.save_npz(files["mass"], sparse.csr_array(MASS))
    for layout in ("csr", "csc", "coo", "dia", "bsr"):
        sparse.save_npz(files["stiffness"], sparse.coo_array(STIFFNESS).asformat(layout))
        _same(read_matrices(files))
    bad = sparse.csr_array(MASS)
    bad.indices[3] = 1000
    sparse.save_npz(files["mass"], bad)
    with pytest.raises(SeparatrixError, match=r"m.npz"):
        read_matrices(files)


def _calculix(folder, labels):
    """job.sti, job.mas and job.dof: one triangle, column by column."""
    for end, matrix in (("sti", STIFFNESS), ("mas", MASS)):
        rows = [f"{i + 1} {j + 1} {matrix[i, j]:20.13e}\n" for j in range(len(matrix)) for i in range(j + 1)]
        (folder / f"job.{end}").write_text("".join(rows))
    (folder / "job.dof").write_text("".join(f"{label}\n" for label in labels))
    return folder / "job.sti"


def test_calculix(tmp_path, capsys):
    """Three files of one name; a label that comes back is no point."""
    labels = [f"{node}.{direction}" for node in (3, 7, 9, 12) for direction in (2, 6)]
    path = _calculix(tmp_path, labels)
    structure = read_matrices({}, both=path)
    _same(structure)
    assert structure.labels == [label.replace(".", ":") for label in labels]
    words = ["--point", "tip=12:y", "--reduce", "modal", "--modes", "3", "-o", str(tmp_path / "o.h5")]
    assert main(["--mass", str(path.with_suffix(".mas")), "--stiffness", str(path), *words]) == 0
    _calculix(tmp_path, [*labels[:-2], "12.2", "12.2"])
    capsys.readouterr()
    assert main([str(path), *words, "--force"]) == 65
    assert "found 2 coordinates with the label '12:2'" in capsys.readouterr().err
    _calculix(tmp_path, labels[:4])
    with pytest.raises(SeparatrixError, match="found 8 coordinates, allowed 4"):
        read_matrices({}, both=path)
    _calculix(tmp_path, ["x.1", *labels[1:]])
    with pytest.raises(SeparatrixError, match=r"job.dof:1: found 'x.1', allowed NODE.DIRECTION"):
        read_matrices({}, both=path)


def test_one_matrix_is_not_taken_for_two(tmp_path, capsys):
    """A file of one matrix holds none of the others; what is wrong with it names the file."""
    io.mmwrite(tmp_path / "k.mtx", STIFFNESS)
    sparse.save_npz(tmp_path / "k.npz", sparse.csr_array(STIFFNESS))
    for name in ("k.mtx", "k.npz"):
        with pytest.raises(SeparatrixError, match=f"{name}: holds one matrix, allowed with --mass"):
            read_matrices({}, both=tmp_path / name)
    np.savez(tmp_path / "s.npz", M=MASS, K=np.triu(STIFFNESS))
    words = ["--point", "tip=1", "-o", str(tmp_path / "o.h5")]
    assert main([str(tmp_path / "s.npz"), *words]) == 65
    assert f"{tmp_path / 's.npz'}: stiffness: found a matrix that is not symmetric" in capsys.readouterr().err
    np.savez(tmp_path / "s.npz", M=np.zeros((0, 0)), K=np.zeros((0, 0)))
    assert main([str(tmp_path / "s.npz"), *words]) == 65
    np.savez(tmp_path / "s.npz", M=1e200 * MASS, K=STIFFNESS)
    assert main([str(tmp_path / "s.npz"), *words]) == 65


def test_damaged_files_are_refused_with_their_name(tmp_path, capsys):
    """Changed bytes at every offset: read, or code 65 with the file; readers that crash do so elsewhere."""
    path = tmp_path / "s.mat"
    io.savemat(path, {"M": MASS, "K": sparse.csc_array(STIFFNESS)})
    whole = path.read_bytes()
    words = ["--point", "tip=1", "-o", str(tmp_path / "o.h5"), "--force"]
    for offset in range(128, 160 + len(whole) // 2, len(whole) // 12):
        path.write_bytes(whole[:offset] + bytes([255, 0, 7]) + whole[offset + 3 :])
        assert main([str(path), *words]) in (0, 65)
        output = capsys.readouterr().err
        assert not output or str(path) in output
    with pytest.raises(SeparatrixError, match="the reader of structure files crashes in it"):
        read_apart(path, "structure", lambda: os.kill(os.getpid(), signal.SIGSEGV))
    with pytest.raises(
        SeparatrixError, match=r"s.mat: not a structure file that can be read: IndexError: no list"
    ):
        read_apart(path, "structure", lambda: _raise(IndexError("no list")))
    assert read_apart(path, "structure", lambda: {"a": 1}) == {"a": 1}


def _raise(error):
    raise error


def test_limits_of_the_session_are_no_damage(tmp_path):
    """A hard limit of memory or time, as clusters set it, cannot be raised; files are read within it."""
    code = (
        "import resource; from separatrix.trial import read_apart\n"
        "for what, most in ((resource.RLIMIT_AS, 8 << 30), (resource.RLIMIT_CPU, 15)):\n"
        "    resource.setrlimit(what, (most, most))\n"
        "assert read_apart(__import__('sys').argv[1], 'text', lambda: 3) == 3\n"
    )
    (tmp_path / "a.txt").write_text("3")
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "a.txt"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with pytest.raises(SeparatrixError, match=r"a.txt: not enough memory to read it"):
        read_apart(tmp_path / "a.txt", "text", lambda: _raise(MemoryError()))


def test_what_is_not_read_is_answered_with_what_is(tmp_path):
    """The list of formats, for an ending and for a content of another kind."""
    (tmp_path / "k.full").write_bytes(b"\0" * 100)
    with pytest.raises(SeparatrixError, match=r"'.full', allowed Matrix Market .*CalculiX .sti"):
        read_matrices({"mass": tmp_path / "k.full"})
    (tmp_path / "k.mtx").write_text("<html>\n")
    with pytest.raises(SeparatrixError, match=r"k.mtx:1: found '<html>', allowed a Matrix Market header"):
        read_matrices({"mass": tmp_path / "k.mtx"})
    (tmp_path / "k.mtx").write_text("1,1, 1,1, 2,75\n")
    with pytest.raises(SeparatrixError, match=r"k.mtx:1: found '1,1, 1,1, 2,75'"):
        read_matrices({"mass": tmp_path / "k.mtx"})


def _modes(path, units=None, **changes):
    pyuff = pytest.importorskip("pyuff")
    sets = []
    if units:
        code, length, force = units
        sets.append(
            pyuff.prepare_164(
                units_code=code, units_description="stated", temp_mode=1, length=length, force=force,
                temp=1.0, temp_offset=0.0,
            )
        )  # fmt: skip
    none = np.zeros(2)
    sets.append(
        pyuff.prepare_55(
            **dict(
                model_type=1, id1="a", id2="b", id3="c", id4="d", id5="e", analysis_type=2, data_ch=2,
                spec_data_type=8, data_type=2, load_case=1, mode_n=1, freq=10.0, modal_m=4.0,
                modal_damp_vis=0.01, modal_damp_his=0.0, node_nums=[7, 8], r1=none, r2=np.array([0.5, 1.0]),
                r3=none, r4=none, r5=none, r6=np.array([2.0, 3.0]),
            ) | changes
        )
    )  # fmt: skip
    for number, one in enumerate(sets):
        pyuff.UFF(str(path)).write_sets(one, "add" if number else "overwrite")
    return path


def test_units_of_a_universal_file_count(tmp_path):
    """The same modes in m and N and in mm and N, where masses are tonnes: 1 kg is 0.001 N s^2/mm."""
    path = tmp_path / "modes.unv"
    metres = read_modes(_modes(path))
    assert metres.shapes["8:2"] == pytest.approx([0.5])
    mm = read_modes(_modes(path, (9, 1000.0, 1.0), modal_m=0.004))
    for point, row in metres.shapes.items():
        # a rotation comes with a mass of tonnes mm^2 where its amplitude is one of radians
        assert mm.shapes[point] == pytest.approx(row * (1 if point.endswith(":2") else 1000))
    for change, message in (
        ({"units": (9, 0.0, 1.0)}, "data set 164: found the factors 0 of length"),
        ({"units": (1, 3.2808, 0.2248)}, "of force with the units code 1, allowed 1 and 1"),
        ({"spec_data_type": 12}, "found shapes of the specific data type 12, allowed displacement"),
        ({"modal_m": 0.0}, "found the modal mass 0.0, allowed above 0"),
        ({"node_nums": [7, 7]}, "found a node twice"),
    ):
        _refused(read_modes, _modes(path, **change), message)
