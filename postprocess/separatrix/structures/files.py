# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The HDF5 file of a structure (docs/structure-files.md)."""

from pathlib import Path

import h5py
import numpy as np

from separatrix.errors import CANNOT_CREATE, SeparatrixError
from separatrix.structures.content import Matrices, Modes


def write(structure: Matrices | Modes, path: str | Path, title: str = "", reduced: str = "none") -> None:
    """Write a file that [structure.NAME] reads; it appears whole or not at all."""
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        with h5py.File(part, "w") as file:
            group = file.create_group("structure")
            group.attrs["title"] = title
            group.attrs["reduced"] = reduced
            if isinstance(structure, Modes):
                _write_modes(group, structure)
            else:
                for name in ("mass", "stiffness", "damping"):
                    matrix = getattr(structure, name)
                    if matrix is not None:
                        group[name] = matrix.toarray()
                group.attrs["coordinates"] = structure.labels
            points = group.create_group("point", track_order=True)
            for name, row in structure.points.items():
                points[name] = np.asarray(row, dtype=float)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SeparatrixError(f"{path}: cannot be written: {error}", CANNOT_CREATE) from None


def _write_modes(group: h5py.Group, modes: Modes) -> None:
    group["frequency"] = np.asarray(modes.frequency, dtype=float)
    group["frequency"].attrs["units"] = "Hz"
    if modes.damping_ratio is not None:
        group["damping_ratio"] = np.asarray(modes.damping_ratio, dtype=float)
    if modes.damping is not None:
        group["damping"] = np.asarray(modes.damping, dtype=float)
