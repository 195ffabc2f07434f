# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured records: columns t, x [, v, a, force, phi] from CSV or HDF5, in SI units, checked row by row."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import count, pairwise
from pathlib import Path

import h5py
import numpy as np

from separatrix.errors import NO_INPUT, SeparatrixError
from separatrix.trial import try_first

CHANNELS = ("x", "v", "a", "force", "phi")
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "rad": 1.0, "deg": np.pi / 180, "mrad": 1e-3}
_NUMBERS = {
    "sampling_rate_hz",
    "sensor_noise_sigma_m",
    "sensor_noise_sigma_m_s",
    "sensor_resolution_m",
    "sensor_delay_s",
    "drive_ratio",
    "drive_frequency_rad_s",
    "drive_scale",
    "x0_m",
    "v0_m_s",
    "phase",
}
_FEWEST_SAMPLES = 60
_GAP = 1.5
_CLIPPED_RUN = 5
_CLIPPED_SHARE = 0.02
# likeness of a header key to a known one that makes it a misspelling
_NEAR = 0.7
# steps to and from a sample, over the usual largest ones and over all others, that no motion makes
_SPIKE = (5.0, 3.0)
_MOST_SPIKES = 3


@dataclass
class Record:
    """One record in SI units; `pieces` are the stretches without gaps as (first, last + 1)."""

    name: str
    t: np.ndarray
    x: np.ndarray
    v: np.ndarray | None = None
    a: np.ndarray | None = None
    force: np.ndarray | None = None
    phi: np.ndarray | None = None
    header: dict[str, float] = field(default_factory=dict)
    pieces: list[tuple[int, int]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    # as it was given
    file: str = ""

    @property
    def interval(self) -> float:
        """The usual time between samples [s]."""
        return float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])


def read_record(path: Path, at_rest: bool = False) -> Record:
    """Read and check one record; whatever is wrong is refused with file, row and reason.

    `at_rest`: of a body that does not move, whose positions may all be the same.
    """
    path = Path(path)
    if not path.is_file():
        raise SeparatrixError(f"{path}: no such file", NO_INPUT)
    with path.open("rb") as file:
        is_hdf5 = file.read(8) == b"\x89HDF\r\n\x1a\n"
    header, columns, first_row = _read_hdf5(path) if is_hdf5 else _read_csv(path)
    return _checked(path, header, columns, first_row, at_rest)


def make_record(
    name: str, columns: dict[str, np.ndarray], header: dict | None = None, at_rest: bool = False
) -> Record:
    """Check arrays that did not come from a file as if they had."""
    texts = {key: str(value) for key, value in (header or {}).items()}
    return _checked(Path(name), texts, columns, None, at_rest)


def _read_csv(path: Path) -> tuple[dict[str, str], dict[str, np.ndarray], int]:
    header: dict[str, str] = {}
    names: list[str] | None = None
    rows: list[list[float]] = []
    first_row = 0
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise SeparatrixError(f"{path}: neither HDF5 nor text: {error.reason}") from None
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text:
            continue
        if text.startswith("#"):
            key, colon, value = text[1:].partition(":")
            if colon:
                header[key.strip()] = value.strip()
        elif names is None:
            names = _names(path, number, text)
        else:
            first_row = first_row or number
            rows.append(_numbers(path, number, text, names))
    if names is None or not rows:
        raise SeparatrixError(f"{path}: no samples; expected a header row 't,x' and rows of numbers")
    table = np.array(rows)
    return header, {name: table[:, i].copy() for i, name in enumerate(names)}, first_row


def _names(path: Path, number: int, text: str) -> list[str]:
    names = [name.strip() for name in text.split(",")]
    if "t" not in names or "x" not in names:
        raise SeparatrixError(
            f"{path}:{number}: found the header row '{text}', expected 't,x[,v,a,force,phi]'"
        )
    if len(set(names)) != len(names):
        raise SeparatrixError(f"{path}:{number}: a column is named twice in '{text}'")
    return names


def _numbers(path: Path, number: int, text: str, names: list[str]) -> list[float]:
    words = text.split(",")
    if len(words) != len(names):
        raise SeparatrixError(f"{path}:{number}: {len(words)} values for {len(names)} columns")
    try:
        return [float(word) for word in words]
    except ValueError:
        raise SeparatrixError(f"{path}:{number}: '{text}' is not a row of numbers") from None


