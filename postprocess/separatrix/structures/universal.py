# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Normal modes out of universal files: data sets 55, in the units of data set 164 (with pyuff)."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from separatrix.errors import NO_INPUT, SeparatrixError, why_absent
from separatrix.extras import library
from separatrix.structures.content import Modes
from separatrix.trial import read_apart
from separatrix.universal_files import check_whole, units_of

_MODES, _UNITS = 55, 164
_NORMAL_MODE = 2
# Specific data types of shapes that are displacements: not stated, general, displacement.
_DISPLACEMENT = (0, 1, 8)


def read_modes(path: str | Path) -> Modes:
    """Read the normal modes of a universal file; modal masses normalise the shapes.

    Data set 164 states the units; without it they are SI.
    """
    path = Path(path)
    if not path.is_file():
        raise SeparatrixError(f"{path}: {why_absent(path)}", NO_INPUT)
    pyuff = library("pyuff", path, "formats")

    def read() -> Modes:
        check_whole(path)
        file = pyuff.UFF(str(path))
        kinds = np.asarray(file.get_set_types())
        return _modes(
            [file.read_sets(int(number)) for number in np.flatnonzero(kinds == _MODES)],
            _factors([file.read_sets(int(number)) for number in np.flatnonzero(kinds == _UNITS)]),
        )

    return read_apart(path, "universal", read)


def _factors(sets: Sequence[Mapping]) -> tuple[float, float]:
    """Return the divisors that lead from the units of the file to m and N."""
    units = units_of(sets)
    if units is None:
        return 1.0, 1.0
    if units.problem:
        raise SeparatrixError(units.problem)
    return units.length, units.force


def _modes(sets: Sequence[Mapping], factors: tuple[float, float]) -> Modes:
    sets = [one for one in sets if one["analysis_type"] == _NORMAL_MODE]
    if not sets:
        raise SeparatrixError("found no data set 55 with a normal mode (analysis type 2)")
    numbers = np.array(
        [[one[key] for key in ("freq", "modal_m", "modal_damp_vis", "modal_damp_his")] for one in sets], float
    )
    if not np.isfinite(numbers).all() or np.any(numbers[:, [0, 2, 3]] < 0):
        raise SeparatrixError("found a frequency or a damping ratio below 0 or not finite, allowed from 0 on")
    order = np.argsort(numbers[:, 0], kind="stable")
    shapes: dict[str, list[float]] = {}
    for position, number in enumerate(order):
        one, mass = sets[number], numbers[number, 1]
        mode = f"mode {position + 1}"
        if not mass > 0:
            raise SeparatrixError(f"{mode}: found the modal mass {mass}, allowed above 0")
        if one.get("spec_data_type", 0) not in _DISPLACEMENT:
            raise SeparatrixError(
                f"{mode}: found shapes of the specific data type {one['spec_data_type']}, "
                "allowed displacement (8)"
            )
        for key, value in _shape(one, mass, factors, mode).items():
            column = shapes.setdefault(key, [])
            # A point that a mode lacks is left out of all.
            if len(column) == position:
                column.append(value)
    rows = {key: np.array(values) for key, values in shapes.items() if len(values) == len(sets)}
    return Modes(numbers[order, 0], numbers[order, 2] + numbers[order, 3] / 2, shapes=rows)


def _shape(one: Mapping, mass: float, factors: tuple[float, float], mode: str) -> dict[str, float]:
    """Return the mass-normalised displacements of a mode, by "NODE:DIRECTION", in SI units.

    The energy of a mode is half its modal mass times the squared rate of its amplitude, so that mass goes
    with length times force; rotations have no unit of their own.
    """
    length, force = factors
    nodes = [int(node) for node in one["node_nums"]]
    if len(set(nodes)) != len(nodes):
        raise SeparatrixError(f"{mode}: found a node twice, allowed once")
    found = {}
    for direction in "123456":
        values = one.get(f"r{direction}")
        if values is None:
            continue
        values = np.asarray(values)
        if len(values) != len(nodes) or not np.isfinite(values).all():
            raise SeparatrixError(
                f"{mode}: found {len(values)} numbers in direction {direction}, "
                f"allowed {len(nodes)} finite ones"
            )
        if np.iscomplexobj(values):
            if np.abs(values.imag).max() > 1e-3 * np.abs(values).max():
                raise SeparatrixError(f"{mode} is complex, allowed real normal modes")
            values = values.real
        unit = np.sqrt(force / length if direction in "123" else force * length)
        row = values * unit / np.sqrt(mass)
        found |= {f"{node}:{direction}": float(value) for node, value in zip(nodes, row, strict=True)}
    return found
