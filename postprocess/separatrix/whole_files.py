# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are written whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from separatrix.errors import CANNOT_CREATE, SeparatrixError


@contextmanager
def written_whole(path: Path, make_folder: bool = False) -> Iterator[Path]:
    """Give a temporary file beside `path` that becomes `path` at the end; an older file stays until then.

    A SeparatrixError if the folder or the file cannot be written; `make_folder` makes the folder first.
    """
    temporary = None
    try:
        if make_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        raise SeparatrixError(
            f"{path}: cannot be written ({error.strerror or error})", CANNOT_CREATE
        ) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
