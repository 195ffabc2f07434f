# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures of engineers' tools, reduced and written for [structure.NAME] of a case."""

from separatrix.structures.content import Matrices, Modes
from separatrix.structures.files import write
from separatrix.structures.readers import read_matrices
from separatrix.structures.reduction import condense, craig_bampton, modal
from separatrix.structures.universal import read_modes

__all__ = ["Matrices", "Modes", "condense", "craig_bampton", "modal", "read_matrices", "read_modes", "write"]
