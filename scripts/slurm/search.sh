#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# sbatch --ntasks=16 --time=04:00:00 scripts/slurm/search.sh SHARES CASE OUTPUT [OPTIONS of separatrix basin]
#
# The search for the attractors of a map, once for all its shares: makes the file of the first.
#SBATCH --job-name=separatrix-search
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.log
set -uo pipefail
SEPARATRIX_ROOT=${SEPARATRIX_ROOT:-$SLURM_SUBMIT_DIR}
# shellcheck source=scripts/slurm/common.sh
source "$SEPARATRIX_ROOT/scripts/slurm/common.sh"
shares=$1 case_file=$2 output=$3
shift 3

set_stripes "$output"
start_ranks basin "$case_file" -o "$output" --shard "1/$shares" --resume \
  --search-only --log "$output.search.log.jsonl" "$@"
end_job $? "$output.shard-1-of-$shares.part"
