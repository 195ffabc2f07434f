! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which positions of rest belong together: friction holds a body anywhere in a range, but the two stops of a body that falls over
!> are two attractors.
module rest_sets
  use attractors, only: attractor_t
  use circle, only: point_near
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: tally_t
  implicit none
  private

  public :: rest_set_of

  !> Positions between two of rest at which a body has to stay.
  integer, parameter :: positions_between = 15

contains

  !> Index of the positions of rest in a catalogue to which a section point at rest belongs, 0 if none.
  pure integer function rest_set_of(moving, catalogue, point) result(found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: point(:)
    integer :: k
    do k = 1, size(catalogue)
      if (.not. catalogue(k)%rests) cycle
      found = k
      if (are_joined(moving, point, catalogue(k)%points(:, 1))) return
    end do
    found = 0
  end function rest_set_of

  !> Whether a body stays everywhere on the line from one position of rest to another. Forces that are linear, of springs that
  !> pull back, with friction and stops have equilibria that form a convex set. Two bodies rest by moving as one, at any position.
  pure logical function are_joined(moving, one, other) result(joined)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: one(:), other(:)
    real(wp) :: from(moving%coordinates()), to(moving%coordinates())
    integer :: i
    joined = moving%one_rest_set
    ! A crank is held, wherever that is, or turns beside a body at rest.
    if (.not. moving%timed) joined = (abs(one(3)) > 0) .eqv. (abs(other(3)) > 0)
    if (joined .or. .not. moving%timed) return
    to = other(:size(to))
    from = point_near(one(:size(from)), to, moving%turn_on_section())
    joined = .not. any(abs(to - from) > 0)
    ! What section points leave open, such as how far an elastic friction is stretched, may be what holds them.
    if (.not. joined) joined = .not. (stays(moving, from) .and. stays(moving, to))
    if (joined) return
    do i = 1, positions_between
      if (.not. stays(moving, from + (i*(to - from))/(positions_between + 1))) return
    end do
    joined = .true.
  end function are_joined

  !> Whether nothing moves for a period from a section point on.
  pure logical function stays(moving, point)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    type(section_state_t) :: section
    type(tally_t) :: tally
    integer :: reason
    section = moving%state_at(point)
    call moving%begin_tally(section, tally)
    call moving%advance_to_section(section, tally, reason)
    stays = reason == 0 .and. tally%slips == 0
  end function stays

end module rest_sets
