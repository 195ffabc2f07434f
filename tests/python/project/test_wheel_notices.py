# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A wheel has the notices and a list of its libraries, a true RECORD, and the same bytes each time."""

import base64
import csv
import hashlib
import importlib.util
import json
import os
import shutil
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

LIBRARY = "/usr/lib/x86_64-linux-gnu/libz.a"
INFO = "separatrix-1.2.3.dist-info"

pytestmark = pytest.mark.skipif(
    shutil.which("dpkg-query") is None or not Path(LIBRARY).exists(), reason="asks Debian's packages"
)


@pytest.fixture(scope="module")
def script(source_dir: Path) -> ModuleType:
    """The script as a module."""
    found = importlib.util.spec_from_file_location("wheel_notices", source_dir / "scripts/wheel_notices.py")
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@pytest.fixture
def build(tmp_path: Path) -> Path:
    """A build that links a static library."""
    folder = tmp_path / "build"
    folder.mkdir()
    (folder / "build.ninja").write_text(
        f"build bin/separatrix: LINK\n  LINK_LIBRARIES = a.a  {LIBRARY}  -lm\n"
    )
    return folder


def make_wheel(path: Path, names: list[str]) -> Path:
    """A wheel with these files, in this order, and the dates of now."""
    metadata = "Metadata-Version: 2.4\nName: separatrix\nLicense-File: LICENSE\n\ntext\n"
    added = {"components": [{"name": "libgfortran5", "purl": "pkg:deb/debian/libgfortran5@1"}]}
    texts = {f"{INFO}/METADATA": metadata, f"{INFO}/sboms/auditwheel.cdx.json": json.dumps(added)}
    with zipfile.ZipFile(path, "w") as archive:
        for name in names:
            archive.writestr(name, texts.get(name, name))
        program = zipfile.ZipInfo("separatrix/_native/bin/separatrix")
        program.external_attr = 0o100755 << 16
        archive.writestr(program, "program")
    return path


NAMES = ["separatrix/__init__.py", f"{INFO}/METADATA", f"{INFO}/RECORD", f"{INFO}/sboms/auditwheel.cdx.json"]


def test_notices_list_and_record(script: ModuleType, build: Path, tmp_path: Path) -> None:
    wheel = make_wheel(tmp_path / "a.whl", NAMES)
    parts = script.complete(build, wheel, 1_700_000_000)
    assert {part.source for part in parts} >= {"zlib", "gcc-12"}
    with zipfile.ZipFile(wheel) as archive:
        texts = {name: archive.read(name) for name in archive.namelist()}
        assert archive.getinfo("separatrix/_native/bin/separatrix").external_attr >> 16 & 0o111
    notices = texts[f"{INFO}/licenses/THIRD_PARTY.txt"].decode()
    for part in parts:
        assert part.name in notices and part.notice.read_text() in notices
    assert b"License-File: THIRD_PARTY.txt\n" in texts[f"{INFO}/METADATA"]
    listed = json.loads(texts[f"{INFO}/sboms/separatrix.cdx.json"])
    assert [one["name"] for one in listed["components"]] == [part.name for part in parts]
    rows = {row[0]: row[1:] for row in csv.reader(texts[f"{INFO}/RECORD"].decode().splitlines())}
    assert set(rows) == set(texts)
    for name, (digest, size) in rows.items():
        if name != f"{INFO}/RECORD":
            found = base64.urlsafe_b64encode(hashlib.sha256(texts[name]).digest()).rstrip(b"=").decode()
            assert (digest, size) == (f"sha256={found}", str(len(texts[name])))


def test_the_same_bytes(script: ModuleType, build: Path, tmp_path: Path) -> None:
    """Whatever the order and the dates of the files, and after a second time."""
    one, other = make_wheel(tmp_path / "a.whl", NAMES), make_wheel(tmp_path / "b.whl", NAMES[::-1])
    os.utime(other, (0, 0))
    for wheel in (one, other):
        script.complete(build, wheel, 1_700_000_000)
    first = one.read_bytes()
    assert other.read_bytes() == first
    script.complete(build, one, 1_700_000_000)
    assert one.read_bytes() == first


def test_an_unknown_licence_is_an_error(script, build, tmp_path, monkeypatch) -> None:
    monkeypatch.delitem(script.LICENCES, "zlib")
    with pytest.raises(SystemExit, match="zlib"):
        script.complete(build, make_wheel(tmp_path / "a.whl", NAMES), 1_700_000_000)
