# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a wheel states about the libraries inside it; run by scripts/wheel on a Debian system.

wheel_notices.py BUILD WHEEL    adds the notices of the libraries and a list of parts (CycloneDX) to the wheel

BUILD is the folder that the wheel was built in: its link commands name the static libraries. Those that
auditwheel has added are in auditwheel's own list. The wheel is packed again, with the names sorted and one
date for all ($SOURCE_DATE_EPOCH), so that the same content has the same bytes.
"""

import base64
import dataclasses
import datetime
import hashlib
import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path
from urllib.parse import quote

# Licences of the source packages whose code may be inside. Another one is an error until it has been read.
LICENCES = {
    "hdf5": "BSD-3-Clause",
    "gsl": "GPL-3.0-or-later",
    "zlib": "Zlib",
    "toml11": "MIT",
    "libaec": "BSD-2-Clause",
    "gcc-12": "GPL-3.0-or-later WITH GCC-exception-3.1",
}
#: Used as headers alone.
HEADERS = ("/usr/include/toml.hpp",)
DOCUMENTS = Path("/usr/share/doc")
EARLIEST = 315532800  # 1980, the first date that a zip file can have


@dataclasses.dataclass(frozen=True, order=True)
class Part:
    """A Debian package whose code is inside."""

    name: str
    version: str
    source: str

    @property
    def notice(self) -> Path:
        """Copyright file of the package."""
        return (DOCUMENTS / self.name / "copyright").resolve()

    @property
    def purl(self) -> str:
        """Name of the package for the list."""
        return f"pkg:deb/debian/{self.name}@{quote(self.version, safe='')}"


def output_of(*command: object) -> str:
    """What a command prints."""
    return subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True).stdout


def parts_of(build: Path, content: dict[str, bytes]) -> list[Part]:
    """Packages of the static libraries, of the headers and of the libraries that auditwheel has added."""
    linked = set(re.findall(r"/usr/\S+\.a\b", (build / "build.ninja").read_text()))
    files = sorted(linked | {path for path in HEADERS if Path(path).exists()})
    names = {line.split(":")[0] for path in files for line in output_of("dpkg", "-S", path).splitlines()}
    for path, data in content.items():
        if path.endswith("sboms/auditwheel.cdx.json"):
            added = json.loads(data)["components"]
            names |= {one["name"] for one in added if one["purl"].startswith("pkg:deb/")}
    parts = []
    for name in sorted(names):
        shown = output_of("dpkg-query", "-W", "-f", "${Version}\t${source:Package}\n", name)
        version, source = shown.splitlines()[0].split("\t")
        if source not in LICENCES:
            sys.exit(
                f"wheel_notices: the licence of {source} (package {name}) is not known; read it and add it"
            )
        parts.append(Part(name, version, source))
    return parts


def notices(parts: list[Part]) -> str:
    """Copyright files of the packages, each text once."""
    texts: dict[Path, list[str]] = {}
    for part in parts:
        texts.setdefault(part.notice, []).append(f"{part.name} {part.version} ({LICENCES[part.source]})")
    head = "Parts of the following libraries are inside the program and the library of this wheel.\n"
    line = "=" * 100
    return head + "".join(
        f"\n{line}\n{chr(10).join(names)}\n{line}\n\n{path.read_text()}" for path, names in texts.items()
    )


def list_of_parts(parts: list[Part], name: str, version: str, moment: int) -> str:
    """CycloneDX 1.5 of the wheel."""

    def entry(reference: str, name: str, version: str, purl: str, licence: str) -> dict[str, object]:
        known = {"bom-ref": reference, "name": name, "version": version, "purl": purl}
        return {"type": "library", **known, "licenses": [{"expression": licence}]}

    own = entry("separatrix", name, version, f"pkg:pypi/{name}@{version}", "GPL-3.0-or-later")
    components = [
        entry(part.purl, part.name, part.version, part.purl, LICENCES[part.source]) for part in parts
    ]
    when = datetime.datetime.fromtimestamp(moment, datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    return json.dumps(
        {
            "bomFormat": "CycloneDX",
            "specVersion": "1.5",
            "version": 1,
            "metadata": {"timestamp": when, "component": own},
            "components": components,
            "dependencies": [{"ref": "separatrix", "dependsOn": [part.purl for part in parts]}],
        },
        indent=1,
    )


def record(content: dict[str, bytes], path: str) -> bytes:
    """The file RECORD, at `path`, of this content."""
    lines = []
    for name, data in sorted(content.items()):
        if name != path:
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            lines.append(f"{name},sha256={digest},{len(data)}")
    return ("\n".join([*lines, f"{path},,"]) + "\n").encode()


def pack(path: Path, content: dict[str, bytes], modes: dict[str, int], moment: int) -> None:
    """Write a zip file whose bytes depend on the content and the moment alone."""
    date = datetime.datetime.fromtimestamp(max(moment, EARLIEST), datetime.UTC).timetuple()[:6]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, data in sorted(content.items()):
            entry = zipfile.ZipInfo(name, date)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = modes.get(name, 0o100644) << 16
            archive.writestr(entry, data)


def complete(build: Path, wheel: Path, moment: int) -> list[Part]:
    """Add the notices and the list to a wheel; return the parts."""
    with zipfile.ZipFile(wheel) as archive:
        entries = [entry for entry in archive.infolist() if not entry.is_dir()]
        content = {entry.filename: archive.read(entry) for entry in entries}
        modes = {entry.filename: entry.external_attr >> 16 for entry in entries}
    (metadata,) = (name for name in content if re.fullmatch(r"[^/]+\.dist-info/METADATA", name))
    folder = metadata.removesuffix("METADATA")
    name, version = folder.removesuffix(".dist-info/").split("-")
    parts = parts_of(build, content)
    text = content[metadata].decode()
    if "License-File: THIRD_PARTY.txt" not in text:
        text = text.replace(
            "License-File: LICENSE\n", "License-File: LICENSE\nLicense-File: THIRD_PARTY.txt\n", 1
        )
    content[metadata] = text.encode()
    content[f"{folder}licenses/THIRD_PARTY.txt"] = notices(parts).encode()
    content[f"{folder}sboms/separatrix.cdx.json"] = list_of_parts(parts, name, version, moment).encode()
    content[f"{folder}RECORD"] = record(content, f"{folder}RECORD")
    pack(wheel, content, modes, moment)
    return parts


if __name__ == "__main__":
    found = complete(Path(sys.argv[1]), Path(sys.argv[2]), int(os.environ["SOURCE_DATE_EPOCH"]))
    print("wheel: notices of " + ", ".join(f"{part.name} {part.version}" for part in found))
