# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of studies that are kept in a folder of the user and computed once."""

import hashlib
import inspect
import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.cases import Case, as_case
from separatrix.errors import USAGE, SeparatrixError
from separatrix.open import open_result
from separatrix.program import version_of_program

__all__ = ["cached"]

# How a result is computed, not what it is.
_HOW = ("output", "ranks", "workers", "threads", "progress", "resume", "overwrite", "time_limit")


def cached(
    folder: str | Path,
    function: Callable[..., xr.Dataset],
    case: Case | str | Path,
    *values: object,
    **more: object,
) -> xr.Dataset:
    """Return `function(case, *values, **more)`, from a file in `folder` if it was computed before.

    The name of the file is a checksum of the resolved case, the arguments and the version of the program with
    its commit: another case, argument or program is computed anew. Files stay until the user deletes them.
    A computation that is interrupted goes on where it was, at the next call. A damaged file is computed anew,
    with a warning.

    Parameters
    ----------
    folder
        Where the files are; it is made if it does not exist.
    function
        One that writes a result into a file, with the argument `output`: `sx.basin`, `sx.sweep`, `sx.points`,
        `sx.branches`.
    case, values, more
        Its arguments. `ranks`, `workers`, `progress` and the like do not count: the result has the same bits.

    Raises
    ------
    SeparatrixError
        If the function has no `output`, if `output` is given, or if an argument is neither a number, a text,
        a list, an array nor a dictionary of these.

    Examples
    --------
    >>> case = sx.load("examples/basin_coulomb.toml")
    >>> for ratio in (1.2, 1.21):
    ...     map = sx.cached("study", sx.basin, case.with_(drive__ratio=ratio), x0=12, v0=12)
    """
    known = inspect.signature(function).parameters
    if "output" not in known or "output" in more:
        found = "output given" if "output" in more else f"{function.__name__}, which writes no file"
        raise SeparatrixError(f"cached: found {found}, allowed a function with an output of its own", USAGE)
    case = as_case(case)
    what = {name: value for name, value in more.items() if name not in _HOW}
    key = json.dumps(
        [function.__name__, case.to_toml(), list(values), what, version_of_program()],
        sort_keys=True,
        default=_plain,
    )
    path = Path(folder) / f"{function.__name__}_{hashlib.sha256(key.encode()).hexdigest()[:20]}.h5"
    if path.exists():
        try:
            return open_result(path)
        except SeparatrixError as error:
            warnings.warn(f"cached: computed again, as {error}", stacklevel=2)
            path.unlink()
    path.parent.mkdir(parents=True, exist_ok=True)
    if "resume" in known and "resume" not in more:
        more["resume"] = True
    return function(case, *values, output=path, **more)


def _plain(value: object) -> object:
    """Return an argument as json has it."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise SeparatrixError(
        f"cached: found an argument of the type {type(value).__name__}, allowed numbers, texts, lists",
        USAGE,
    )
