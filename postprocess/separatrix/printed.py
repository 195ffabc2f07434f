# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands print on stdout."""

import os
import sys


def show(text: object) -> None:
    """Print a text at once; a reader that has gone, such as `head` after its lines, is no error."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # what is left in the buffer is lost at the exit, without a message
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
