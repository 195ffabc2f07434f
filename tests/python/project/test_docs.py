# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The site: every code block of its teaching pages runs and prints what it states."""

import html
import re
import runpy
import subprocess
import sys
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from documents import LANGUAGES, blocks, matches, run_page
from fontTools.ttLib import TTFont
from separatrix import SeparatrixWarning

DOCS = Path(__file__).resolve().parents[3] / "docs"
TEACHING = [
    DOCS / "start.md",
    *sorted((DOCS / "machines").glob("*.md")),
    *sorted((DOCS / "howto").glob("*.md")),
]
HEAVY = {
    "belt",
    "compare",
    "duffing",
    "figures",
    "noise",
    "friction",
    "measures",
    "motor",
    "oscillator",
    "pendulum",
    "parameters",
    "reasons",
    "structure",
    "studies",
    "sweep",
    "through-resonance",
    "two-bodies",
}
"""Pages that take longest."""
RUN = [pytest.param(page, marks=[pytest.mark.long] if page.stem in HEAVY else []) for page in TEACHING]


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_the_code_of_a_page_runs(
    page: Path, separatrix: Path, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cases, commands with their output and Python, in the order of the page."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))
    run_page(page, tmp_path, [separatrix.parent, Path(sys.executable).parent])
    plt.close("all")


@pytest.mark.parametrize("page", TEACHING, ids=lambda page: page.stem)
def test_the_blocks_of_a_page_name_their_language(page: Path) -> None:
    """A block that no test runs has to be asked for."""
    found = blocks(page)
    assert {language for language, _ in found} - {"{toctree}", ""} <= LANGUAGES
    assert all(text.startswith(("pip install ", "ssh ", "sbatch ")) for kind, text in found if kind == "sh")


def test_the_comparison_can_fail() -> None:
    """What differs is seen, what may differ is not."""
    assert matches(["a", "...", "wrote x in 1.5 s"], ["a", "b", "c", "wrote x in 0.02 s"])
    assert not matches(["a", "...", "d"], ["a", "b", "c"])
    assert matches(["about 11 s on one core"], ["about 1 min 20 s on one core"])
    assert not matches(["share 0.5"], ["share 0.6"])
    assert not matches(["a"], ["a", "b"])


@pytest.mark.parametrize("script", sorted((DOCS / "gallery").glob("*.py")), ids=lambda script: script.stem)
def test_a_script_of_the_gallery_draws(
    script: Path, separatrix: Path, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each at a size that takes a second; scripts/gallery draws them in full."""
    (tmp_path / "gallery").mkdir()
    for path in [*script.parent.glob("*.toml"), DOCS / "start.md"]:
        (tmp_path / ("gallery" if path.suffix == ".toml" else ".") / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path / "gallery")
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))
    monkeypatch.setattr(sys, "argv", [str(script), "8"])
    with warnings.catch_warnings():
        # few starts make attractors that are not known to be periodic
        warnings.simplefilter("ignore", SeparatrixWarning)
        runpy.run_path(str(script), run_name="__main__")
    plt.close("all")
    picture = tmp_path / "gallery" / f"{script.stem}.png"
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 5000


def test_every_picture_of_the_gallery_is_there() -> None:
    """What scripts/gallery has drawn and what was printed with it."""
    scripts = {path.stem for path in (DOCS / "gallery").glob("*.py")}
    assert len(scripts) > 12
    assert scripts == {path.stem for path in (DOCS / "gallery").glob("*.png")}
    assert scripts == {path.stem for path in (DOCS / "gallery").glob("*.txt")}


def test_the_pages_of_reference_and_gallery_are_those_of_the_program(
    build_dir: Path, separatrix: Path, library: Path
) -> None:
    """`scripts/docs --pages` changes nothing."""
    made = [*(DOCS / "reference").glob("*.md"), *(DOCS / "gallery").glob("*.md")]
    kept = {path: path.read_text() for path in made}
    command = [sys.executable, DOCS.parent / "scripts" / "docs", "--pages", "--build", build_dir]
    subprocess.run(command, capture_output=True, text=True, check=True)
    assert [path.name for path in made if path.read_text() != kept[path]] == [], "scripts/docs --pages"


@pytest.mark.long
@pytest.mark.parametrize("options", [["--no-fortran"], []])
def test_the_site_builds_without_a_warning(
    options: list[str], build_dir: Path, separatrix: Path, library: Path, tmp_path: Path
) -> None:
    """All pages, the interfaces of Python and Fortran, and every link among them."""
    pytest.importorskip("myst_parser", reason="scripts/bootstrap.sh --docs installs what the site needs")
    made = [*(DOCS / "reference").glob("*.md"), *(DOCS / "gallery").glob("*.md")]
    kept = {path: path.read_text() for path in made}
    command = [
        sys.executable,
        DOCS.parent / "scripts" / "docs",
        "-o",
        tmp_path / "site",
        "--build",
        build_dir,
        *options,
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [path.name for path in made if path.read_text() != kept[path]] == [], "scripts/docs --pages"
    home = (tmp_path / "site" / "index.html").read_text()
    assert "petals.png" in home and "Start in 60 seconds" in home
    check_formulas(tmp_path / "site")
    for page in (tmp_path / "site").glob("*.html"):
        text = page.read_text()
        assert (
            re.findall(r"<pre(?! tabindex)|<img(?![^>]* alt=)|role=.heading.(?! aria-level)", text) == []
        ), page
        assert '<html class="no-js" lang="en"' in text


def check_formulas(site: Path) -> None:
    """Formulas are MathML in a font of the site that has the tables of a mathematics font."""
    text = (site / "theory.html").read_text()
    assert text.count("<math") > 100 and "\\dot" not in text
    style = (site / "_static" / "site.css").read_text()
    (name,) = re.findall(r'url\("([^"]*)"\) format\("opentype"\)', style)
    font = TTFont(site / "_static" / name)
    assert {"MATH", "CFF "} <= set(font.keys())
    formulas = "".join(re.findall("<math.*?</math>", text, re.DOTALL))
    letters = {ord(one) for one in html.unescape(re.sub("<[^>]*>", "", formulas))}
    # application of a function and invisible operators have no glyph
    letters -= {0x2061, 0x2062, 0x2063}
    unknown = {chr(one) for one in letters - set(font.getBestCmap()) if not chr(one).isspace()}
    assert not unknown


def test_links_between_documents_lead_somewhere() -> None:
    """Who reads the documents in a checkout meets no dead link."""
    top = DOCS.parent
    dead = []
    for page in [*top.glob("*.md"), *DOCS.rglob("*.md"), *(top / "src").rglob("*.md")]:
        text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
        for link in re.findall(r"\]\(([^)\s#]+)[^)]*\)", text):
            if not re.match("[a-z]+:", link) and not (page.parent / link).exists():
                dead.append(f"{page.relative_to(top)}: {link}")
    assert dead == []


def test_the_links_of_a_site_are_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing page, a missing name and what is loaded from outside are reported, the rest is not."""
    monkeypatch.syspath_prepend(str(DOCS.parent / "scripts"))
    from docs_pages.links import problems

    (tmp_path / "a.html").write_text('<a href="b.html#here">x</a><a href="https://example.org">y</a>')
    (tmp_path / "b.html").write_text('<h1 id="here">b</h1><img src="data:,">')
    assert problems(tmp_path) == []
    (tmp_path / "c.html").write_text(
        '<a href="b.html#there">x</a><a href="d.html">y</a><script src="https://example.org/x.js"></script>'
        '<a href="../outside.html">z</a>'
    )
    assert [line.rsplit(": ", 1)[1] for line in problems(tmp_path)] == [
        "no 'there' there", "no such file", "loaded from outside", "outside the site",
    ]  # fmt: skip
