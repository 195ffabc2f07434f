# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Public functions of the Python interface have an example that runs and prints what it shows."""

import doctest
import inspect
from pathlib import Path

import pytest
import separatrix as sx

# Exceptions that carry what a run leaves behind, values that functions return, and the version.
WITHOUT = {
    "Discovery", "GivenUpError", "Interrupted", "SeparatrixError", "SeparatrixWarning", "Stability",
    "__version__",
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(set(sx.__all__) - WITHOUT))
def test_the_example_of_a_docstring_is_right(
    name: str, source_dir: Path, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "examples").symlink_to(source_dir / "examples")
    monkeypatch.chdir(tmp_path)
    text = inspect.getdoc(getattr(sx, name))
    example = doctest.DocTestParser().get_doctest(text, {"sx": sx}, name, None, 0)
    assert example.examples
    report: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    runner.run(example, out=report.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(report)
