# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`verify` refuses a quadruple-precision library of another build: its results would mean nothing."""

import shutil
import subprocess
from pathlib import Path

import pytest

RUN = "int separatrix_reference_run(void) { return 0; }\n"
OTHER_LAWS = "long separatrix_reference_laws(void) { return 1; }\n"


@pytest.mark.parametrize("source", [RUN, RUN + OTHER_LAWS])
def test_it_is_refused(separatrix: Path, source_dir: Path, tmp_path: Path, source: str) -> None:
    for name in ("bin", "lib"):
        (tmp_path / name).mkdir()
    program = tmp_path / "bin" / "separatrix"
    shutil.copy(separatrix, program)
    library = tmp_path / "lib" / "libseparatrix_reference.so"
    compiler = ["gcc", "-shared", "-fPIC", "-x", "c", "-", "-o", str(library)]
    subprocess.run(compiler, input=source, text=True, check=True)
    counts = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count=3")]
    case = source_dir / "examples" / "basin_coulomb.toml"
    subprocess.run([program, "basin", case, *counts, "-o", "map.h5", "-q"], cwd=tmp_path, check=True)
    done = subprocess.run([program, "verify", "map.h5"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 66, done.stderr
    assert "of another build" in done.stderr
