#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# sbatch --dependency=afterok:ARRAY_JOB scripts/slurm/merge.sh OUTPUT SHARES
#
# Joins the shares of a map; they are removed once the file has been verified.
#SBATCH --job-name=separatrix-merge
#SBATCH --ntasks=1
#SBATCH --output=%x-%j.log
set -euo pipefail
SEPARATRIX_ROOT=${SEPARATRIX_ROOT:-$SLURM_SUBMIT_DIR}
# shellcheck source=scripts/slurm/common.sh
source "$SEPARATRIX_ROOT/scripts/slurm/common.sh"
output=$1 shares=$2
parts=()
for ((share = 1; share <= shares; share++)); do
  parts+=("$output.shard-$share-of-$shares.part")
done
"$separatrix" merge "$output" "${parts[@]}"
"$separatrix" verify "$output" --sample 20
rm "${parts[@]}"
