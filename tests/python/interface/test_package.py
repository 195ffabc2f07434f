# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The package as it is installed: one version, a quick import, the program and the library that it finds."""

import importlib.machinery
import importlib.util
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import separatrix
from separatrix import program
from separatrix.errors import SeparatrixError


def cmake_version(source_dir: Path) -> str:
    text = (source_dir / "CMakeLists.txt").read_text()
    return re.search(r"project\(separatrix VERSION ([0-9.]+)", text)[1]


def test_every_file_names_the_version_of_the_build(source_dir: Path) -> None:
    version = cmake_version(source_dir)
    assert separatrix.__version__ == version
    assert f"\nversion: {version}\n" in (source_dir / "CITATION.cff").read_text()
    assert json.loads((source_dir / "codemeta.json").read_text())["version"] == version


def test_the_program_has_that_version(source_dir: Path, separatrix: Path) -> None:
    out = subprocess.run([separatrix, "--version"], capture_output=True, text=True, check=True).stdout
    assert out.split()[1] == cmake_version(source_dir)


def test_keywords_and_description_are_the_same_everywhere(source_dir: Path) -> None:
    import tomllib

    project = tomllib.loads((source_dir / "pyproject.toml").read_text())["project"]
    codemeta = json.loads((source_dir / "codemeta.json").read_text())
    citation = (source_dir / "CITATION.cff").read_text()
    assert codemeta["keywords"] == project["keywords"]
    assert re.findall(r"^  - (?!name|family)(.+)$", citation, re.M) == project["keywords"]
    assert project["description"] in citation.replace("where", "Where", 1)
    assert codemeta["description"] == project["description"]


def test_importing_the_package_imports_no_other() -> None:
    code = "import sys, separatrix; print(sorted({name.partition('.')[0] for name in sys.modules}))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not {"numpy", "xarray", "pandas", "h5py", "matplotlib", "scipy"} & set(
        json.loads(out.replace("'", '"'))
    )


def test_every_public_name_can_be_had() -> None:
    assert all(getattr(separatrix, name) is not None for name in separatrix.__all__)
    with pytest.raises(AttributeError, match="no attribute 'bassin'"):
        _ = separatrix.bassin


def test_the_command_becomes_the_program(separatrix: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "separatrix.program"]
    environment = {"SEPARATRIX_PROGRAM": str(separatrix), "PATH": "/usr/bin:/bin"}
    own = subprocess.run([separatrix, "basin", "none.toml"], capture_output=True, cwd=tmp_path)
    same = subprocess.run(
        [*command, "basin", "none.toml"], capture_output=True, cwd=tmp_path, env=environment
    )
    assert (same.returncode, same.stderr) == (own.returncode, own.stderr)


def test_the_program_is_found_in_the_package_then_in_the_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SEPARATRIX_PROGRAM", raising=False)
    monkeypatch.setattr(program, "NATIVE", tmp_path / "native")
    monkeypatch.setattr(program, "SOURCE_TREE", tmp_path)
    # a command of this package is not the program
    script = tmp_path / "bin" / "separatrix"
    script.parent.mkdir()
    script.write_text("#!/usr/bin/env python3\n")
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(script.parent))
    with pytest.raises(SeparatrixError, match="SEPARATRIX_PROGRAM"):
        program.program_path()
    for folder in ("build/bin", "native/bin"):
        path = tmp_path / folder / "separatrix"
        path.parent.mkdir(parents=True)
        path.touch()
        assert program.program_path() == path
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(tmp_path / "absent"))
    with pytest.raises(SeparatrixError, match="absent: no such file"):
        program.program_path()


def test_a_release_writes_the_version_everywhere(source_dir: Path, tmp_path: Path) -> None:
    loader = importlib.machinery.SourceFileLoader("release", str(source_dir / "scripts" / "release"))
    release = importlib.util.module_from_spec(importlib.util.spec_from_loader("release", loader))
    loader.exec_module(release)
    for name in release.VERSIONED:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source_dir / name, tmp_path / name)
    old = {name: (tmp_path / name).read_text() for name in release.VERSIONED}
    with pytest.raises(SystemExit, match="allowed a version"):
        release.write("1.2", tmp_path)
    # twice, because the first makes lines that the second replaces
    for version in ("9.8.6", "9.8.7"):
        assert release.write(version, tmp_path) == 0
    for name in release.VERSIONED:
        new = (tmp_path / name).read_text()
        assert new != old[name]
        assert "9.8.7" in new
        assert name == "CHANGELOG.md" or "9.8.6" not in new
    assert cmake_version(tmp_path) == "9.8.7"
