# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tutorial: its code, run in the order of the page, prints what the page states."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from documents import LANGUAGES, blocks, run_page
from PIL import Image

DOCS = Path(__file__).resolve().parents[3] / "docs"
PAGE = DOCS / "tutorial.md"
QUICK = "\n## 3. "
"""The sections before this one take some seconds, the whole page up to a minute."""


def run(page: Path, separatrix: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a page in `folder` with the programs of this build."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))
    monkeypatch.setenv("MPLBACKEND", "agg")
    try:
        run_page(page, folder, [separatrix.parent, Path(sys.executable).parent])
    finally:
        plt.close("all")


def test_the_first_sections_run(
    separatrix: Path, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The case, its check, and one motion beside an integration with SciPy."""
    first, found, _ = PAGE.read_text().partition(QUICK)
    assert found
    page = tmp_path / PAGE.name
    page.write_text(first)
    assert len(blocks(page)) >= 4
    run(page, separatrix, tmp_path, monkeypatch)
    assert (tmp_path / "machine.svg").stat().st_size > 1000


@pytest.mark.long
def test_the_whole_tutorial_runs(
    separatrix: Path, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the equation to the figure."""
    run(PAGE, separatrix, tmp_path, monkeypatch)
    for name in ("exponents.png", "section.png", "tutorial.png", "tutorial.pdf"):
        assert (tmp_path / name).stat().st_size > 5000, name


def test_every_block_is_run() -> None:
    """Cases, Python and commands alone, and every number of the text is printed."""
    found = blocks(PAGE)
    assert {language for language, _ in found} <= LANGUAGES - {"sh", "text"}
    assert sum(text.count(")  # ") for language, text in found if language == "python") > 15


@pytest.mark.parametrize("name", ["tutorial", "tutorial_exponents"])
def test_the_figures_are_there(name: str) -> None:
    """Those that scripts/tutorial has made, of moderate size."""
    path = DOCS / "figures" / f"{name}.png"
    assert f"figures/{name}.png" in PAGE.read_text()
    assert path.stat().st_size < 200_000
    with Image.open(path) as picture:
        assert picture.width >= 900
