# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the motions of impacting and rubbing machines end up (docs/python.md).

Importing the package imports nothing else; each name below brings its module when it is first used.
"""

import importlib
from typing import TYPE_CHECKING

from separatrix.errors import SeparatrixError
from separatrix.version import __version__

if TYPE_CHECKING:
    from separatrix.open import decode_flags as decode_flags
    from separatrix.open import decode_word as decode_word
    from separatrix.open import decode_words as decode_words
    from separatrix.open import flag_names as flag_names
    from separatrix.open import open_result as open_result
    from separatrix.open import table as table

_HOME = {
    "decode_flags": "separatrix.open",
    "decode_word": "separatrix.open",
    "decode_words": "separatrix.open",
    "flag_names": "separatrix.open",
    "open_result": "separatrix.open",
    "table": "separatrix.open",
}

__all__ = ["SeparatrixError", "__version__", *sorted(_HOME)]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'separatrix' has no attribute '{name}'")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
