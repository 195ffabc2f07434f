! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Continuation by pseudo-arclength: steps along a curve are tried, halved where they fail or turn too far, and taken, up to an end.
!> What the curve is of is an extension: periodic orbits, equilibria, points of one label over two parameters.
module continuation
  use branch_point, only: label_long, no_label
  use kinds, only: wp
  implicit none
  private

  type, abstract, public :: continuation_t
    !> Length of the next step, in natural sizes, and how often one has been tried from this point.
    real(wp) :: step = 0
    integer :: tries = 0
    !> Turn of the tangent in one step [cosine].
    real(wp) :: least_cosine = 0.95_wp
    !> Label of the end, once it is reached.
    integer :: ending = no_label
  contains
    procedure(count_points), deferred :: points_found
    procedure(try_neighbour), deferred :: try_step
    procedure(go_on), deferred :: take_step, give_up
    procedure :: follow
  end type continuation_t

  abstract interface
    pure integer function count_points(self)
      import :: continuation_t
      class(continuation_t), intent(in) :: self
    end function count_points

    !> Looks for the neighbour `step` further; `cosine` of the turn of the tangent to it.
    subroutine try_neighbour(self, cosine, ok)
      import :: continuation_t, wp
      class(continuation_t), intent(inout) :: self
      real(wp), intent(out) :: cosine
      logical, intent(out) :: ok
    end subroutine try_neighbour

    !> `take_step` goes to the neighbour that was tried, notes what is passed on the way and sets the next step; `give_up` ends the
    !> curve, or finds another way on, where no step is short enough. Either may end it.
    subroutine go_on(self)
      import :: continuation_t
      class(continuation_t), intent(inout) :: self
    end subroutine go_on
  end interface

contains

  !> Follows the curve from where it is to an end, or to the most points, from the step `first` on; none is below `smallest`.
  subroutine follow(self, first, smallest, most_points)
    class(continuation_t), intent(inout) :: self
    real(wp), intent(in) :: first, smallest
    integer, intent(in) :: most_points
    real(wp) :: cosine
    logical :: ok
    self%step = first
    do while (self%ending == no_label .and. self%points_found() < most_points)
      self%tries = self%tries + 1
      call self%try_step(cosine, ok)
      if (ok) ok = cosine > self%least_cosine
      if (.not. ok) then
        self%step = self%step/2
        if (self%step >= smallest) cycle
        call self%give_up()
      else
        call self%take_step()
      end if
      self%tries = 0
    end do
    if (self%ending == no_label) self%ending = label_long
  end subroutine follow

end module continuation
