! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What long work looks at between its pieces.
module work_watch
  implicit none
  private

  type, abstract, public :: watch_t
  contains
    procedure(look_up), deferred :: look
  end type watch_t

  abstract interface
    !> Hands out work, reports how far the run is; whether to stop.
    subroutine look_up(self, stop_now)
      import :: watch_t
      class(watch_t), intent(inout) :: self
      logical, intent(out) :: stop_now
    end subroutine look_up
  end interface

end module work_watch
