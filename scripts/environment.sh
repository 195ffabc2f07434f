# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# What OpenMPI 4.1 needs on one machine; sourced by the scripts that use mpirun and read by
# tests/CMakeLists.txt (one plain `export NAME=value` per line).

# Run as root, as continuous integration does, and with more ranks than cores.
export OMPI_ALLOW_RUN_AS_ROOT=1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1
# Containers without ptrace.
export OMPI_MCA_btl_vader_single_copy_mechanism=none
# One thread per rank.
export OMP_NUM_THREADS=1
