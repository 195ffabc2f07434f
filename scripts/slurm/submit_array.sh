#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# submit_array.sh [OPTIONS of sbatch] -- SHARES CASE OUTPUT [OPTIONS of separatrix basin]
#
# The search for the attractors, then a job array of shares, then the merge; each waits for the one before.
set -euo pipefail
options=()
while (($# > 0)) && [[ $1 != -- ]]; do
  options+=("$1")
  shift
done
if (($# < 4)); then
  echo "usage: submit_array.sh [OPTIONS of sbatch] -- SHARES CASE OUTPUT [OPTIONS of separatrix basin]" >&2
  exit 64
fi
shift
shares=$1 case_file=$2 output=$3
shift 3
SEPARATRIX_ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
export SEPARATRIX_ROOT
here=$SEPARATRIX_ROOT/scripts/slurm

search=$(sbatch --parsable "${options[@]}" "$here/search.sh" "$shares" "$case_file" "$output" "$@")
array=$(sbatch --parsable --dependency="afterok:$search" --kill-on-invalid-dep=yes --array="1-$shares" "${options[@]}" \
  "$here/array.sh" "$case_file" "$output" "$@")
merge=$(sbatch --parsable --dependency="afterok:$array" --kill-on-invalid-dep=yes "$here/merge.sh" "$output" "$shares")
echo "$search $array $merge"
echo "job $search finds the attractors, job $array computes the shares, job $merge joins them" >&2
