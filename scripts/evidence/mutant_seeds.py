# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Good inputs of every reader, small and soon computed, which scripts/evidence/mutants changes."""

import importlib.util
import json
import re
import shutil
import subprocess
from pathlib import Path

import h5py
import mutant_cases
import numpy as np
from program import CASE, STARTS, make_results
from scipy import io, sparse
from scipy.io import savemat, wavfile

ROOT = Path(__file__).resolve().parents[2]
#: What a case needs to be run in no time.
_SMALL = {"count": 3, "sample": 3, "samples": 3, "searches": 2, "periods": 20}
_LONGEST = 30
_BLOCK = re.compile(r"^```toml\n(.*?)^```", re.DOTALL | re.MULTILINE)
T = np.arange(240) / 60
X = 0.4 + 0.1 * np.sin(7.5 * T)
STIFFNESS = np.array([[3.0, -1.0, 0.0], [-1.0, 2.0, -0.5], [0.0, -0.5, 4.0]])
MASS = np.diag([1.0, 2.0, 0.5])


def cases(folder: Path) -> list[Path]:
    """Write the examples and the cases of the documents with few points and short runs."""
    texts = {
        f"{path.parent.name}_{path.name}": path.read_text() for path in (ROOT / "examples").rglob("*.toml")
    }
    for path in (ROOT / "docs").rglob("*.md"):
        for number, block in enumerate(_BLOCK.findall(path.read_text())):
            texts[f"page_{path.parent.name}_{path.stem}_{number}.toml"] = block
    texts |= {f"{name}.toml": text for name, text in mutant_cases.cases().items()}
    found = []
    for name, text in sorted(texts.items()):
        found.append(folder / name)
        found[-1].write_text(_small(text))
    found.append(folder / "plain.toml")
    found[-1].write_text(CASE.replace("count = 19", "count = 3").replace("count = 31", "count = 3"))
    return found


def _small(text: str) -> str:
    """Return a case with few points and a short run."""
    for key, value in _SMALL.items():
        text = re.sub(rf"(?m)^(\s*{key}\s*=\s*)\d+", rf"\g<1>{value}", text)
    text = re.sub(r"(count = )\d+", r"\g<1>3", text)
    return re.sub(
        r"(?m)^(\s*duration\s*=\s*)([\d.]+)", lambda m: m[1] + str(min(float(m[2]), _LONGEST)), text
    )


def accepted(program: Path, paths: list[Path]) -> dict[str, list[str]]:
    """Return the cases that each command accepts; they are tried once."""
    known = paths[0].parent / "accepted.json"
    if known.exists():
        return json.loads(known.read_text())
    found: dict[str, list[str]] = {}
    for name in ("basin", "trajectory", "sweep", "stability", "branches"):
        more = ["--parameter", "drive.ratio"] if name == "branches" else []
        for path in paths:
            command = [program, name, path.name, *more, "--validate", "-q"]
            if subprocess.run(command, cwd=path.parent, capture_output=True).returncode == 0:
                found.setdefault(name, []).append(path.read_text())
    known.write_text(json.dumps(found))
    return found


def starts(folder: Path) -> list[Path]:
    """Write lists of initial conditions."""
    plain, several = folder / "starts.csv", folder / "more.csv"
    plain.write_text(STARTS)
    several.write_text("# starts\nx0;v0\n" + "\n".join(f"{0.1 * i};{i - 2}" for i in range(5)) + "\n")
    return [plain, several]


