#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens result files with the readers of others that are installed; prints what each reads as a table.

    scripts/evidence/readers_check.py [--python PYTHON]... FILE...

Installs nothing. A reader has read a file if it gives every variable with values: of all groups, or of the
root where it knows no groups. A reader in Python may be in another environment: --python names its
interpreter. Exit code 1 if a reader lacks a variable of a file. The interpreter that runs the script needs
h5py, with which the others are compared.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

PYTHONS = (sys.executable, "/usr/bin/python3")


@dataclass(frozen=True)
class Reader:
    """A reader, the line with which a user opens a file, and how it is tried."""

    name: str
    line: str
    #: A module of Python, or a program.
    needs: str
    #: Returns the variables that were read of each file: paths without the first slash.
    read: Callable[[list[Path]], dict[str, list[str]]]
    #: Whether it knows groups, and whether it lists the coordinate variables.
    groups: bool = True
    coordinates: bool = True
    #: Option that prints the version of a program.
    version: str = "--version"

    @property
    def in_python(self) -> bool:
        """Whether it is a package of Python."""
        return self.read.__name__.startswith("_python")


# What runs in the interpreter that has the package: the variables of each file with all their values.


def _python_h5py(files: list[Path]) -> dict[str, list[str]]:
    import h5py

    found = {}
    for path in files:
        with h5py.File(path) as file:
            found[str(path)] = names = []
            file.visititems(
                lambda name, item, names=names: (
                    names.append(name) if isinstance(item, h5py.Dataset) and item[()] is not None else None
                )
            )
    return found


def _python_netcdf4(files: list[Path]) -> dict[str, list[str]]:
    import netCDF4

    def walk(group: object, before: str = "") -> list[str]:
        names = [before + name for name, variable in group.variables.items() if variable[...] is not None]
        return names + [
            name for key, inner in group.groups.items() for name in walk(inner, f"{before}{key}/")
        ]

    found = {}
    for path in files:
        with netCDF4.Dataset(path) as file:
            found[str(path)] = walk(file)
    return found


def _tree(tree: object) -> list[str]:
    return [
        f"{node.path}/{name}".lstrip("/")
        for node in tree.subtree
        for name in node.to_dataset(inherit=False).variables
    ]


def _datatrees(files: list[Path], engine: str) -> dict[str, list[str]]:
    import xarray as xr

    found = {}
    for path in files:
        with xr.open_datatree(path, engine=engine) as tree:
            found[str(path)] = _tree(tree.load())
    return found


def _python_h5netcdf(files: list[Path]) -> dict[str, list[str]]:
    return _datatrees(files, "h5netcdf")


def _python_xarray_netcdf4(files: list[Path]) -> dict[str, list[str]]:
    return _datatrees(files, "netcdf4")


def _python_virtualizarr(files: list[Path]) -> dict[str, list[str]]:
    from obspec_utils.registry import ObjectStoreRegistry
    from obstore.store import LocalStore
    from virtualizarr import open_virtual_datatree
    from virtualizarr.parsers import HDFParser

    registry, found = ObjectStoreRegistry({"file://": LocalStore()}), {}
    for path in files:
        url = path.resolve().as_uri()
        with open_virtual_datatree(url, registry=registry, parser=HDFParser()) as tree:
            found[str(path)] = _tree(tree)
    return found


def _python_kerchunk(files: list[Path]) -> dict[str, list[str]]:
    import xarray as xr
    from kerchunk.hdf import SingleHdf5ToZarr

    found = {}
    for path in files:
        references = SingleHdf5ToZarr(str(path)).translate()
        options = {"fo": references, "remote_protocol": "file"}
        with xr.open_dataset(
            "reference://", engine="zarr", mask_and_scale=False,
            backend_kwargs={"storage_options": options, "consolidated": False},
        ) as data:  # fmt: skip
            found[str(path)] = [str(name) for name in data.load().variables]
    return found


def _python_vtk(files: list[Path]) -> dict[str, list[str]]:
    import vtk

    vtk.vtkObject.GlobalWarningDisplayOff()
    found = {}
    for path in files:
        found[str(path)] = names = []
        reader = _vtk_reader(vtk, path)
        sets = [
            reader.GetAllDimensions().GetValue(i)
            for i in range(reader.GetAllDimensions().GetNumberOfValues())
        ]
        for dimensions in sets:
            reader = _vtk_reader(vtk, path)
            reader.SetDimensions(dimensions)
            reader.Update()
            output = reader.GetOutput()
            arrays = output.GetPointData()
            names += [arrays.GetArrayName(i) for i in range(arrays.GetNumberOfArrays())]
            bounds, extent = output.GetBounds(), output.GetExtent()
            for i, name in enumerate(reversed(re.findall(r"\w+", dimensions))):
                # without its coordinate variable an axis counts its points
                if bounds[2 * i : 2 * i + 2] != extent[2 * i : 2 * i + 2]:
                    names.append(name)
    return found


