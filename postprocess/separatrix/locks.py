# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""HDF5 locks a file that it reads. Where the file system has no locks, reading has to do without."""

import errno
import fcntl
from pathlib import Path

__all__ = ["lock_options"]


def lock_options(path: str | Path) -> dict[str, bool]:
    """Return the options of h5py.File for a file: `locking=False` if it cannot be locked, else none."""
    try:
        with Path(path).open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP):
            return {"locking": False}
    return {}
