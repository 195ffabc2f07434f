#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# sbatch --ntasks=64 --time=04:00:00 scripts/slurm/srun.sh CASE OUTPUT [OPTIONS of separatrix basin]
#
# One map with ranks that srun starts. SLURM may send the signal up to a minute earlier than asked for.
#SBATCH --job-name=separatrix
#SBATCH --signal=USR1@180
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.log
set -uo pipefail
SEPARATRIX_ROOT=${SEPARATRIX_ROOT:-$SLURM_SUBMIT_DIR}
# shellcheck source=scripts/slurm/common.sh
source "$SEPARATRIX_ROOT/scripts/slurm/common.sh"
case_file=$1 output=$2
shift 2

set_stripes "$output"
# The signal goes to the ranks, which stop cleanly.
start_ranks basin "$case_file" -o "$output" --resume --log "$output.log.jsonl" "$@"
end_job $? "$output.part"
