# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# What the batch scripts of this folder share; docs/batch.md describes their use.

separatrix=${SEPARATRIX:-$SEPARATRIX_ROOT/build/bin/separatrix}

# Ranks of one job that run on other hosts get the same variables.
# shellcheck source=scripts/environment.sh
source "$SEPARATRIX_ROOT/scripts/environment.sh"

# Tiles done in a working file; 0 if there is none.
tiles_done() {
  if [[ -e $1 ]]; then
    "$separatrix" info "$1" --json | sed -n 's/.*"tiles_done": \([0-9]*\).*/\1/p'
  else
    echo 0
  fi
}

# end_job CODE FILE.part: after code 75 puts the job into the queue again, unless no tile was finished since its last
# start: then it would never end. Any other code ends the job.
end_job() {
  local code=$1 part=$2 finished before=0
  if ((code != 75)); then
    rm -f "$part.tiles"
    exit "$code"
  fi
  finished=$(tiles_done "$part")
  if [[ -e $part.tiles ]]; then
    before=$(< "$part.tiles")
  fi
  if ((finished <= before)); then
    echo "no tile was finished since the last start ($finished are done): the job needs more time, or smaller tiles" >&2
    exit 75
  fi
  echo "$finished" > "$part.tiles"
  local job=$SLURM_JOB_ID
  if [[ -n ${SLURM_ARRAY_TASK_ID:-} ]]; then
    job=${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID
  fi
  echo "$finished tiles are done; job $job goes into the queue again"
  scontrol requeue "$job"
  # The batch system ends this script.
  sleep 60
  exit 75
}
