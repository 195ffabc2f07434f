#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# test.sh             builds Separatrix with and without MPI and runs the tests; the last line counts them
# test.sh --all       also the long ones, which repeat a law for a further machine, size or page
# test.sh NAME...     builds and runs single suites in build/: friction_law, tests/laws/test_friction_law.pf, figures,
#                     tests/python/figures/test_figures.py; a minute for a suite of Fortran of a build that is there
#
# The exit code is 0 only if no test failed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Where nothing keeps compiled modules, every process of Python compiles NumPy and SciPy again: 3 s each.
unset PYTHONDONTWRITEBYTECODE
export PYTHONPYCACHEPREFIX=$PWD/build/pycache

chosen="not long"
names=()
for argument in "$@"; do
  case "$argument" in
    --all) chosen="" ;;
    -h | --help)
      sed -n '5,10s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"
      exit 0
      ;;
    -*)
      echo "test: found '$argument', allowed --all or names of suites" >&2
      exit 64
      ;;
    *) names+=("$argument") ;;
  esac
done

# Single suites: those of Fortran by ctest, those of Python by pytest, which need program and library.
run_suites() {
  local name stem path found suites=() files=()
  for name in "$@"; do
    stem=$(basename "$name")
    stem=${stem%.pf}
    stem=${stem%.py}
    stem=test_${stem#test_}
    found=0
    # without an ending it may be a suite of both
    for path in $(compgen -G "tests/*/$stem.p[fy]" || true; compgen -G "tests/python/*/$stem.py" || true); do
      case "$name" in
        *.pf | *.py) [[ "${path##*.}" == "${name##*.}" ]] || continue ;;
      esac
      found=1
      case "$path" in
        *.pf) suites+=("$stem") ;;
        *.py) files+=("$path") ;;
      esac
    done
    if ((!found)); then
      echo "test: found '$name', allowed the name of a file tests/*/test_NAME.pf or tests/python/*/test_NAME.py" >&2
      exit 64
    fi
  done
  if ((${#files[@]} > 0)); then
    scripts/bootstrap.sh --develop
  else
    scripts/bootstrap.sh
  fi
  # shellcheck source=scripts/environment.sh
  source scripts/environment.sh
  cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DSEPARATRIX_LANES=all
  local jobs status=0
  jobs=$(env -u OMP_NUM_THREADS nproc)
  if ((${#suites[@]} > 0)); then
    cmake --build build -j "$jobs" --target "${suites[@]}"
    ctest --test-dir build -R "^($(IFS='|' && echo "${suites[*]}"))\$" -j "$jobs" --output-on-failure --no-tests=error || status=1
  fi
  if ((${#files[@]} > 0)); then
    cmake --build build -j "$jobs" --target separatrix separatrix_library separatrix_reference
    SEPARATRIX_BUILD=$PWD/build .venv/bin/python -m pytest -q -ra -n "$jobs" --dist loadfile -m "$chosen" "${files[@]}" || status=1
  fi
  exit "$status"
}

if ((${#names[@]} > 0)); then
  run_suites "${names[@]}"
fi

scripts/bootstrap.sh --develop --browser --docs
# shellcheck source=scripts/environment.sh
source scripts/environment.sh
# environment.sh asks for one thread a process, which nproc would count as the cores.
jobs=$(env -u OMP_NUM_THREADS nproc)
status=0

# Layers with suites whose serial build differs from the MPI build, and what they stand on.
serial_layers=(core csupport parallel io)

echo "test: building with MPI in build/"
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DSEPARATRIX_MPI=ON -DSEPARATRIX_LANES=all \
  -DSEPARATRIX_WERROR=ON
cmake --build build -j "$jobs"

echo "test: running the tests of the MPI build"
ctest --test-dir build -E '^(python|faults)$' -j "$jobs" --output-on-failure --no-tests=error \
  --output-junit ctest.xml || status=1

echo "test: building without MPI in build-serial/"
cmake -S . -B build-serial -G Ninja -DCMAKE_BUILD_TYPE=Release -DSEPARATRIX_MPI=OFF -DSEPARATRIX_STATIC=ON \
  -DSEPARATRIX_LANES=all -DSEPARATRIX_TESTS=ON
cmake --build build-serial -j "$jobs" --target separatrix separatrix_library separatrix_reference "${serial_layers[@]/#/suites-}"
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
.venv/bin/python -m pytest -q -ra -n "$jobs" --dist loadfile -m "$chosen" tests/faults \
  --junit-xml=build/pytest-faults.xml || status=1

.venv/bin/python scripts/count_tests.py build/ctest.xml build-serial/ctest.xml build/pytest.xml \
  build/pytest-faults.xml || status=1
exit "$status"
