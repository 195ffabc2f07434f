! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

! The only choice between the serial and the MPI build in this layer.
#ifdef SEPARATRIX_MPI
#include "mpi/mpi_team.f90"
#include "mpi/mpi_node.f90"
#include "mpi/mpi_scheduler.f90"
#include "mpi/parallel.f90"
#else
#include "serial/parallel.f90"
#endif
