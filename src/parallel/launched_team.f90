! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The team of the processes that were started together; MPI is started only where there are several.
module launched_team
  use launcher, only: launched_ranks
  use parallel, only: start_team
  use serial_team, only: serial_team_t
  use team, only: team_t
  implicit none
  private

  public :: start_launched_team

contains

  subroutine start_launched_team(team)
    class(team_t), allocatable, intent(out) :: team
    if (launched_ranks() == 1) then
      allocate (serial_team_t :: team)
    else
      call start_team(team)
    end if
  end subroutine start_launched_team

end module launched_team
