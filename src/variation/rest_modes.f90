! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine without a clock where nothing moves, of whatever kind: the modes in which it may be, its rates there with their
!> derivatives, and what keeps it in its mode.
module rest_modes
  use hybrid_body, only: rests_on_barrier
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use motion_state, only: mode_lower_barrier, mode_slip_plus, mode_upper_barrier
  use motor_system, only: far
  use own_body, only: own_body_t
  use structure, only: structure_t
  use structure_rest, only: margins_at_rest, misses_at_rest, modes_at_rest, rates_at_rest
  implicit none
  private

  public :: is_linear, margins_of_rest, misses_of_rest, modes_of_rest, rates_of_rest, without_speeds

contains

  !> The modes that a machine may be at rest in; none where dry friction holds it, whose positions of rest are a continuum.
  pure function modes_of_rest(machine) result(modes)
    class(hybrid_t), intent(in) :: machine
    integer, allocatable :: modes(:)
    allocate (modes(0))
    if (machine%has_clock) return
    select type (machine)
    type is (structure_t)
      modes = modes_at_rest(machine)
    type is (own_body_t)
      if (.not. machine%smooth_turns) return
      modes = [mode_slip_plus]
      if (machine%upper < far) modes = [modes, mode_upper_barrier]
      if (machine%lower > -far) modes = [modes, mode_lower_barrier]
    end select
  end function modes_of_rest

  !> Time derivatives of the coordinates in a mode, and the derivatives of those by the coordinates.
  pure subroutine rates_of_rest(machine, mode, y, slope, by_state)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp), intent(out) :: slope(:), by_state(:, :)
    slope = 0
    by_state = 0
    select type (machine)
    type is (structure_t)
      call rates_at_rest(machine, mode, y, slope, by_state)
    type is (own_body_t)
      call machine%rates_at(mode, y, slope, by_state)
    end select
  end subroutine rates_of_rest

  !> What is zero where nothing moves: the rates, and how far the coordinates are from what the mode holds.
  pure function misses_of_rest(machine, mode, y) result(misses)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp) :: misses(2*size(y)), held(size(y)), slope(size(y)), by_state(size(y), size(y))
    select type (machine)
    type is (structure_t)
      misses = misses_at_rest(machine, mode, y)
    class default
      call machine%fly(mode, 0.0_wp, y, 0.0_wp, held)
      call rates_of_rest(machine, mode, y, slope, by_state)
      misses = [slope, y - held]
    end select
  end function misses_of_rest

  !> What is positive where the mode lasts: distances from barriers [m], or what a barrier holds against [N].
  pure function margins_of_rest(machine, mode, y) result(margins)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp), allocatable :: margins(:)
    real(wp) :: by_state(size(y)), by_time
    select type (machine)
    type is (structure_t)
      margins = margins_at_rest(machine, mode, y)
    type is (own_body_t)
      if (rests_on_barrier(mode)) then
        allocate (margins(1))
        call machine%release_margin(merge(-1, 1, mode == mode_upper_barrier), 0.0_wp, y, margins(1), by_state, by_time)
      else
        margins = [machine%upper - y(1), y(1) - machine%lower]
      end if
    class default
      allocate (margins(0))
    end select
  end function margins_of_rest

  !> Whether a mode has one equilibrium at most.
  pure logical function is_linear(machine)
    class(hybrid_t), intent(in) :: machine
    is_linear = .false.
    select type (machine)
    type is (structure_t)
      is_linear = machine%frame%moving%machine%linear
    end select
  end function is_linear

  !> A state without speeds.
  pure function without_speeds(machine, state) result(y)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: state(:)
    real(wp) :: y(size(state))
    integer :: speeds
    speeds = 1
    select type (machine)
    type is (structure_t)
      speeds = machine%frame%speeds
    end select
    y = state
    y(machine%positions + 1:machine%positions + speeds) = 0
  end function without_speeds

end module rest_modes
