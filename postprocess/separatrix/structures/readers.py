# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Matrices and modes out of the files that engineers' tools write.

Matrix Market (Ansys *EXPORT, MMF, and many others), Harwell-Boeing (Ansys HBMAT), Abaqus *MATRIX OUTPUT,
MATLAB .mat, NumPy, Nastran op4 (with pyYeti), universal files of modes, data set 55 (with pyuff).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy import io, sparse

from separatrix.errors import BAD_DATA, NO_INPUT, SeparatrixError
from separatrix.structures.content import Matrices, Modes

# Names of matrices in files that hold several, in the order in which they are looked for.
_USUAL = {
    "mass": ("mass", "M", "MAA", "MXX", "MGG", "Mr"),
    "stiffness": ("stiffness", "K", "KAA", "KXX", "KGG", "Kr"),
    "damping": ("damping", "C", "D", "BAA", "BXX", "BGG", "Cr"),
}
# What Abaqus adds to the stiffness of a coordinate that is held.
_HELD = 1e30
_NORMAL_MODE = 2


def read_matrices(
    files: Mapping[str, str | Path], names: Mapping[str, str] | None = None, both: str | Path | None = None
) -> Matrices:
    """Read `files` = {"mass": ..., "stiffness": ..., "damping": ...}, or all of them out of one file `both`.

    `names` says how a matrix is called in a file with several.
    """
    found, labels = {}, []
    for role in _USUAL:
        path = files.get(role) or both
        if path is None:
            continue
        matrix, own = _matrix(
            Path(path), role, (names or {}).get(role), required=role != "damping" or role in files
        )
        if matrix is None:
            continue
        if labels and own and own != labels:
            found = {key: _placed(value, labels, sorted_labels(labels, own)) for key, value in found.items()}
            matrix, labels = _placed(matrix, own, sorted_labels(labels, own)), sorted_labels(labels, own)
        found[role], labels = matrix, labels or own
    for role in ("mass", "stiffness"):
        if role not in found:
            raise SeparatrixError(f"no {role} matrix is given; see separatrix-structure --help")
    structure = Matrices(**found, labels=labels)
    # Abaqus holds by a very large stiffness.
    return structure.without(np.flatnonzero(structure.stiffness.diagonal() >= _HELD))


def sorted_labels(one: list[str], other: list[str]) -> list[str]:
    """Return the labels of both, by node and direction."""
    return sorted({*one, *other}, key=lambda label: tuple(int(part) for part in label.split(":")))


def _placed(matrix: sparse.csr_array, labels: list[str], wanted: list[str]) -> sparse.csr_array:
    """Put a matrix among more coordinates."""
    places = np.array([wanted.index(label) for label in labels])
    entries = sparse.coo_array(matrix)
    return sparse.csr_array(
        (entries.data, (places[entries.row], places[entries.col])), shape=(len(wanted), len(wanted))
    )


def _matrix(
    path: Path, role: str, name: str | None, required: bool
) -> tuple[sparse.csr_array | None, list[str]]:
    """Return a matrix and the labels of its coordinates, none where the file has no names."""
    if not path.is_file():
        raise SeparatrixError(f"{path}: there is no such file", NO_INPUT)
    suffix = path.suffix.lower()
    try:
        if suffix in (".mtx", ".mm"):
            if path.read_text(errors="replace")[:14].lower() == "%%matrixmarket":
                return sparse.csr_array(io.mmread(path)), []
            return _abaqus(path)
        if suffix in (".hb", ".rb", ".rsa", ".rua", ".matrix"):
            return sparse.csr_array(io.hb_read(path)), []
        if suffix in (".npy", ".npz"):
            return _numpy(path, role, name, required), []
        if suffix == ".mat":
            return _out_of(io.loadmat(path), path, role, name, required), []
        if suffix in (".op4", ".dat"):
            return _out_of(_op4(path), path, role, name, required), []
    except SeparatrixError:
        raise
    except Exception as error:
        raise SeparatrixError(f"{path}: cannot be read as {suffix}: {error}", BAD_DATA) from None
    raise SeparatrixError(
        f"{path}: found the ending '{suffix}', allowed .mtx, .hb, .rb, .mat, .npy, .npz, .op4", BAD_DATA
    )


def _out_of(
    content: Mapping[str, object], path: Path, role: str, name: str | None, required: bool
) -> sparse.csr_array | None:
    """Return the matrix of a role out of a file with several."""
    inside = [
        key
        for key, value in content.items()
        if not key.startswith("__") and (np.ndim(value) == 2 or sparse.issparse(value))
    ]
    usual = {key.lower(): key for key in inside}
    wanted = [name] if name else _USUAL[role]
    for key in wanted:
        if key.lower() in usual:
            return sparse.csr_array(content[usual[key.lower()]])
    if name or required:
        raise SeparatrixError(
            f"{path}: no {role} matrix named {' or '.join(wanted)}; found {', '.join(inside) or 'no matrix'} "
            f"(--names {role}=NAME)"
        )
    return None


