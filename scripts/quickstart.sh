#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# From a fresh clone to the first figures: installs, builds, computes a basin map and a sweep on two
# ranks and draws them into out/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

case "${1:-}" in
  "") ;;
  -h | --help)
    echo "scripts/quickstart.sh: installs what is needed, builds the program and its library in build/, and draws a basin map and a"
    echo "sweep into out/; it has no options"
    exit 0
    ;;
  *)
    echo "quickstart: unknown option '$1'; there are none" >&2
    exit 64
    ;;
esac

echo "quickstart: 1/5 what is needed"
scripts/bootstrap.sh
# shellcheck source=scripts/environment.sh
source scripts/environment.sh
jobs=$(env -u OMP_NUM_THREADS nproc)

echo "quickstart: 2/5 building the program in build/"
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DSEPARATRIX_LANES=native
cmake --build build -j "$jobs" --target separatrix

mkdir -p out
echo "quickstart: 3/5 basin map: where each initial condition ends up (out/basin_coulomb.h5)"
mpirun -n 2 build/bin/separatrix basin examples/basin_coulomb.toml -o out/basin_coulomb.h5 --force
.venv/bin/separatrix-figures out/basin_coulomb.h5 -o out/

echo "quickstart: 4/5 sweep: how the motion changes with the drive frequency (out/sweep_coulomb.h5)"
mpirun -n 2 build/bin/separatrix sweep examples/sweep_coulomb.toml -o out/sweep_coulomb.h5 --force
.venv/bin/separatrix-figures out/sweep_coulomb.h5 -o out/

echo "quickstart: 5/5 the library, for Python and C"
cmake --build build -j "$jobs" --target separatrix_library

echo "quickstart: done; the figures and the HDF5 files are in $PWD/out:"
ls -1 out
