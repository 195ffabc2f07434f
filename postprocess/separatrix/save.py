# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write a figure whole or not at all."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from separatrix.version import __version__
from separatrix.whole_files import written_whole

FORMATS = ("png", "pdf", "svg")


def save(figure: Figure, stem: Path, formats: Sequence[str], dpi: int) -> list[Path]:
    """Write a figure in each format, return the paths; an older file stays until the new one is whole."""
    return [_save_one(figure, stem.with_name(f"{stem.name}.{suffix}"), suffix, dpi) for suffix in formats]


def _save_one(figure: Figure, path: Path, suffix: str, dpi: int) -> Path:
    with written_whole(path, make_folder=True) as temporary:
        figure.savefig(temporary, format=suffix, dpi=dpi, metadata=_metadata(suffix))
    return path


def _metadata(suffix: str) -> dict:
    # no date: the same file gives the same figure, byte for byte
    program = f"separatrix {__version__}"
    return {"png": {"Software": program}, "pdf": {"Creator": program, "CreationDate": None}}.get(
        suffix, {"Creator": program, "Date": None}
    )