def _read_hdf5(path: Path) -> tuple[dict[str, str], dict[str, np.ndarray], None]:
    try_first(path, lambda: _texts(h5py.File(path)))
    try:
        with h5py.File(path) as file:
            header, units = _texts(file)
            columns = {
                name: np.asarray(file[name][()], float)
                for name in ("t", *CHANNELS)
                if isinstance(file.get(name), h5py.Dataset)
            }
    except (ArithmeticError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError) as error:
        raise SeparatrixError(f"{path}: not a record that can be read: {error}") from None
    missing = [name for name in ("t", "x") if name not in columns]
    if missing:
        raise SeparatrixError(f"{path}: dataset '{missing[0]}' is missing")
    if len({column.shape for column in columns.values()}) != 1 or columns["t"].ndim != 1:
        raise SeparatrixError(f"{path}: the datasets are not equally long lists")
    if len(units) == 2:
        header.setdefault("units", ", ".join(units))
    return header, columns, None


def _texts(file: h5py.File) -> tuple[dict[str, str], list[str]]:
    header = {key: _text(value) for key, value in file.attrs.items()}
    found = [file[name].attrs for name in ("t", "x") if name in file]
    return header, [_text(attributes["units"]) for attributes in found if "units" in attributes]


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _checked(
    path: Path,
    header: dict[str, str],
    columns: dict[str, np.ndarray],
    first_row: int | None,
    at_rest: bool = False,
) -> Record:
    kept = np.arange(columns["t"].size)

    def where(row: int) -> str:
        return f"{path}, row {kept[row] + 1}" if first_row is None else f"{path}:{first_row + kept[row]}"

    warnings: list[str] = []
    numbers = _header_numbers(path, header)
    _doubt_header(header, numbers, warnings)
    _scale(path, header, columns, warnings)
    for name, column in columns.items():
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise SeparatrixError(f"{where(bad[0])}: '{name}' is {column[bad[0]]}; {bad.size} such values")
    t, x = columns["t"], columns["x"]
    if t.size < _FEWEST_SAMPLES:
        raise SeparatrixError(f"{path}: {t.size} samples, at least {_FEWEST_SAMPLES} are needed")
    steps = np.diff(t)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        row = int(back[0]) + 1
        raise SeparatrixError(
            f"{where(row)}: time does not increase ({t[row]:.9g} s after {t[row - 1]:.9g} s)"
        )
    if not at_rest:
        spikes = _spikes(x, where, warnings)
        kept = np.delete(kept, spikes)
        columns = {name: column[kept] for name, column in columns.items()}
        t, x = columns["t"], columns["x"]
        steps = np.diff(t)
    usual = float(np.median(steps))
    rate = numbers.get("sampling_rate_hz")
    if rate is not None and not 0.99 < rate * usual < 1.01:
        raise SeparatrixError(
            f"{path}: sampling_rate_hz is {rate:g}, t advances by {usual:.6g} s per row: wrong unit of time?"
        )
    pieces = _pieces(t, usual, where, warnings)
    if not at_rest:
        if np.ptp(x) == 0:
            raise SeparatrixError(f"{path}: 'x' is constant")
        _check_clipping(x, where, warnings)
    unknown = [name for name in columns if name not in ("t", *CHANNELS)]
    if unknown:
        warnings.append(f"columns that are not used: {', '.join(unknown)}")
    channels = {name: columns[name] for name in CHANNELS if name in columns}
    return Record(path.stem, t, header=numbers, pieces=pieces, warnings=warnings, file=str(path), **channels)


def _header_numbers(path: Path, header: dict[str, str]) -> dict[str, float]:
    numbers = {}
    for key in _NUMBERS & header.keys():
        try:
            numbers[key] = float(header[key])
        except ValueError:
            raise SeparatrixError(f"{path}: '{key}' is '{header[key]}', expected a number") from None
        if not np.isfinite(numbers[key]):
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}")
    for key in ("sampling_rate_hz", "drive_ratio", "drive_frequency_rad_s", "drive_scale"):
        if key in numbers and numbers[key] <= 0:
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}, expected more than 0")
    for key in ("sensor_noise_sigma_m", "sensor_noise_sigma_m_s", "sensor_resolution_m"):
        if key in numbers and numbers[key] < 0:
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}, expected at least 0")
    return numbers


