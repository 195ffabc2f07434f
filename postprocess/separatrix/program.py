# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the program `separatrix` is, and the command of that name, which becomes it."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from separatrix.errors import NO_INPUT, SeparatrixError

# what a wheel brings along
NATIVE = Path(__file__).resolve().parent / "_native"
# of an installation that was not copied elsewhere
SOURCE_TREE = Path(__file__).resolve().parents[2]


def program_path() -> Path:
    """Return where the program is: $SEPARATRIX_PROGRAM, in this package, in build/bin, or on the PATH."""
    asked = os.environ.get("SEPARATRIX_PROGRAM")
    if asked:
        if not Path(asked).is_file():
            raise SeparatrixError(f"SEPARATRIX_PROGRAM: {asked}: no such file", NO_INPUT)
        return Path(asked)
    for folder in (NATIVE / "bin", SOURCE_TREE / "build" / "bin"):
        path = folder / "separatrix"
        if path.is_file():
            return path
    found = shutil.which("separatrix")
    if found and _is_binary(Path(found)):
        return Path(found)
    raise SeparatrixError(
        f"no program separatrix in {NATIVE / 'bin'}, {SOURCE_TREE / 'build' / 'bin'} or on the PATH; "
        "build it (cmake --build build --target separatrix) or name it in SEPARATRIX_PROGRAM",
        NO_INPUT,
    )


def version_of_program() -> str:
    """Return what decides the results of the program: version and commit; of changed sources its file."""
    path = program_path()
    lines = subprocess.run(
        [path, "--version"], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    found = [line for line in lines if line.startswith(("separatrix ", "commit "))]
    if "-dirty" in found[-1]:
        found.append(hashlib.sha256(path.read_bytes()).hexdigest())
    return "\n".join(found)


def main() -> int:
    """Become the program."""
    try:
        path = program_path()
        os.execv(path, ["separatrix", *sys.argv[1:]])
    except SeparatrixError as error:
        print(f"separatrix: {error}", file=sys.stderr)
        return error.code
    except OSError as error:
        print(f"separatrix: {path}: cannot be run ({error.strerror})", file=sys.stderr)
        return NO_INPUT


def _is_binary(path: Path) -> bool:
    """Whether a file is a program and not the command of this module."""
    try:
        with path.open("rb") as file:
            return file.read(4) == b"\x7fELF"
    except OSError:
        return False


if __name__ == "__main__":
    sys.exit(main())
