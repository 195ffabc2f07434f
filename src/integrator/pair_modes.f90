! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The modes of two bodies coupled by dry friction, each a linear motion: slip in either direction, stick, the driven
!> body leaning on its stop while the driving one slides, and both held there. Which mode follows when the bodies move
!> together is Filippov's rule with the acceleration that they have together.
module pair_modes
  use elementary, only: sine_cosine
  use kinds, only: wp
  use linear_flow, only: bound_of, bound_t, linear_t, most_unknowns, prepare_linear, tabulate
  use motion_state, only: mode_held, mode_lower_barrier, mode_slip_minus, mode_slip_plus, mode_stick, &
    mode_upper_barrier, options_t
  use pair, only: driven_by_controller, driven_by_force, driven_by_motion, pair_t
  implicit none
  private

  public :: prepare_pair, stop_row, interface_row, refresh, mode_together, mode_of_slip, sense_of, control_now, speed_size, &
    stands, with_clocks

  !> Unknowns: both bodies, cosine and sine of the drive, one, integral of the control error, velocity of the drive
  !> times time, control held between samples.
  integer, parameter, public :: at_x1 = 1, at_v1 = 2, at_x2 = 3, at_v2 = 4, at_cosine = 5, at_sine = 6, at_one = 7, &
    at_integral = 8, at_ramp = 9, at_control = 10

  !> What is looked at along the way: distance from the upper stop and from the lower one, relative velocity (of m1 where m2 rests
  !> on a stop), what the interface has left in either direction, velocity of m2 and its rate. The first five are guards.
  integer, parameter, public :: of_upper = 1, of_lower = 2, of_slip = 3, of_plus = 4, of_minus = 5, of_driven = 6, of_rate = 7

  !> A rebound that the forces end within this share of a period is none.
  real(wp), parameter :: briefest_bounce = 1e-10_wp

  type, public :: pair_state_t
    real(wp) :: y(most_unknowns) = 0
    !> Since the section [s].
    real(wp) :: time = 0
    integer :: mode = 0
    !> The stop that m2 rests on, or has just left: +1 upper, -1 lower, 0 none.
    integer :: touch = 0
    !> The soft stop that m2 presses, how deep [m], and the speed at which it met it [m/s].
    integer :: pressed = 0
    real(wp) :: penetration = 0, touch_speed = 0
    !> The blow has fallen; the next sample of the controller [s], both in time since the start.
    logical :: struck = .false.
    real(wp) :: clock = 0
    integer :: samples = 0
  end type pair_state_t

  !> A pair ready to move.
  type, public :: pair_motion_t
    type(pair_t) :: machine
    type(options_t) :: options
    type(linear_t) :: modes(mode_held)
    !> Of what is looked at along the way in each mode.
    type(bound_t) :: bounds(of_rate, mode_held)
    !> As linear functions of the unknowns: force on m1 without the interface [N], or the acceleration of a given motion
    !> [m/s^2]; acceleration that the bodies have together; interface force then; reference and its rate; control.
    real(wp), dimension(most_unknowns) :: push = 0, together = 0, interface = 0, reference = 0, reference_rate = 0, &
      control = 0
    !> Force of the drive on m1 [N].
    real(wp), dimension(most_unknowns) :: drive = 0
    !> Rates of the two that decide, while the bodies move together or are held.
    real(wp), dimension(most_unknowns) :: push_rate = 0, interface_rate = 0
    !> What friction holds of `push` on the stop [as push]: b, or nothing where the motion of m1 is given.
    real(wp) :: threshold = 0
    !> Sizes of force and push, for the rounding of ties; force of the spring per velocity [N s/m], displacement [s].
    real(wp) :: force_scale = 0, push_scale = 0, impedance = 0, swing = 0
    !> Speed at which m2 meets a stop without rebound [m/s]: rounding.
    real(wp) :: negligible_speed = 0
    !> Size of the velocity of a given motion [m/s], for its rounding.
    real(wp) :: driving_speed = 0
    !> The stops leave no room.
    logical :: clamped = .false.
  end type pair_motion_t