def _vtk_reader(vtk: object, path: Path) -> object:
    reader = vtk.vtkNetCDFCFReader()
    reader.SetFileName(str(path))
    reader.UpdateMetaData()
    return reader


# Programs.


def _run(*command: object) -> str:
    ended = subprocess.run([str(word) for word in command], capture_output=True, text=True, errors="replace")
    if ended.returncode != 0:
        raise RuntimeError(
            f"{command[0]}: exit code {ended.returncode}: {(ended.stderr or ended.stdout)[-300:]}"
        )
    return ended.stdout


def _listed(text: str) -> dict[str, list[str]]:
    """What Octave and R print: a file and a variable in each line, parted by a tab."""
    found: dict[str, list[str]] = {}
    for line in text.splitlines():
        if line.count("\t") == 1:
            path, name = line.split("\t")
            found.setdefault(path, []).append(name)
    return found


def _ncdump(files: list[Path]) -> dict[str, list[str]]:
    found = {}
    for path in files:
        text = _run("ncdump", path)
        if "NIL" in text:
            raise RuntimeError(f"{path}: a text is shown as NIL")
        found[str(path)] = names = []
        group = ""
        for line in text.splitlines():
            if begun := re.match(r"\s*group: (\w+) \{", line):
                group = f"{begun[1]}/"
            elif values := re.match(r"\s*(\w+) =(\s|$)", line):
                names.append(group + values[1])
    return found


def _ncks(files: list[Path]) -> dict[str, list[str]]:
    found = {}
    for path in files:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "copy.nc"
            _run("ncks", path, copy)
            found[str(path)] = (
                _ncdump([copy])[str(copy)] if shutil.which("ncdump") else _python_h5py([copy])[str(copy)]
            )
    return found


def _cdo(files: list[Path]) -> dict[str, list[str]]:
    found = {}
    for path in files:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "copy.nc"
            _run("cdo", "-s", "copy", path, copy)
            found[str(path)] = _run("cdo", "-s", "showname", copy).split()
    return found


def _h5dump(files: list[Path]) -> dict[str, list[str]]:
    found = {}
    for path in files:
        _run("h5dump", path)
        found[str(path)] = re.findall(r"^ dataset +/(\S+)", _run("h5dump", "-n", path), re.MULTILINE)
    return found


_OCTAVE = """\
function list(file, s, before)
  for [value, key] = s
    if isstruct(value)
      list(file, value, [before key "/"]);
    else
      printf("%s\\t%s%s\\n", file, before, key);
    end
  end
end
files = argv();
for i = 1:numel(files)
  list(files{i}, load(files{i}), "");
end
"""

_R = """\
library(ncdf4)
for (path in commandArgs(TRUE)) {
  file <- nc_open(path)
  for (name in names(file$var)) {
    values <- ncvar_get(file, name)
    cat(path, "\\t", name, "\\n", sep = "")
  }
  for (name in names(file$dim)) if (file$dim[[name]]$create_dimvar) cat(path, "\\t", name, "\\n", sep = "")
  nc_close(file)
}
"""


def _script(program: tuple[str, ...], text: str, suffix: str, files: list[Path]) -> dict[str, list[str]]:
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / f"list{suffix}"
        script.write_text(text)
        return _listed(_run(*program, script, *files))


def _octave(files: list[Path]) -> dict[str, list[str]]:
    return _script(("octave-cli", "--quiet", "--no-init-file"), _OCTAVE, ".m", files)


def _r(files: list[Path]) -> dict[str, list[str]]:
    return _script(("Rscript", "--vanilla"), _R, ".R", files)


