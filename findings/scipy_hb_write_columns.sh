#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# SciPy 1.17.1, scipy.io.hb_write. Harwell-Boeing is a format of fixed columns: the header states the format of the values, and a
# reader in Fortran takes them by it.
#
# Guess before trying: the fields are as wide as the header states.
# Seen: the header states (3E25.16), fields of 25 columns; the fields have 24. Read by the header, the second value of a line is
# not a number and the third has lost its sign: -1 becomes 1. scipy.io.hb_read splits at blanks and reads its own files.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 scipy==1.17.1
cd "$folder"
venv/bin/python > seen.txt << 'PYTHON'
import numpy as np
import scipy
from scipy.io import hb_read, hb_write
from scipy.sparse import csc_matrix

print("SciPy", scipy.__version__)
hb_write("a.hb", csc_matrix(np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 4.0]])))
lines = open("a.hb").read().splitlines()
print("format stated:", lines[3].split()[-1])
values = lines[6]
print("columns of a line of three values:", len(values))
for first in range(0, 75, 25):
    print("field of 25 columns:", repr(values[first : first + 25]))
print("read by SciPy:", hb_read("a.hb").toarray()[1].tolist())
PYTHON
cat seen.txt
diff seen.txt - << 'EXPECTED'
SciPy 1.17.1
format stated: (3E25.16)
columns of a line of three values: 72
field of 25 columns: '  2.0000000000000000E+00 '
field of 25 columns: '-1.0000000000000000E+00 -'
field of 25 columns: '1.0000000000000000E+00'
read by SciPy: [-1.0, 2.0, -1.0]
EXPECTED
