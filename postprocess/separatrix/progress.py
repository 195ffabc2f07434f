# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of a run: a bar in a terminal or a notebook, or a function of the caller."""

import sys
from collections.abc import Callable
from types import TracebackType
from typing import Self

Report = Callable[[str, int, int], object]


class Progress:
    """A bar for each part of the work. `asked`: True, False, None (where somebody looks), or a function.

    A function is called with what is counted ("points", "slices", "values"), how many are done and of how
    many.
    """

    def __init__(self, asked: bool | Report | None) -> None:
        """Choose who gets the progress."""
        self._report = asked if callable(asked) else None
        self._shown = (_watched() if asked is None else bool(asked)) and self._report is None
        self._bar = None
        self._things = ""
        self.done, self.total = 0, 0

    @property
    def wanted(self) -> bool:
        """Whether anybody gets the progress."""
        return self._shown or self._report is not None

    def __call__(self, things: str, done: int, total: int) -> None:
        """Report how far the work is."""
        self.done, self.total = done, total
        if self._report is not None:
            self._report(things, done, total)
        if not self._shown:
            return
        if self._bar is None or things != self._things or self._bar.total != total:
            self.close()
            self._bar = _new_bar(things, total, done)
            self._things = things
        self._bar.update(max(0, done - self._bar.n))

    def finish(self) -> None:
        """Fill the bar."""
        if self._bar is not None:
            self._bar.update(max(0, self._bar.total - self._bar.n))

    def close(self) -> None:
        """Leave the bar as it is."""
        if self._bar is not None:
            self._bar.close()
        self._bar = None

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the bar, filled if all went well."""
        if kind is None:
            self.finish()
        self.close()


def _watched() -> bool:
    """Whether somebody looks: a terminal or a notebook."""
    return in_notebook() or bool(getattr(sys.stderr, "isatty", lambda: False)())


def in_notebook() -> bool:
    """Whether this is the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and type(shell).__name__ == "ZMQInteractiveShell"


def _new_bar(things: str, total: int, done: int) -> object:
    if in_notebook():
        try:
            import ipywidgets  # noqa: F401
            from tqdm.notebook import tqdm
        except ImportError:
            from tqdm import tqdm
    else:
        from tqdm import tqdm
    # what was done before this run has no part in the rate
    return tqdm(
        total=total,
        initial=done if done > 0.5 * total else 0,
        unit=" " + things,
        unit_scale=True,
        leave=False,
    )