READERS = (
    Reader("h5py", 'h5py.File("basin.h5")["regime"][()]', "h5py", _python_h5py),
    Reader("xarray with h5netcdf", 'xr.open_datatree("basin.h5", engine="h5netcdf")', "h5netcdf",
           _python_h5netcdf),
    Reader("xarray with netCDF4", 'xr.open_datatree("basin.h5", engine="netcdf4")', "netCDF4",
           _python_xarray_netcdf4),
    Reader("netCDF4", 'netCDF4.Dataset("basin.h5")["regime"][:]', "netCDF4", _python_netcdf4),
    Reader("h5dump", "h5dump -d /regime basin.h5", "h5dump", _h5dump),
    Reader("ncdump", "ncdump -v regime basin.h5", "ncdump", _ncdump, version=""),
    Reader("NCO", "ncks -v regime basin.h5", "ncks", _ncks),
    Reader("CDO", "cdo infon basin.h5", "cdo", _cdo, groups=False, coordinates=False),
    Reader("GNU Octave", 's = load("basin.h5"); imagesc(s.x0, s.v0, s.regime)', "octave-cli", _octave),
    Reader("R with ncdf4", 'ncdf4::ncvar_get(ncdf4::nc_open("basin.h5"), "regime")', "Rscript", _r),
    Reader("VTK, ParaView", 'reader = vtk.vtkNetCDFCFReader(); reader.SetFileName("basin.h5")', "vtk",
           _python_vtk, groups=False),
    Reader("VirtualiZarr", "open_virtual_datatree(url, registry=registry, parser=HDFParser())",
           "virtualizarr", _python_virtualizarr),
    Reader("kerchunk", 'xr.open_dataset("reference://", engine="zarr", mask_and_scale=False, ...)',
           "kerchunk", _python_kerchunk, groups=False),
)  # fmt: skip


def version(reader: Reader, pythons: tuple[str, ...] = PYTHONS) -> tuple[str, str] | None:
    """What runs the reader and its version; None where it is not installed."""
    if reader.in_python:
        for python in pythons:
            expression = "getattr(m, '__version__', None) or m.vtkVersion().GetVTKVersion()"
            code = f"import {reader.needs} as m; print({expression})"
            ended = subprocess.run([python, "-c", code], capture_output=True, text=True)
            if ended.returncode == 0:
                return python, ended.stdout.split()[-1]
        return None
    if shutil.which(reader.needs) is None:
        return None
    if (
        reader.needs == "Rscript"
        and subprocess.run(["Rscript", "-e", "library(ncdf4)"], capture_output=True).returncode
    ):
        return None
    ended = subprocess.run(
        [reader.needs, *([reader.version] if reader.version else [])], capture_output=True, text=True
    )
    number = re.search(r"\d+\.\d+(\.\d+)?", ended.stdout + ended.stderr)
    return reader.needs, number[0] if number else "?"


def expected(path: Path, reader: Reader) -> set[str]:
    """The variables of a file that have values and that the reader can know."""
    import h5py

    found = set()
    with h5py.File(path) as file:

        def note(name: str, item: object) -> None:
            if not isinstance(item, h5py.Dataset) or not item.size:
                return
            scale = item.attrs.get("CLASS") == b"DIMENSION_SCALE"
            bare = scale and item.attrs["NAME"].startswith(b"This is a netCDF dimension")
            if not (bare or ("/" in name and not reader.groups) or (scale and not reader.coordinates)):
                found.add(name)

        file.visititems(note)
    return found


def read(reader: Reader, runs_in: str, files: list[Path]) -> dict[str, list[str]]:
    """The variables that a reader gives of each file."""
    if not reader.in_python:
        return reader.read(files)
    return json.loads(_run(runs_in, __file__, "--inside", reader.name, *files).splitlines()[-1])


def missing(reader: Reader, runs_in: str, files: list[Path]) -> list[str]:
    """What a reader lacks of the files, empty where it reads all."""
    found = read(reader, runs_in, files)
    return [
        f"{path}: {', '.join(sorted(lacks))}"
        for path in files
        if (lacks := expected(path, reader) - set(found.get(str(path), [])))
    ]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument(
        "--python", action="append", default=[], help="an interpreter that has further readers"
    )
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.inside:
        reader = next(one for one in READERS if one.name == options.inside)
        print("\n" + json.dumps(reader.read(options.files)))
        return 0
    faults = 0
    print("| reader | version | files read | variables | the line |\n|---|---|---|---|---|")
    for reader in READERS:
        there = version(reader, (*options.python, *PYTHONS))
        if there is None:
            print(f"| {reader.name} | not installed | | | `{reader.line}` |")
            continue
        try:
            lacks = missing(reader, there[0], options.files)
        except RuntimeError as error:
            lacks = [str(error)] * len(options.files)
        faults += len(lacks)
        what = "all groups" if reader.groups else "root"
        count = len(options.files) - len(lacks)
        print(f"| {reader.name} | {there[1]} | {count} of {len(options.files)} | {what} | `{reader.line}` |")
        for line in dict.fromkeys(lacks):
            print(f"{reader.name}: {line}", file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
