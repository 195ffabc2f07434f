# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The exceptions of the package; their codes are the exit codes of the command."""

from collections.abc import Callable
from pathlib import Path

USAGE = 64
BAD_DATA = 65
NO_INPUT = 66
INTERNAL = 70
NO_MEMORY = 71
CANNOT_CREATE = 73
STOPPED = 75
GIVEN_UP = 78
INTERRUPTED = 130
TERMINATED = 143


# What the libraries raise when they read a damaged file.
DAMAGE = (
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)


def why_absent(path: Path) -> str:
    """Return why there is no file at a path."""
    if path.is_dir():
        return "a folder, expected a file"
    return "not a regular file" if path.exists() else "no such file"


class SeparatrixError(Exception):
    """Something that the user can act on, in one line."""

    def __init__(self, message: str, code: int = BAD_DATA) -> None:
        """Keep the message and the exit code."""
        super().__init__(message)
        self.code = code


class CaseError(SeparatrixError):
    """A case, a value or a call that the simulator refuses; `code` is that of the program.

    Examples
    --------
    >>> case = sx.load("examples/basin_coulomb.toml")
    >>> case.with_({"contact.restitution": 1.5})
    Traceback (most recent call last):
        ...
    separatrix.errors.CaseError: ...key 'contact.restitution': found 1.5, allowed from 0.0 to 1.0
    """


class GivenUpError(SeparatrixError):
    """Motions that had to be given up; `result` is what there is of it."""

    def __init__(self, message: str, result: object) -> None:
        """Keep what there is."""
        super().__init__(message, GIVEN_UP)
        self.result = result


class SeparatrixWarning(UserWarning):
    """Something in a run that affects how its results are to be assessed."""


class Interrupted(KeyboardInterrupt):
    """A run was stopped; what it has done is kept, and `resume` goes on with it.

    It is a KeyboardInterrupt: nothing that does not ask for it swallows it. `done` is the share of the work
    that is done.
    """

    def __init__(self, message: str, done: float, resume: Callable[[], object]) -> None:
        """Keep how far it went and how to go on."""
        super().__init__(message)
        self.done = done
        self.resume = resume
