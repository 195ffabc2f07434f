#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# pyuff 2.5.8, UFF.write_sets of a data set 58 with binary = 1 into a new file.
#
# Guess before trying: the modes "overwrite" and "add" write the same file where there was none.
# Seen: "add" writes the record; "overwrite" leaves the 7 bytes of the opening delimiter, raises nothing, and the record is lost.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 pyuff==2.5.8
cd "$folder"
venv/bin/python > seen.txt << 'PYTHON'
from pathlib import Path

import numpy as np
import pyuff

print("pyuff", pyuff.__version__)
record = {
    "type": 58, "binary": 1, "func_type": 1, "rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1,
    "data": np.arange(8.0), "x": 0.1 * np.arange(8), "id1": "displacement", "id2": "", "id3": "", "id4": "", "id5": "",
    "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "abscissa_spacing": 1, "abscissa_inc": 0.1, "abscissa_min": 0.0,
    "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 8, "orddenom_spec_data_type": 0,
}
for binary in (0, 1):
    for mode in ("add", "overwrite"):
        path = Path(f"{mode}_{binary}.uff")
        pyuff.UFF(str(path)).write_sets({**record, "binary": binary}, mode)
        print(f"binary = {binary}, mode {mode}: {path.stat().st_size} bytes")
PYTHON
cat seen.txt
diff seen.txt - << 'EXPECTED'
pyuff 2.5.8
binary = 0, mode add: 1085 bytes
binary = 0, mode overwrite: 1085 bytes
binary = 1, mode add: 986 bytes
binary = 1, mode overwrite: 7 bytes
EXPECTED
