# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The scripts around the build."""

import re
import subprocess
import sys
import tomllib

import pytest

CTEST = """<testsuite>
  <testcase name="a" status="run"/>
  <testcase name="b" status="disabled"><skipped message="Disabled"/></testcase>
  {more}
</testsuite>"""
PYTEST = """<testsuites><testsuite>
  <testcase name="c"/>
  <testcase name="d"><skipped/></testcase>
</testsuite></testsuites>"""


@pytest.mark.parametrize(
    ("more", "line", "code"),
    [
        ("", "2 passed, 0 failed", 0),
        ('<testcase name="e" status="fail"><failure/></testcase>', "2 passed, 1 failed", 1),
        ('<testcase name="e" status="notrun"><skipped/></testcase>', "2 passed, 1 failed", 1),
    ],
)
def test_counts_of_ctest_and_pytest_are_added(source_dir, tmp_path, more, line, code):
    files = [tmp_path / "ctest.xml", tmp_path / "pytest.xml"]
    files[0].write_text(CTEST.format(more=more))
    files[1].write_text(PYTEST)
    command = [sys.executable, str(source_dir / "scripts" / "count_tests.py"), *map(str, files)]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.stdout.splitlines()[-1] == line
    assert result.returncode == code


def test_the_version_is_the_same_everywhere(source_dir):
    cmake = re.search(r"VERSION (\d+\.\d+\.\d+) ", (source_dir / "CMakeLists.txt").read_text())
    citation = re.search(r"^version: (\S+)$", (source_dir / "CITATION.cff").read_text(), re.MULTILINE)
    assert cmake.group(1) == citation.group(1)


def write_build_info(source_dir, tmp_path, tree) -> str:
    output = tmp_path / "build_info.f90"
    folder = source_dir / "scripts" / "cmake"
    options = {
        "TEMPLATE": folder / "build_info.f90.in",
        "OUTPUT": output,
        "SOURCE_DIR": tree,
        "VERSION": "1.2.3",
        "COMPILER": "It's a compiler",
        "FLAGS": "-flag " * 30,
        "MPI": "none",
        "HDF5": "1",
        "DEBUG": ".true.",
    }
    command = ["cmake", *(f"-D{key}={value}" for key, value in options.items())]
    subprocess.run([*command, "-P", str(folder / "write_build_info.cmake")], check=True)
    return output.read_text()


def test_build_info_is_valid_fortran_and_names_the_commit(source_dir, tmp_path):
    tree = tmp_path / "tree"
    tree.mkdir()
    git = ["git", "-C", str(tree), "-c", "user.name=a", "-c", "user.email=a@b"]
    assert "commit = 'unknown'" in write_build_info(source_dir, tmp_path, tree)
    subprocess.run([*git, "init", "-q"], check=True)
    subprocess.run([*git, "commit", "-q", "--allow-empty", "-m", "first"], check=True)
    head = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True)
    text = write_build_info(source_dir, tmp_path, tree)
    assert f"commit = '{head.stdout[:12]}'" in text
    assert max(map(len, text.splitlines())) <= 132
    assert "'It''s a compiler'" in text


@pytest.mark.parametrize(("option", "code"), [("--help", 0), ("-h", 0), ("--fast", 64)])
def test_quickstart_does_nothing_on_an_option(source_dir, option, code):
    """Only an exit before the first step leaves out its line."""
    script = source_dir / "scripts" / "quickstart.sh"
    done = subprocess.run([script, option], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == code
    assert "1/5" not in done.stdout
    assert "quickstart" in done.stdout + done.stderr


def test_only_the_integrator_asks_what_kind_of_machine_it_moves(source_dir):
    """`section` is the interface to any machine; variations, lanes, segments of coordinates have their
    own.
    """
    asks = re.compile(r"%\s*(pair|multibody)\b")
    sources = (source_dir / "src").glob("*/*.f90")
    asking = ("integrator", "variation", "modes")
    knowing = ("lane_slots.f90", "structure_segments.f90")
    above = [p for p in sources if p.parent.name not in asking and p.name not in knowing]
    assert len(above) > 150
    assert [p.name for p in above if asks.search(p.read_text())] == []


def test_a_wheel_builds_what_it_installs(source_dir):
    """From a new clone, where no other target has been built before."""
    settings = tomllib.loads((source_dir / "pyproject.toml").read_text())["tool"]["scikit-build"]
    texts = [path.read_text() for path in (*source_dir.glob("apps/*.txt"), *source_dir.glob("src/*/*.txt"))]
    installed = {
        name
        for text in texts
        for names in re.findall(r"install\(TARGETS ([a-z_ ]+)", text)
        for name in names.split()
    }
    assert installed and installed == set(settings["build"]["targets"])


def test_every_pinned_package_has_hashes(source_dir):
    """Lists that bootstrap.sh installs, as scripts/lock writes them."""
    lists = re.findall(r"requirements\S*\.lock", (source_dir / "scripts/bootstrap.sh").read_text())
    assert len(set(lists)) == 4
    for name in set(lists):
        wanted = (source_dir / name).with_suffix(".txt").read_text()
        entries = re.split(r"\n(?=\S)", (source_dir / name).read_text().split("\n", 1)[1].rstrip("\n"))
        assert all(re.match(r"\S+==\S+ .*\\\n    --hash=sha256:[0-9a-f]{64}", entry) for entry in entries)
        locked = {entry.split()[0].lower() for entry in entries}
        pinned = {line.lower() for line in wanted.splitlines() if line and line[0] not in "#-"}
        assert pinned <= locked
