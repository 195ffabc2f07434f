#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# format.sh           formats Fortran, C, C++ and Python and repairs what the linters can
# format.sh --check   changes nothing; fails if something would change or a linter objects
# Both list words that are not used here (scripts/words.txt) and sentences that are too long (scripts/prose.py).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

check=false
case "${1:-}" in
  --check) check=true ;;
  "") ;;
  *)
    echo "usage: format.sh [--check]" >&2
    exit 64
    ;;
esac

scripts/bootstrap.sh --develop
tools=.venv/bin
failed=0
present=()
for folder in src include apps tests postprocess scripts; do
  if [[ -d $folder ]]; then
    present+=("$folder")
  fi
done

files_named() {
  local name=() pattern
  for pattern in "$@"; do
    name+=(-o -name "$pattern")
  done
  find "${present[@]}" -type f \( "${name[@]:1}" \) | sort
}

# Indentation and trailing blanks; continuation lines stay as they are.
format_fortran() {
  local file formatted
  formatted=$(mktemp)
  while read -r file; do
    # findent ends a file without a line feed with one, so the result is always a text file.
    "$tools/findent" -ifree -i2 -c2 -C2 -k- < "$file" | sed 's/[[:space:]]*$//' > "$formatted"
    if cmp -s "$file" "$formatted"; then
      continue
    elif $check; then
      diff -u --label "$file" --label "$file (formatted)" "$file" "$formatted" || failed=1
    else
      echo "format: $file"
      cat "$formatted" > "$file"
    fi
  done < <(files_named '*.f90' '*.F90' '*.inc' '*.pf')
  rm "$formatted"
}

# The linter reads Fortran, so annotations become calls and comments of the same length.
lint_suites() {
  local file copies result=0 linter=$PWD/$tools/fortitude
  copies=$(mktemp -d)
  cp fortitude.toml "$copies"
  while read -r file; do
    mkdir -p "$copies/$(dirname "$file")"
    sed -E 's/^( *)@assert/\1call  a/; s/^( *)@/\1!/' "$file" > "$copies/$file"
  done < <(files_named '*.pf')
  if [[ -d $copies/tests ]]; then
    (cd "$copies" && "$linter" check --file-extensions pf --output-format concise tests) || result=1
  fi
  rm -r "$copies"
  return "$result"
}

echo "format: Fortran (findent, fortitude)"
format_fortran
c_files=()
mapfile -t c_files < <(files_named '*.c' '*.h' '*.cpp' '*.hpp' '*.cu')
if $check; then
  "$tools/fortitude" check --output-format concise src apps tests || failed=1
  lint_suites || failed=1
  echo "format: C and C++ (clang-format)"
  if ((${#c_files[@]} > 0)); then
    "$tools/clang-format" --dry-run -Werror "${c_files[@]}" || failed=1
  fi
  echo "format: Python (ruff)"
  "$tools/ruff" format --check tests postprocess scripts docs/conf.py docs/_ext docs/gallery || failed=1
  "$tools/ruff" check tests postprocess scripts docs/conf.py docs/_ext docs/gallery || failed=1
else
  "$tools/fortitude" check --fix --output-format concise src apps tests || failed=1
  lint_suites || failed=1
  echo "format: C and C++ (clang-format)"
  if ((${#c_files[@]} > 0)); then
    "$tools/clang-format" -i "${c_files[@]}"
  fi
  echo "format: Python (ruff)"
  "$tools/ruff" format tests postprocess scripts docs/conf.py docs/_ext docs/gallery
  "$tools/ruff" check --fix tests postprocess scripts docs/conf.py docs/_ext docs/gallery || failed=1
fi

echo "format: words and documents"
"$tools/python" scripts/words.py || failed=1
"$tools/python" scripts/prose.py || failed=1

if ((failed)); then
  if $check; then
    echo "format: not clean; scripts/format.sh repairs most of it" >&2
  fi
  exit 1
fi
echo "format: clean"
