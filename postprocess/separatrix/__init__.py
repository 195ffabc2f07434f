# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Open Separatrix result files and make figures from them."""

from separatrix.errors import SeparatrixError
from separatrix.open import decode_flags, decode_word, decode_words, flag_names, open_result, table
from separatrix.version import __version__

__all__ = [
    "SeparatrixError",
    "__version__",
    "decode_flags",
    "decode_word",
    "decode_words",
    "flag_names",
    "open_result",
    "table",
]
