# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# What the batch scripts of this folder share; docs/batch.md describes their use.

separatrix=${SEPARATRIX:-$SEPARATRIX_ROOT/build/bin/separatrix}

# Ranks of one job that run on other hosts get the same variables.
# shellcheck source=scripts/environment.sh
source "$SEPARATRIX_ROOT/scripts/environment.sh"

# OpenMPI notices a lost host after a minute, not after eight.
export OMPI_MCA_oob_tcp_keepalive_time=${OMPI_MCA_oob_tcp_keepalive_time:-30}
export OMPI_MCA_oob_tcp_keepalive_intvl=${OMPI_MCA_oob_tcp_keepalive_intvl:-10}
export OMPI_MCA_oob_tcp_keepalive_probes=${OMPI_MCA_oob_tcp_keepalive_probes:-3}

# start_ranks ARGUMENTS: the program on all tasks of the job. When a rank is killed, the others would wait for it.
start_ranks() {
  srun --mpi="${SEPARATRIX_SRUN_MPI:-pmix}" --kill-on-bad-exit=1 "$separatrix" "$@"
}

# Tiles done in a working file; 0 if there is none.
tiles_done() {
  if [[ -e $1 ]]; then
    "$separatrix" info "$1" --json | sed -n 's/.*"tiles_done": \([0-9]*\).*/\1/p'
  else
    echo 0
  fi
}

# set_stripes OUTPUT: with SEPARATRIX_STRIPES=N new files in the folder of OUTPUT are spread over N servers of Lustre.
set_stripes() {
  local folder
  folder=$(dirname "$1")
  if [[ -z ${SEPARATRIX_STRIPES:-} ]]; then
    return
  fi
  if ! lfs setstripe -c "$SEPARATRIX_STRIPES" -S "${SEPARATRIX_STRIPE_SIZE:-4M}" "$folder"; then
    echo "lfs cannot set $SEPARATRIX_STRIPES stripes for '$folder': unset SEPARATRIX_STRIPES where it is not on Lustre" >&2
    exit 73
  fi
}

# Launches in a row that may fail without a new tile.
failures_allowed=${SEPARATRIX_RETRIES:-3}

# end_job CODE FILE.part: puts the job into the queue again after a stop (75), and after a launch that failed, which is
# any code that is not one of the program. Without a new tile since the last start neither goes on for ever.
end_job() {
  local code=$1 part=$2 finished before=0 failures=0
  if ((code == 0 || (code >= 64 && code <= 78 && code != 75))); then
    rm -f "$part.tiles"
    exit "$code"
  fi
  finished=$(tiles_done "$part")
  finished=${finished:-0}
  if [[ -e $part.tiles ]]; then
    read -r before failures < "$part.tiles"
  fi
  if ((finished > before)); then
    failures=0
  elif ((code == 75)); then
    echo "no tile was finished since the last start ($finished are done): the job needs more time, or smaller tiles" >&2
    exit 75
  fi
  if ((code != 75)); then
    failures=$((failures + 1))
    echo "the launch failed with code $code, $failures of at most $failures_allowed times without a new tile" >&2
  fi
  if ((failures > failures_allowed)); then
    rm -f "$part.tiles"
    exit "$code"
  fi
  echo "$finished $failures" > "$part.tiles"
  local job=$SLURM_JOB_ID
  if [[ -n ${SLURM_ARRAY_TASK_ID:-} ]]; then
    job=${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID
  fi
  echo "$finished tiles are done; job $job goes into the queue again"
  scontrol requeue "$job"
  # The batch system ends this script.
  sleep 60
  exit "$code"
}
