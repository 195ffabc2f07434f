#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# submit_array.sh [OPTIONS of sbatch] -- SHARES CASE OUTPUT [OPTIONS of separatrix basin]
#
# A job array of shares, and the merge that waits for all of them.
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

array=$(sbatch --parsable --array="1-$shares" "${options[@]}" "$here/array.sh" "$case_file" "$output" "$@")
merge=$(sbatch --parsable --dependency="afterok:$array" --kill-on-invalid-dep=yes "$here/merge.sh" "$output" "$shares")
echo "$array $merge"
echo "job $array computes the shares, job $merge joins them" >&2
