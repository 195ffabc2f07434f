! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The pieces of its tables that a slip is in, and where it leaves them: a flight that keeps to a piece until there meets no
!> kink of a table within a step.
module table_pieces
  use curve_law, only: curve_t, piece_at, piece_limits
  use effect_law, only: effects_t, slip_memory_t
  use kinds, only: wp
  implicit none
  private

  public :: enter_pieces, list_ends, margin_of_end

  !> Variables of tables: extension of the spring, position, speed in the direction of the slip.
  integer, parameter, public :: of_extension = 1, of_position = 2, of_speed = 3
  !> Margins that are not linear in the state: of the extension of the spring below a constant, and above it; of the
  !> force of a soft barrier that ends, and that comes back.
  integer, parameter, public :: extension_below = 1, extension_above = 2, push_ends = 3, push_returns = 4
  !> Two each of spring, play, force, factor of dry friction, friction.
  integer, parameter, public :: most_ends = 10

  !> A variable leaves its piece above (side 1) or below (side -1) a limit [m, m/s].
  type, public :: piece_end_t
    integer :: variable = 0, side = 0
    real(wp) :: limit = 0
  end type piece_end_t

contains

  !> Keeps `slip` to the pieces that it is in at `x` [m], `v` [m/s] and an `extension` [m] of the spring.
  pure subroutine enter_pieces(effects, x, v, extension, slip)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: x, v, extension
    type(slip_memory_t), intent(inout) :: slip
    slip%in_spring = piece_at(effects%spring, extension)
    slip%in_play = piece_at(effects%play, extension)
    slip%in_force = piece_at(effects%force, x)
    slip%in_position = piece_at(effects%over_position, x)
    if (slip%direction > 0) then
      slip%in_speed = piece_at(effects%upwards, v)
    else
      slip%in_speed = piece_at(effects%downwards, -v)
    end if
  end subroutine enter_pieces

  !> Where a slip that keeps to its pieces leaves them.
  pure subroutine list_ends(effects, slip, ends, count_ends)
    type(effects_t), intent(in) :: effects
    type(slip_memory_t), intent(in) :: slip
    type(piece_end_t), intent(out) :: ends(most_ends)
    integer, intent(out) :: count_ends
    count_ends = 0
    call add_ends(effects%spring, slip%in_spring, of_extension, ends, count_ends)
    call add_ends(effects%play, slip%in_play, of_extension, ends, count_ends)
    call add_ends(effects%force, slip%in_force, of_position, ends, count_ends)
    call add_ends(effects%over_position, slip%in_position, of_position, ends, count_ends)
    if (slip%direction > 0) then
      call add_ends(effects%upwards, slip%in_speed, of_speed, ends, count_ends)
    else
      call add_ends(effects%downwards, slip%in_speed, of_speed, ends, count_ends)
    end if
  end subroutine list_ends

  !> How far a slip in `direction` is from an end: constant + row(1) x + row(2) v, and for the extension the `number` of a
  !> margin to be added, else 0.
  pure subroutine margin_of_end(one, direction, constant, row, number)
    type(piece_end_t), intent(in) :: one
    real(wp), intent(in) :: direction
    real(wp), intent(out) :: constant, row(2)
    integer, intent(out) :: number
    constant = one%side*one%limit
    row = 0
    number = 0
    if (one%variable == of_position) row(1) = -one%side
    if (one%variable == of_speed) row(2) = -one%side*direction
    if (one%variable == of_extension) number = merge(extension_below, extension_above, one%side > 0)
  end subroutine margin_of_end

  pure subroutine add_ends(curve, piece, variable, ends, count_ends)
    type(curve_t), intent(in) :: curve
    integer, intent(in) :: piece, variable
    type(piece_end_t), intent(inout) :: ends(most_ends)
    integer, intent(inout) :: count_ends
    real(wp) :: limits(2)
    integer :: i
    if (curve%count == 0) return
    limits = piece_limits(curve, piece)
    do i = 1, 2
      if (.not. abs(limits(i)) < huge(1.0_wp)) cycle
      count_ends = count_ends + 1
      ends(count_ends) = piece_end_t(variable, 2*i - 3, limits(i))
    end do
  end subroutine add_ends

end module table_pieces