def _doubt_header(header: dict[str, str], numbers: dict[str, float], warnings: list[str]) -> None:
    """Warn of keys that look like misspelt ones, and of an angle that looks like degrees."""
    known = sorted(_NUMBERS | {"units"})
    for key in header:
        near = [] if key in known else get_close_matches(key, known, 1, _NEAR)
        if near:
            warnings.append(f"header key '{key}' is not used: '{near[0]}'?")
    if abs(numbers.get("phase", 0.0)) > 2 * np.pi:
        warnings.append(f"phase is {numbers['phase']:g} rad, more than a turn: degrees?")


def _scale(path: Path, header: dict[str, str], columns: dict[str, np.ndarray], warnings: list[str]) -> None:
    """Turn time and position into s and m; the other channels and the header are in SI."""
    if "units" not in header:
        warnings.append("no 'units': read as s, m")
        return
    words = [word.strip() for word in header["units"].split(",")]
    if len(words) < 2 or words[0] not in _TIME or words[1] not in _LENGTH:
        raise SeparatrixError(
            f"{path}: units '{header['units']}', expected one of {', '.join(_TIME)} and one of "
            f"{', '.join(_LENGTH)}"
        )
    columns["t"] = columns["t"] * _TIME[words[0]]
    columns["x"] = columns["x"] * _LENGTH[words[1]]


def _pieces(t: np.ndarray, usual: float, where, warnings: list[str]) -> list[tuple[int, int]]:
    gaps = np.flatnonzero(np.diff(t) > _GAP * usual) + 1
    for row in gaps[:3]:
        warnings.append(f"{where(row)}: gap of {t[row] - t[row - 1]:.4g} s; nothing is fitted across it")
    if gaps.size > 3:
        warnings.append(f"{gaps.size - 3} more gaps")
    edges = [0, *gaps.tolist(), t.size]
    return list(pairwise(edges))


def _spikes(x: np.ndarray, where, warnings: list[str]) -> np.ndarray:
    """Rows of single samples that lie where no motion leads."""
    steps = np.diff(x)
    size = np.minimum(np.abs(steps[:-1]), np.abs(steps[1:]))
    usual = max(float(np.quantile(np.abs(steps), 0.9)), resolution_of(x))
    rows = np.flatnonzero((steps[:-1] * steps[1:] < 0) & (size > _SPIKE[0] * usual)) + 1
    others = np.abs(np.delete(steps, np.union1d(rows - 1, rows)))
    rows = rows[size[rows - 1] > _SPIKE[1] * others.max(initial=0.0)]
    said = [
        f"{where(row)}: x is {x[row]:.6g} m between {x[row - 1]:.6g} and {x[row + 1]:.6g} m" for row in rows
    ]
    if rows.size > _MOST_SPIKES:
        raise SeparatrixError(f"{said[0]}; {rows.size} such samples: clean the record")
    warnings += [f"{text}: left out" for text in said]
    return rows


def _check_clipping(x: np.ndarray, where, warnings: list[str]) -> None:
    """Runs of exactly the extreme value; a coarse resolution makes such runs by itself."""
    grid = resolution_of(x)
    for name, extreme in (("largest", x.max()), ("smallest", x.min())):
        runs = _runs(x == extreme)
        long = [(first, last) for first, last in runs if last - first >= _CLIPPED_RUN]
        if not long:
            continue
        share = sum(last - first for first, last in long) / x.size
        message = (
            f"{where(long[0][0])}: x stays at its {name} value {extreme:.6g} m for {len(long)} stretches"
        )
        if len(long) >= 2 and share > _CLIPPED_SHARE and not grid:
            raise SeparatrixError(f"{message}, {100 * share:.0f} % of the samples: clipped")
        warnings.append(f"{message}: clipped?")


def resolution_of(x: np.ndarray) -> float:
    """The step of the grid that the values lie on [m], 0 if there is none."""
    levels = np.unique(x)
    if levels.size < 2 or levels.size > 0.5 * x.size:
        return 0.0
    steps = np.diff(levels)
    step = float(steps.min())
    if step <= 1e-12 * np.abs(x).max():
        return 0.0
    multiple = steps / step
    return step if np.all(np.abs(multiple - np.round(multiple)) < 0.05 * np.maximum(1, multiple)) else 0.0


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def unique_names(records: Iterable[Record]) -> None:
    """Number the records whose files have the same name."""
    records = list(records)
    taken = {record.name for record in records}
    seen: set[str] = set()
    for record in records:
        if record.name in seen:
            record.name = next(name for k in count(2) if (name := f"{record.name}_{k}") not in taken)
            taken.add(record.name)
        seen.add(record.name)
