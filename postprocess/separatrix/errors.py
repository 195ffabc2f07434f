# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The one exception of the package; its code is the exit code of the command."""

USAGE = 64
BAD_DATA = 65
NO_INPUT = 66
INTERNAL = 70
NO_MEMORY = 71
CANNOT_CREATE = 73
INTERRUPTED = 130
TERMINATED = 143


class SeparatrixError(Exception):
    """Something that the user can act on, in one line."""

    def __init__(self, message: str, code: int = BAD_DATA) -> None:
        """Keep the message and the exit code."""
        super().__init__(message)
        self.code = code
