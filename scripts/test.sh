#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Builds Separatrix with and without MPI and runs the tests. The last line counts them; the exit
# code is 0 only if none failed.
#
#   --all   also the long ones, which repeat a law for a further machine, size or page
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

chosen="not long"
case "${1-}" in
  "") ;;
  --all) chosen="" ;;
  *)
    echo "test: found '$1', allowed --all or nothing" >&2
    exit 64
    ;;
esac

scripts/bootstrap.sh --browser --docs
# shellcheck source=scripts/environment.sh
source scripts/environment.sh
# environment.sh asks for one thread a process, which nproc would count as the cores.
jobs=$(env -u OMP_NUM_THREADS nproc)
status=0

# Layers with suites whose serial build differs from the MPI build, and what they stand on.
serial_layers=(core csupport parallel io)

echo "test: building with MPI in build/"
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DSEPARATRIX_MPI=ON
cmake --build build -j "$jobs"

echo "test: running the tests of the MPI build"
ctest --test-dir build -E '^(python|faults)$' -j "$jobs" --output-on-failure --no-tests=error \
  --output-junit ctest.xml || status=1

echo "test: building without MPI in build-serial/"
cmake -S . -B build-serial -G Ninja -DCMAKE_BUILD_TYPE=Release -DSEPARATRIX_MPI=OFF -DSEPARATRIX_STATIC=ON \
  -DSEPARATRIX_TESTS=ON
cmake --build build-serial -j "$jobs" --target separatrix separatrix_library "${serial_layers[@]/#/suites-}"
ctest --test-dir build-serial -L "^($(IFS='|' && echo "${serial_layers[*]}"))\$" -j "$jobs" --output-on-failure --no-tests=error \
  --output-junit ctest.xml || status=1

echo "test: running the Python tests"
export SEPARATRIX_BUILD=$PWD/build
.venv/bin/python -m pytest -q -ra -n "$jobs" --dist loadfile --durations=15 -m "$chosen" tests/python \
  --junit-xml=build/pytest.xml || status=1

# The objects of the serial build, without its tests; in an empty environment and in a bare root.
echo "test: building, installing and trying the wheel"
scripts/wheel --check --build build-serial || status=1

# By themselves: they kill what they run, at times that they choose.
echo "test: running the tests of faults"
.venv/bin/python -m pytest -q -ra -n "$jobs" --dist loadfile tests/faults --junit-xml=build/pytest-faults.xml || status=1

.venv/bin/python scripts/count_tests.py build/ctest.xml build-serial/ctest.xml build/pytest.xml \
  build/pytest-faults.xml || status=1
exit "$status"
