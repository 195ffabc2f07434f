! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Receives the progress of a search for branches.
module search_watch
  implicit none
  private

  type, abstract, public :: search_watch_t
  contains
    procedure(report_start), deferred :: report_start
    procedure(report_point), deferred :: report_point
  end type search_watch_t

  abstract interface
    !> Another start was tried at a value of the parameter.
    subroutine report_start(self)
      import :: search_watch_t
      class(search_watch_t), intent(inout) :: self
    end subroutine report_start

    !> The branch under way has this many points, the last at this value of the parameter.
    subroutine report_point(self, points, parameter)
      use kinds, only: wp
      import :: search_watch_t
      class(search_watch_t), intent(inout) :: self
      integer, intent(in) :: points
      real(wp), intent(in) :: parameter
    end subroutine report_point
  end interface

end module search_watch