contains

  !> Prepares a pair.
  pure subroutine prepare_pair(machine, options, moving)
    type(pair_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    type(pair_motion_t), intent(out) :: moving
    real(wp) :: bodies(most_unknowns, most_unknowns)
    integer :: s
    moving%machine = machine
    moving%options = options
    moving%clamped = machine%lower >= machine%upper .and. .not. machine%contact%soft
    call set_rows(machine, moving)
    moving%negligible_speed = briefest_bounce*machine%period*moving%push_scale
    if (machine%drive /= driven_by_motion) moving%negligible_speed = moving%negligible_speed/(machine%mass + machine%driven_mass)
    moving%negligible_speed = moving%negligible_speed + briefest_bounce*machine%period*machine%friction/machine%driven_mass
    do s = -1, 1, 2
      bodies = 0
      call drive_body(moving, real(s, wp), bodies)
      bodies(at_x2, at_v2) = 1
      bodies(at_v2, at_one) = s*machine%friction/machine%driven_mass
      moving%modes(mode_of_slip(s)) = prepare_linear(with_clocks(moving, bodies))
      bodies = 0
      call drive_body(moving, real(s, wp), bodies)
      moving%modes(merge(mode_upper_barrier, mode_lower_barrier, s > 0)) = prepare_linear(with_clocks(moving, bodies))
    end do
    bodies = 0
    bodies(at_x1, at_v1) = 1
    bodies(at_x2, at_v2) = 1
    bodies(at_v1, :) = moving%together
    bodies(at_v2, :) = moving%together
    moving%modes(mode_stick) = prepare_linear(with_clocks(moving, bodies))
    bodies = 0
    moving%modes(mode_held) = prepare_linear(with_clocks(moving, bodies))
    moving%interface_rate = matmul(moving%interface, moving%modes(mode_stick)%matrix)
    moving%push_rate = matmul(moving%push, moving%modes(mode_held)%matrix)
    do s = 1, mode_held
      call tabulate(moving%modes(s))
      call set_bounds(moving, s)
    end do
  end subroutine prepare_pair

  !> Bounds along the flights of a mode.
  pure subroutine set_bounds(moving, mode)
    type(pair_motion_t), intent(inout) :: moving
    integer, intent(in) :: mode
    real(wp) :: rows(most_unknowns, of_rate)
    integer :: i
    rows(:, of_upper) = stop_row(moving, 1)
    rows(:, of_lower) = stop_row(moving, -1)
    rows(:, of_slip) = 0
    rows(at_v1, of_slip) = 1
    if (mode == mode_slip_plus .or. mode == mode_slip_minus) rows(at_v2, of_slip) = -1
    rows(:, of_plus) = interface_row(moving, 1)
    rows(:, of_minus) = interface_row(moving, -1)
    rows(:, of_driven) = 0
    rows(at_v2, of_driven) = 1
    rows(:, of_rate) = moving%modes(mode)%matrix(at_v2, :)
    do i = 1, of_rate
      moving%bounds(i, mode) = bound_of(moving%modes(mode), rows(:, i))
    end do
  end subroutine set_bounds

  !> Distance of m2 from the stop on a side; infinite where there is none.
  pure function stop_row(moving, side) result(row)
    type(pair_motion_t), intent(in) :: moving
    integer, intent(in) :: side
    real(wp) :: row(most_unknowns)
    row = 0
    row(at_x2) = -side
    if (moving%machine%carried) row(at_x1) = side
    row(at_one) = side*merge(moving%machine%upper, moving%machine%lower, side > 0)
  end function stop_row

  !> What the interface has left in a direction.
  pure function interface_row(moving, direction) result(row)
    type(pair_motion_t), intent(in) :: moving
    integer, intent(in) :: direction
    real(wp) :: row(most_unknowns)
    row = -direction*moving%interface
    row(at_one) = row(at_one) + moving%machine%friction
  end function interface_row

  !> The linear functions that drive and decide.
  pure subroutine set_rows(machine, moving)
    type(pair_t), intent(in) :: machine
    type(pair_motion_t), intent(inout) :: moving
    real(wp) :: w
    w = machine%frequency
    associate (reference => moving%reference, rate => moving%reference_rate, push => moving%push)
      reference(at_cosine) = machine%amplitude
      reference(at_sine) = machine%quadrature
      reference(at_one) = machine%mean
      reference(at_ramp) = 1
      rate(at_cosine) = w*machine%quadrature
      rate(at_sine) = -w*machine%amplitude
      rate(at_one) = machine%velocity
      moving%control = machine%proportional*reference + machine%derivative*rate
      moving%control(at_x1) = -machine%proportional
      moving%control(at_v1) = -machine%derivative
      moving%control(at_integral) = machine%integral
      if (machine%drive == driven_by_motion) then
        push(at_cosine) = -w**2*machine%amplitude
        push(at_sine) = -w**2*machine%quadrature
        moving%together = push
        moving%push_scale = sum(abs(push))
        moving%driving_speed = sum(abs(rate))
        moving%force_scale = machine%driven_mass*moving%push_scale + machine%friction
      else
        push(at_x1) = -machine%stiffness
        push(at_v1) = -machine%damping
        push(at_one) = machine%stiffness*machine%free_length
        call set_drive(machine, moving)
        push = push + moving%drive
        moving%together = push/(machine%mass + machine%driven_mass)
        moving%threshold = machine%friction
        moving%push_scale = machine%friction + sum(abs(push(at_cosine:at_one)))
        moving%force_scale = moving%push_scale
        moving%impedance = sqrt((machine%mass + machine%driven_mass)*max(0.0_wp, -push(at_x1)))
        if (moving%impedance > 0) moving%swing = (machine%mass + machine%driven_mass)/moving%impedance
      end if
    end associate
    moving%interface = machine%driven_mass*moving%together
  end subroutine set_rows

  pure subroutine set_drive(machine, moving)
    type(pair_t), intent(in) :: machine
    type(pair_motion_t), intent(inout) :: moving
    if (machine%drive == driven_by_force) then
      moving%drive = moving%reference
      moving%drive(at_ramp) = 0
    else if (machine%sample_time > 0) then
      moving%drive(at_control) = 1
    else
      moving%drive = moving%control
    end if
  end subroutine set_drive

  !> Rows of m1 while it slides in `direction` over m2.
  pure subroutine drive_body(moving, direction, matrix)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: direction
    real(wp), intent(inout) :: matrix(most_unknowns, most_unknowns)
    matrix(at_x1, at_v1) = 1
    if (moving%machine%drive == driven_by_motion) then
      matrix(at_v1, :) = moving%push
    else
      matrix(at_v1, :) = moving%push/moving%machine%mass
      matrix(at_v1, at_one) = matrix(at_v1, at_one) - direction*moving%machine%friction/moving%machine%mass
    end if
  end subroutine drive_body

  !> Adds the rows of what turns, ramps and adds up.
  pure function with_clocks(moving, bodies) result(matrix)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: bodies(most_unknowns, most_unknowns)
    real(wp) :: matrix(most_unknowns, most_unknowns)
    matrix = bodies
    matrix(at_cosine, at_sine) = -moving%machine%frequency
    matrix(at_sine, at_cosine) = moving%machine%frequency
    matrix(at_ramp, at_one) = moving%machine%velocity
    if (moving%machine%drive == driven_by_controller .and. .not. moving%machine%sample_time > 0) then
      matrix(at_integral, :) = moving%reference
      matrix(at_integral, at_x1) = -1
    end if
  end function with_clocks

  !> Sets what the time alone decides.
  pure subroutine refresh(moving, state)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    call sine_cosine(moving%machine%frequency*state%time, state%y(at_sine), state%y(at_cosine))
    state%y(at_one) = 1
    if (moving%machine%drive /= driven_by_motion) return
    state%y(at_x1) = sum(moving%reference*state%y)
    state%y(at_v1) = sum(moving%reference_rate*state%y)
    if (state%mode == mode_stick) state%y(at_v2) = state%y(at_v1)
  end subroutine refresh

  !> Control that the controller would put out now [N].
  pure real(wp) function control_now(moving, state)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    control_now = sum(moving%control*state%y)
  end function control_now

  !> Size of the velocity of m1 [m/s], for its rounding: of the given motion, or of the swing that it is part of.
  pure real(wp) function speed_size(moving, state)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    speed_size = max(moving%driving_speed, abs(state%y(at_v1)))
    if (moving%swing > 0) speed_size = max(speed_size, abs(state%y(at_x1))/moving%swing)
  end function speed_size

  !> Whether a velocity [m/s] is zero to the rounding of that of m1.
  pure logical function stands(moving, state, velocity)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    real(wp), intent(in) :: velocity
    stands = abs(velocity) <= 64*epsilon(1.0_wp)*speed_size(moving, state)
  end function stands

  !> Slip mode of the relative velocity v1 - v2 with sign `s`.
  pure elemental integer function mode_of_slip(s)
    integer, intent(in) :: s
    mode_of_slip = merge(mode_slip_plus, mode_slip_minus, s > 0)
  end function mode_of_slip

  !> Sign of v1 - v2 in a mode, 0 where the bodies move together.
  pure elemental integer function sense_of(mode)
    integer, intent(in) :: mode
    sense_of = 0
    if (mode == mode_slip_plus .or. mode == mode_upper_barrier) sense_of = 1
    if (mode == mode_slip_minus .or. mode == mode_lower_barrier) sense_of = -1
  end function sense_of

  !> Sets the mode that follows where v1 = v2, m2 being at rest on its stop where `state%touch` says so.
  pure subroutine mode_together(moving, state)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp) :: push, rate, spring
    integer :: s
    spring = moving%impedance*abs(state%y(at_v1))
    if (state%touch /= 0 .and. .not. moving%machine%carried) then
      push = state%touch*sum(moving%push*state%y)
      rate = state%touch*sum(moving%push_rate*state%y)
      if (exceeds(push - moving%threshold, rate, moving%push_scale + spring + abs(push))) then
        state%mode = merge(mode_upper_barrier, mode_lower_barrier, state%touch > 0)
        return
      else if (moving%clamped .and. exceeds(-push - moving%threshold, -rate, moving%push_scale + spring + abs(push))) then
        state%touch = -state%touch
        state%mode = merge(mode_upper_barrier, mode_lower_barrier, state%touch > 0)
        return
      else if (moving%clamped .or. .not. exceeds(-push, -rate, moving%push_scale + spring + abs(push))) then
        state%mode = mode_held
        return
      end if
    end if
    state%mode = mode_stick
    push = sum(moving%interface*state%y)
    rate = sum(moving%interface_rate*state%y)
    do s = -1, 1, 2
      if (.not. exceeds(s*push - moving%machine%friction, s*rate, moving%force_scale + spring + abs(push))) cycle
      ! A stop carried by m1 keeps m2 from running ahead of it.
      if (moving%machine%carried .and. state%touch == -s) cycle
      if (moving%machine%carried .and. moving%clamped) cycle
      state%mode = mode_of_slip(s)
    end do
  end subroutine mode_together

  !> Whether a reserve is used up: above zero, or at zero to rounding and rising.
  pure logical function exceeds(excess, rate, scale)
    real(wp), intent(in) :: excess, rate, scale
    if (abs(excess) <= 32*epsilon(1.0_wp)*scale) then
      exceeds = rate > 0
    else
      exceeds = excess > 0
    end if
  end function exceeds

end module pair_modes
