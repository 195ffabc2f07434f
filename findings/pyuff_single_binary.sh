#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# pyuff 2.5.8, UFF.write_sets of a data set 58 with binary = 1 and force_double = False and ord_data_type = 2 (real, single precision).
#
# Guess before trying: the samples are rounded to four bytes each, and the file is shorter than in double precision.
# Seen: the header announces 4-byte numbers (ordinate type 2) and half the bytes, but 8-byte numbers follow, so that the file is
# as long. Read by pyuff it has twice the samples, and every second one is the lower half of a number, of any size. No error.
# Samples that are float32 already fare alike.
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
samples = np.sin(np.arange(8.0))
record = {
    "type": 58, "binary": 1, "func_type": 1, "rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1,
    "x": 0.1 * np.arange(8), "id1": "displacement", "id2": "", "id3": "", "id4": "", "id5": "",
    "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "abscissa_spacing": 1, "abscissa_inc": 0.1, "abscissa_min": 0.0,
    "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 8, "orddenom_spec_data_type": 0,
}
for data, double in ((samples, True), (samples, False), (samples.astype(np.float32), False)):
    path = Path(f"{data.dtype}_{double}.uff")
    pyuff.UFF(str(path)).write_sets({**record, "data": data, "ord_data_type": 4 if double else 2}, "add", force_double=double)
    read = pyuff.UFF(str(path)).read_sets()
    values = np.asarray(read["data"])
    same = values.size == samples.size and np.allclose(values, samples, atol=1e-6)
    print(f"{data.dtype}, force_double = {double}: {path.stat().st_size} bytes, ordinate type {read['ord_data_type']}, "
          f"{values.size} samples of {samples.size}, the same: {same}")
PYTHON
cat seen.txt
diff seen.txt - << 'EXPECTED'
pyuff 2.5.8
float64, force_double = True: 986 bytes, ordinate type 4, 8 samples of 8, the same: True
float64, force_double = False: 986 bytes, ordinate type 2, 16 samples of 8, the same: False
float32, force_double = False: 986 bytes, ordinate type 2, 16 samples of 8, the same: False
EXPECTED
