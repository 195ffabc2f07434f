# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the physics that a model lacks: where records disagree with it, what is missing, and proof."""

from separatrix.discovery.options import Options
from separatrix.discovery.workflow import discover

__all__ = ["Options", "discover"]
