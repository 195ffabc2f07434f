#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Installs what Separatrix needs on Debian or Ubuntu and makes .venv with the Python packages.
# Running it again is quick: it does only what is missing. With --develop also what the Python tests and scripts/format.sh
# need; with --browser what the browser tests of the viewer need, Chromium and Playwright; with --docs what scripts/docs needs.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

develop=false
browser=false
docs=false
for option in "$@"; do
  case "$option" in
    --develop) develop=true ;;
    --browser) browser=true ;;
    --docs) docs=true ;;
    *)
      echo "usage: bootstrap.sh [--develop] [--browser] [--docs]" >&2
      exit 64
      ;;
  esac
done

packages=(
  gfortran gcc g++ cmake ninja-build git
  openmpi-bin libopenmpi-dev libhdf5-openmpi-dev libhdf5-dev hdf5-tools
  libgsl-dev libtoml11-dev zlib1g-dev libisal-dev python3-venv libpangoft2-1.0-0 libpangocairo-1.0-0
)

if $browser && ! command -v chromium > /dev/null; then
  packages+=(chromium)
fi

if $docs; then
  packages+=(fonts-lmodern)
fi

fail() {
  echo "bootstrap: $*" >&2
  exit 1
}

install_packages() {
  local missing=() package
  if ! command -v dpkg-query > /dev/null; then
    echo "bootstrap: not a Debian system; install the equivalents of: ${packages[*]}" >&2
    return
  fi
  for package in "${packages[@]}"; do
    if [[ $(dpkg-query -W -f='${db:Status-Abbrev}' "$package" 2> /dev/null) != ii* ]]; then
      missing+=("$package")
    fi
  done
  if ((${#missing[@]} == 0)); then
    echo "bootstrap: system packages are all there"
    return
  fi
  local as_root=()
  if ((EUID != 0)); then
    if ! command -v sudo > /dev/null; then
      fail "packages are missing and there is no sudo; as root run: apt-get install ${missing[*]}"
    fi
    as_root=(sudo)
  fi
  echo "bootstrap: installing ${missing[*]}"
  "${as_root[@]}" apt-get update -qq || fail "apt-get update failed"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends -o Dpkg::Use-Pty=0 "${missing[@]}" > /dev/null ||
    fail "apt-get could not install: ${missing[*]}"
}

# The first python3 that is new enough and can make environments.
find_python() {
  local candidate
  for candidate in python3 /usr/bin/python3 python3.13 python3.12 python3.11; do
    if "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2> /dev/null; then
      command -v "$candidate"
      return
    fi
  done
  fail "no Python 3.11 or newer with the module venv was found"
}

# What .venv depends on; it is made again if the interpreter is gone or broken.
wanted() {
  .venv/bin/python --version
  cat requirements.lock pyproject.toml
}

make_venv() {
  local stamp=.venv/installed.txt python
  if .venv/bin/python -c '' 2> /dev/null && [[ -f $stamp ]] && wanted | cmp -s - "$stamp"; then
    echo "bootstrap: .venv is up to date"
    return
  fi
  if ! .venv/bin/python -m pip --version > /dev/null 2>&1; then
    python=$(find_python)
    echo "bootstrap: making .venv with $python"
    "$python" -m venv --clear .venv
  fi
  echo "bootstrap: installing the Python packages into .venv"
  # Modules are compiled when they are first imported, most of them never.
  local install=(.venv/bin/python -m pip install --quiet --disable-pip-version-check --no-compile)
  "${install[@]}" --require-hashes -r requirements.lock
  # The Python package alone: the program is that of build/.
  "${install[@]}" -e . --config-settings=wheel.cmake=false
  wanted > "$stamp"
}

add_development() {
  local stamp=.venv/development.txt
  if ! cmp -s requirements-dev.lock "$stamp"; then
    echo "bootstrap: installing requirements-dev.lock into .venv"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-dev.lock
    cp requirements-dev.lock "$stamp"
  fi
}

# Kept out of .venv's stamp: who does not test the browser or build the site has neither.
add_packages() {
  local module=$1 list=$2
  if ! .venv/bin/python -c "import $module" 2> /dev/null; then
    echo "bootstrap: installing $list into .venv"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r "$list"
  fi
}

install_packages
make_venv
if $develop; then
  add_development
fi
if $browser; then
  add_packages playwright requirements-browser.lock
fi
if $docs; then
  add_packages myst_parser requirements-docs.lock
fi
