! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What changes the equations of a motor on the way: the limits of a speed control, the pieces of a table, the end of a ramp.
module motor_limits
  use curve_law, only: piece_at
  use kinds, only: wp
  use motion_state, only: state_t
  use motor_rest, only: equation_mode, is_over, low_series, slips
  use motor_state, only: motor_state_t
  use motor_system, only: guard_integral_down, guard_integral_up, guard_limit_down, guard_limit_up, guard_piece_down, &
    guard_piece_up, guard_ramp_end, guard_resume, motor_system_t
  use tape_series, only: series_t
  implicit none
  private

  public :: active_limits, change_limits, start_limits

  !> Share of a speed that rounding of the instant of an event makes of it.
  real(wp), parameter :: rounding_of_speed = 1024*epsilon(1.0_wp)

contains

  !> Supply, piece of the table and limits at a start; `settled`: a ramp is over.
  pure subroutine start_limits(system, settled, state, crank)
    type(motor_system_t), intent(in) :: system
    logical, intent(in) :: settled
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(inout) :: crank
    associate (control => system%control)
      crank%ramps = control%supply > 0 .and. abs(control%rate) > 0 .and. .not. settled
      crank%supply = merge(control%from, control%to, crank%ramps)
      crank%piece = piece_at(control%curve, crank%w)
      if (.not. control%torque_limit > 0) return
      crank%held = 0
      if (control%largest_integral > 0 .and. abs(crank%own(1)) >= control%largest_integral) then
        crank%held = nint(sign(1.0_wp, crank%own(1)))
      end if
      call release_integral(system, state, crank)
      call choose_limit(system, state, crank)
    end associate
  end subroutine start_limits

  !> At which limit the torque is: where the command is at one to rounding, it is there if the command goes on beyond.
  pure subroutine choose_limit(system, state, crank)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(inout) :: crank
    type(series_t) :: series
    integer :: fault, mode
    mode = equation_mode(slips(state%mode), crank%turning /= 0)
    call low_series(system, mode, state, crank, series, fault)
    associate (guards => system%flights(mode, 0)%guards, room => rounding_of(system))
      crank%limited = 0
      if (is_over(series%c(:, guards(guard_limit_up)%node), 0.0_wp, room)) crank%limited = 1
      if (is_over(-series%c(:, guards(guard_limit_down)%node), 0.0_wp, room)) crank%limited = -1
    end associate
  end subroutine choose_limit

  !> Lets a held integral go where the speed is beyond its reference, or there to rounding and on its way beyond: the torque leaves
  !> its limit at the same instant, and the guard of only one of the two may have crossed.
  pure subroutine release_integral(system, state, crank)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(inout) :: crank
    type(series_t) :: series
    integer :: fault, mode
    if (crank%held == 0) return
    mode = equation_mode(slips(state%mode), crank%turning /= 0)
    call low_series(system, mode, state, crank, series, fault)
    associate (beyond => crank%held*series%c(:, system%flights(mode, 0)%guards(guard_resume)%node))
      if (is_over(beyond, 0.0_wp, rounding_of_speed*abs(crank%w))) crank%held = 0
    end associate
  end subroutine release_integral

  !> What rounding does to a command [N m].
  pure real(wp) function rounding_of(system)
    type(motor_system_t), intent(in) :: system
    rounding_of = 64*epsilon(1.0_wp)*system%control%torque_limit
  end function rounding_of

  !> The guards that end a mode, with their directions, and what rounding does to each.
  pure subroutine active_limits(system, crank, guards, directions, rounding)
    type(motor_system_t), intent(in) :: system
    type(motor_state_t), intent(in) :: crank
    integer, allocatable, intent(out) :: guards(:), directions(:)
    real(wp), intent(out) :: rounding
    allocate (guards(0), directions(0))
    associate (control => system%control)
      rounding = rounding_of(system) + 32*epsilon(1.0_wp)*abs(crank%w)
      if (crank%ramps) call add(guard_ramp_end, nint(sign(1.0_wp, control%rate)), guards, directions)
      if (control%curve%count > 0) then
        if (crank%piece < control%curve%count) call add(guard_piece_up, 1, guards, directions)
        if (crank%piece > 0) call add(guard_piece_down, -1, guards, directions)
      end if
      if (.not. control%torque_limit > 0) return
      if (crank%limited >= 0) call add(guard_limit_up, 1 - 2*crank%limited, guards, directions)
      if (crank%limited <= 0) call add(guard_limit_down, -1 - 2*crank%limited, guards, directions)
      if (.not. control%largest_integral > 0) return
      if (crank%held /= 0) then
        call add(guard_resume, crank%held, guards, directions)
      else
        call add(guard_integral_up, 1, guards, directions)
        call add(guard_integral_down, -1, guards, directions)
      end if
    end associate
  end subroutine active_limits

  pure subroutine add(guard, direction, guards, directions)
    integer, intent(in) :: guard, direction
    integer, allocatable, intent(inout) :: guards(:), directions(:)
    guards = [guards, guard]
    directions = [directions, direction]
  end subroutine add

  !> What happens where one of these guards crossed zero.
  pure subroutine change_limits(system, crossed, state, crank)
    type(motor_system_t), intent(in) :: system
    logical, intent(in) :: crossed(:)
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(inout) :: crank
    if (.not. any(crossed(guard_ramp_end:guard_piece_down))) return
    if (crossed(guard_ramp_end)) then
      crank%supply = system%control%to
      crank%ramps = .false.
    end if
    if (crossed(guard_piece_up)) crank%piece = crank%piece + 1
    if (crossed(guard_piece_down)) crank%piece = crank%piece - 1
    if (crossed(guard_resume)) then
      crank%held = 0
    else if (crossed(guard_integral_up) .or. crossed(guard_integral_down)) then
      crank%held = merge(1, -1, crossed(guard_integral_up))
      crank%own(1) = crank%held*system%control%largest_integral
    end if
    if (.not. system%control%torque_limit > 0) return
    call release_integral(system, state, crank)
    call choose_limit(system, state, crank)
  end subroutine change_limits

end module motor_limits