def _numpy(path: Path, role: str, name: str | None, required: bool) -> sparse.csr_array | None:
    content = np.load(path)
    if isinstance(content, np.ndarray):
        return sparse.csr_array(content)
    return _out_of(dict(content), path, role, name, required)


def _op4(path: Path) -> Mapping[str, object]:
    """Read a Nastran op4 file, binary or text."""
    try:
        from pyyeti.nastran import op4
    except ImportError:
        raise SeparatrixError(f"{path}: op4 files need pyyeti: pip install pyyeti", BAD_DATA) from None
    return op4.read(str(path))


def _abaqus(path: Path) -> tuple[sparse.csr_array, list[str]]:
    """Read Abaqus *MATRIX OUTPUT, FORMAT=MATRIX INPUT: lines of node, direction, node, direction, number.

    One triangle or both; internal nodes have negative numbers.
    """
    rows = []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        words = [word.strip() for word in line.split(",") if word.strip()]
        if not words or line.startswith("*"):
            continue
        try:
            rows.append((int(words[0]), int(words[1]), int(words[2]), int(words[3]), float(words[4])))
        except (ValueError, IndexError):
            raise SeparatrixError(
                f"{path}:{number}: found '{line[:60]}', allowed a Matrix Market header, or lines of "
                "node, direction, node, direction, number (Abaqus *MATRIX OUTPUT, FORMAT=MATRIX INPUT)"
            ) from None
    if not rows:
        raise SeparatrixError(f"{path}: found no entry of a matrix")
    keys = sorted({(row[0], row[1]) for row in rows} | {(row[2], row[3]) for row in rows})
    places = {key: number for number, key in enumerate(keys)}
    entries: dict[tuple[int, int], float] = {}
    for row in rows:
        entries[places[row[:2]], places[row[2:4]]] = row[4]
    for (one, other), value in list(entries.items()):
        entries.setdefault((other, one), value)
    ones, others = zip(*entries, strict=True)
    matrix = sparse.csr_array((list(entries.values()), (ones, others)), shape=(len(keys), len(keys)))
    return matrix, [f"{node}:{direction}" for node, direction in keys]


def read_modes(path: str | Path) -> Modes:
    """Read the normal modes of a universal file, data sets 55; modal masses normalise the shapes."""
    path = Path(path)
    if not path.is_file():
        raise SeparatrixError(f"{path}: there is no such file", NO_INPUT)
    try:
        import pyuff
    except ImportError:
        raise SeparatrixError(f"{path}: universal files need pyuff: pip install pyuff", BAD_DATA) from None
    try:
        file = pyuff.UFF(str(path))
        kinds = file.get_set_types()
        sets = [file.read_sets(int(number)) for number in np.flatnonzero(np.asarray(kinds) == 55)]
    except Exception as error:
        raise SeparatrixError(f"{path}: cannot be read as a universal file: {error}", BAD_DATA) from None
    sets = [one for one in sets if one["analysis_type"] == _NORMAL_MODE]
    if not sets:
        raise SeparatrixError(f"{path}: found no data set 55 with a normal mode (analysis type 2)")
    sets.sort(key=lambda one: one["freq"])
    shapes: dict[str, list[float]] = {}
    for number, one in enumerate(sets):
        if not one["modal_m"] > 0:
            raise SeparatrixError(
                f"{path}: mode {number + 1}: found the modal mass {one['modal_m']}, allowed above 0"
            )
        for direction in "123456":
            values = one.get(f"r{direction}")
            if values is None:
                continue
            _put_shape(
                shapes, number, one["node_nums"], direction, _real(path, number, values), one["modal_m"]
            )
    rows = {key: np.array(values) for key, values in shapes.items() if len(values) == len(sets)}
    return Modes(
        np.array([one["freq"] for one in sets]),
        np.array([one["modal_damp_vis"] + one["modal_damp_his"] / 2 for one in sets]),
        shapes=rows,
    )


def _put_shape(
    shapes: dict[str, list[float]],
    number: int,
    nodes: np.ndarray,
    direction: str,
    values: np.ndarray,
    mass: float,
) -> None:
    """Append the values of one mode; a place that a mode lacks falls out later."""
    for node, value in zip(nodes, values, strict=True):
        column = shapes.setdefault(f"{int(node)}:{direction}", [])
        if len(column) == number:
            column.append(float(value) / np.sqrt(mass))


def _real(path: Path, number: int, values: np.ndarray) -> np.ndarray:
    """Return a shape without imaginary part; a truly complex one is refused."""
    values = np.asarray(values)
    if np.iscomplexobj(values):
        if np.abs(values.imag).max() > 1e-3 * np.abs(values).max():
            raise SeparatrixError(f"{path}: mode {number + 1} is complex, allowed real normal modes")
        values = values.real
    return values
