! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The ranks of a run as processes that take part in a search for branches.
module search_team
  use kinds, only: wp
  use search_state, only: workers_t
  use team, only: team_t
  implicit none
  private

  !> The team outlives this.
  type, extends(workers_t), public :: search_team_t
    class(team_t), pointer :: team => null()
  contains
    procedure :: count => count_ranks
    procedure :: own_number
    procedure :: exchange
  end type search_team_t

contains

  integer function count_ranks(self)
    class(search_team_t), intent(in) :: self
    count_ranks = self%team%size()
  end function count_ranks

  integer function own_number(self)
    class(search_team_t), intent(in) :: self
    own_number = self%team%rank()
  end function own_number

  subroutine exchange(self, own, all_numbers)
    class(search_team_t), intent(in) :: self
    real(wp), intent(in), contiguous :: own(:)
    real(wp), allocatable, intent(out) :: all_numbers(:)
    call self%team%allgather(own, all_numbers)
  end subroutine exchange

end module search_team
