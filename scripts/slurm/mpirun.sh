#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# sbatch --ntasks=64 --time=04:00:00 scripts/slurm/mpirun.sh CASE OUTPUT [OPTIONS of separatrix basin]
#
# One map with ranks that mpirun starts, where srun does not know the site's MPI.
#SBATCH --job-name=separatrix
#SBATCH --signal=B:USR1@180
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
# The signal goes to this script alone, which hands it on; wait returns then, and is called again for the code.
mpirun -n "$SLURM_NTASKS" "$separatrix" basin "$case_file" -o "$output" --resume --log "$output.log.jsonl" "$@" &
run=$!
trap 'kill -USR1 "$run"' USR1
wait "$run"
code=$?
while kill -0 "$run" 2> /dev/null; do
  wait "$run"
  code=$?
done
end_job "$code" "$output.part"
