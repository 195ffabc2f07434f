# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Packages of others that extras of this one bring."""

import importlib
from pathlib import Path
from types import ModuleType

from separatrix.errors import SeparatrixError


def library(name: str, path: Path, extra: str) -> ModuleType:
    """A package, or a module of one, that reads the files of others, from an extra of this one."""
    try:
        return importlib.import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise SeparatrixError(
            f"{path}: reading it needs the package {package}: pip install 'separatrix[{extra}]'"
        ) from None
