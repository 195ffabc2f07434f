# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write a figure whole or not at all."""

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from separatrix.errors import CANNOT_CREATE, SeparatrixError
from separatrix.version import __version__

FORMATS = ("png", "pdf", "svg")


def save(figure: Figure, stem: Path, formats: Sequence[str], dpi: int) -> list[Path]:
    """Write a figure in each format, return the paths; an older file stays until the new one is whole."""
    return [_save_one(figure, stem.with_name(f"{stem.name}.{suffix}"), suffix, dpi) for suffix in formats]


def _save_one(figure: Figure, path: Path, suffix: str, dpi: int) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise SeparatrixError(f"{path}: cannot be written ({error.strerror})", CANNOT_CREATE) from error
    temporary = Path(name)
    try:
        figure.savefig(temporary, format=suffix, dpi=dpi, metadata=_metadata(suffix))
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        raise SeparatrixError(f"{path}: cannot be written ({error.strerror})", CANNOT_CREATE) from error
    finally:
        temporary.unlink(missing_ok=True)
    return path


def _metadata(suffix: str) -> dict:
    # no date: the same file gives the same figure, byte for byte
    program = f"separatrix {__version__}"
    return {"png": {"Software": program}, "pdf": {"Creator": program, "CreationDate": None}}.get(
        suffix, {"Creator": program, "Date": None}
    )


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