def matrices(folder: Path) -> list[list[Path]]:
    """Write a structure in every format; each entry lists the files of one structure."""
    found = []
    pair = [folder / "mass.mtx", folder / "stiffness.mtx"]
    for path, matrix in zip(pair, (MASS, STIFFNESS), strict=True):
        io.mmwrite(path, sparse.coo_array(matrix), symmetry="symmetric")
    found.append(pair)
    boeing = [folder / "mass.hb", folder / "stiffness.hb"]
    for path, matrix in zip(boeing, (MASS, STIFFNESS), strict=True):
        io.hb_write(path, sparse.csc_matrix(matrix))
    found.append(boeing)
    found.append([folder / "both.mat"])
    savemat(found[-1][0], {"M": MASS, "K": sparse.csc_array(STIFFNESS)}, do_compression=True)
    found.append([folder / "plain.mat"])
    savemat(found[-1][0], {"model": {"M": MASS, "K": STIFFNESS, "name": "beam"}})
    found.append([folder / "both.npz"])
    np.savez(found[-1][0], M=MASS, K=STIFFNESS)
    found.append([folder / "modes.uff"])
    _modes(found[-1][0])
    return found


def _modes(path: Path) -> None:
    import pyuff

    for mode, frequency in enumerate((10.0, 25.0)):
        shape = np.array([0.5, 1.0]) * (1 + mode)
        pyuff.UFF(str(path)).write_sets(
            pyuff.prepare_55(
                model_type=1, id1="a", id2="b", id3="c", id4="d", id5="e", analysis_type=2, data_ch=2,
                spec_data_type=8, data_type=2, load_case=1, mode_n=mode + 1, freq=frequency, modal_m=1.0,
                modal_damp_vis=0.01, modal_damp_his=0.0, node_nums=[7, 8],
                r1=0 * shape, r2=shape, r3=0 * shape, r4=0 * shape, r5=0 * shape, r6=0 * shape,
            ),
            "add" if mode else "overwrite",
        )  # fmt: skip


def records(folder: Path) -> list[Path]:
    """Write one measured record in every format."""
    head = "# units: s, m\n# drive_ratio: 1.2\n# sensor: laser\n"
    rows = [f"{t:.9g},{x:.9g}" for t, x in zip(T, X, strict=True)]
    (folder / "a.csv").write_text(head + "t,x\n" + "\n".join(rows) + "\n")
    forces = [f"{row},{np.cos(i):.6g}" for i, row in enumerate(rows)]
    (folder / "force.csv").write_text(head + "t,x,force\n" + "\n".join(forces) + "\n")
    commas = [row.replace(",", ";").replace(".", ",") for row in rows]
    (folder / "b.csv").write_text("t [s];x [m]\n" + "\n".join(commas) + "\n")
    with h5py.File(folder / "a.h5", "w") as file:
        file["t"], file["x"], file.attrs["units"], file.attrs["drive_ratio"] = T, X, "s, m", 1.2
    savemat(folder / "a.mat", {"t": T[:, None], "x": X, "units": "s, m", "drive_ratio": 1.2})
    savemat(folder / "b.mat", {"record": {"t": T, "x": X}, "note": "a"}, do_compression=True)
    with h5py.File(folder / "c.mat", "w", userblock_size=512) as file:
        file["t"], file["x"] = T[None, :], X[None, :]
    with (folder / "c.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")
    np.savez_compressed(folder / "a.npz", t=T, x=X, units="s, m")
    wavfile.write(folder / "a.wav", 60, (1e4 * X).astype("i2"))
    test = _module("tests/python/discovery/test_discovery_instruments.py")
    test.lvm(folder / "a.lvm", "One")
    formats = _module("tests/python/discovery/test_discovery_formats.py")
    formats.uff(folder / "a.uff")
    formats.tdms(folder / "a.tdms")
    if importlib.util.find_spec("asammdf"):
        test.mdf(folder / "a.mf4", [("x", test.X, test.T, "mm", {})])
    return sorted(path for path in folder.iterdir() if path.is_file())


def _module(path: str) -> object:
    """Return a module of the tests, whose functions write files of other programs."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def results(program: Path, folder: Path) -> list[Path]:
    """Make a small result of every kind, once."""
    work = folder / "work"
    if not work.exists():
        work.mkdir()
        for kind, path in make_results(program, work).items():
            shutil.copy(path, folder / f"{kind}.h5")
    return sorted(folder.glob("*.h5"))
