#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# sbatch --array=1-8 --ntasks=16 --time=04:00:00 scripts/slurm/array.sh CASE OUTPUT [OPTIONS of separatrix basin]
#
# One share of a map for each element of a job array (from 1, without gaps), which takes the attractors that search.sh
# has found; submit_array.sh submits the search, the array and the merge. With SEPARATRIX_SHARES=8 and --array=3 the third
# of eight alone.
#SBATCH --job-name=separatrix-share
#SBATCH --signal=USR1@180
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%A_%a.log
set -uo pipefail
SEPARATRIX_ROOT=${SEPARATRIX_ROOT:-$SLURM_SUBMIT_DIR}
# shellcheck source=scripts/slurm/common.sh
source "$SEPARATRIX_ROOT/scripts/slurm/common.sh"
case_file=$1 output=$2
shift 2
share=$SLURM_ARRAY_TASK_ID shares=${SEPARATRIX_SHARES:-$SLURM_ARRAY_TASK_COUNT}
name=$output.shard-$share-of-$shares

found=$output.shard-1-of-$shares.part
if [[ ! -e $found ]]; then
  echo "$found is missing; search.sh makes it (SEPARATRIX_SHARES is the number of shares, for a part of an array)" >&2
  exit 66
fi
set_stripes "$output"
start_ranks basin "$case_file" -o "$output" --shard "$share/$shares" --resume \
  --catalogue "$found" --log "$name.log.jsonl" "$@"
end_job $? "$name.part"
