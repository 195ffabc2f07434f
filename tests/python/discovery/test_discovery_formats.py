# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in the files of other programs hold the same numbers, and damaged ones are refused with words."""

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from separatrix.discovery.measured.records import read_record
from separatrix.errors import SeparatrixError

T = np.arange(300) / 200
X = 100 * np.sin(5 * T)
KEYS = {"units": "s, mm", "drive_ratio": 1.05}


def mat5(path: Path) -> None:
    savemat(path, {"t": T[:, None], "x": X, **KEYS, "note": "other"})


def in_a_structure(path: Path) -> None:
    savemat(path, {"record": {"t": T, "x": X, **KEYS}})


def mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"], file["x"], file["drive_ratio"] = T[None, :], X[None, :], np.array([[1.05]])
        text = file.create_dataset("units", data=np.array([[ord(c)] for c in KEYS["units"]], np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


def npz(path: Path) -> None:
    np.savez(path, t=T, x=X, **KEYS)


def uff(path: Path) -> None:
    pyuff = pytest.importorskip("pyuff")
    function = pyuff.prepare_58(
        binary=0, func_type=1, rsp_node=1, rsp_dir=1, ref_node=0, ref_dir=0, data=X, x=T,
        id1="sensor at the mass", id2="units: s, mm", id3="drive_ratio: 1.05", id4="", id5="",
        rsp_ent_name="NONE", ref_ent_name="NONE", abscissa_spacing=1, abscissa_spec_data_type=17,
        ordinate_spec_data_type=8, orddenom_spec_data_type=0, z_axis_spec_data_type=0, spec_data_type=8,
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(function, "overwrite")


def tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    channel = nptdms.ChannelObject("rig", "x", X, {"wf_increment": 1 / 200, "wf_start_offset": 0.0})
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([nptdms.RootObject(KEYS), channel])


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.mat", mat5),
        ("b.mat", in_a_structure),
        ("c.mat", mat73),
        ("d.npz", npz),
        ("e.uff", uff),
        ("f.tdms", tdms),
    ],
)
def test_every_format_gives_the_same_record(tmp_path, name, write):
    write(tmp_path / name)
    record = read_record(tmp_path / name)
    assert np.allclose(record.t, T, atol=1e-6)
    assert np.allclose(record.x, 1e-3 * X, atol=1e-6)
    assert record.header["drive_ratio"] == pytest.approx(1.05)


@pytest.mark.parametrize("ending", ["mat", "npz", "uff", "tdms"])
def test_damaged_files_are_refused(tmp_path, ending):
    path = tmp_path / f"broken.{ending}"
    path.write_bytes(b"MATLAB 5.0 MAT-file" + bytes(range(256)) * 3)
    with pytest.raises(SeparatrixError, match="broken"):
        read_record(path)


@pytest.mark.parametrize("share", [0.4, 0.9])
def test_a_file_that_was_cut_off_is_refused(tmp_path, share):
    np.savez_compressed(tmp_path / "whole.npz", t=T, x=X)
    whole = (tmp_path / "whole.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(SeparatrixError, match="cut"):
        read_record(tmp_path / "cut.npz")
    # the directory exists, but a member is damaged
    middle = len(whole) // 2
    (tmp_path / "bent.npz").write_bytes(whole[:middle] + b"\0" * 64 + whole[middle + 64 :])
    with pytest.raises(SeparatrixError, match="bent"):
        read_record(tmp_path / "bent.npz")


def test_a_missing_column_is_reported(tmp_path):
    np.savez(tmp_path / "a.npz", time=T, x=X)
    with pytest.raises(SeparatrixError, match=r"found time, x; 't' is missing of t, x\[, v, force, phi\]"):
        read_record(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", t=T, x=X[1:])
    with pytest.raises(SeparatrixError, match="not equally long \\(t 300, x 299\\)"):
        read_record(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", t=T, x=np.stack([X, X]))
    with pytest.raises(SeparatrixError, match="'x' is no list of numbers"):
        read_record(tmp_path / "c.npz")


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyuff", None)
    (tmp_path / "a.uff").write_text("    -1\n    58\n    -1\n")
    with pytest.raises(
        SeparatrixError, match=r"needs the package pyuff: pip install 'separatrix\[formats\]'"
    ):
        read_record(tmp_path / "a.uff")


def test_columns_of_hdf5_are_those_of_other_files(tmp_path):
    """F is the force, complex numbers are none, and times count from a date in any unit."""
    path = tmp_path / "a.h5"

    def written(**columns) -> Path:
        with h5py.File(path, "w") as file:
            for name, column in columns.items():
                file[name] = column
            file["t"].attrs["units"] = "nanoseconds since 2024-01-01 00:00:00"
        return path

    nanoseconds = (1e9 * T).astype("i8")
    record = read_record(written(t=nanoseconds, x=X, F=2 * X))
    assert np.allclose(record.t, T, atol=1e-9)
    assert np.allclose(record.force, 2 * X)
    with pytest.raises(SeparatrixError, match="a.h5: 'F' and 'force' are the same column"):
        read_record(written(t=nanoseconds, x=X, F=X, force=X))
    with pytest.raises(SeparatrixError, match="a.h5: 'x' is no list of numbers .*complex"):
        read_record(written(t=nanoseconds, x=X + 1j))
