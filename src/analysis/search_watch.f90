! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Who is told how far a search for branches is.
module search_watch
  implicit none
  private

  type, abstract, public :: search_watch_t
  contains
    procedure(tell_start), deferred :: tell_start
    procedure(tell_point), deferred :: tell_point
  end type search_watch_t

  abstract interface
    !> Another start was tried at a value of the parameter.
    subroutine tell_start(self)
      import :: search_watch_t
      class(search_watch_t), intent(inout) :: self
    end subroutine tell_start

    !> The branch under way has this many points, the last at this value of the parameter.
    subroutine tell_point(self, points, parameter)
      use kinds, only: wp
      import :: search_watch_t
      class(search_watch_t), intent(inout) :: self
      integer, intent(in) :: points
      real(wp), intent(in) :: parameter
    end subroutine tell_point
  end interface

end module search_watch
