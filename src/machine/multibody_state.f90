! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> State of a multibody structure and of each of its joints, and the forces of the joints that follow from the state.
module multibody_state
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use elementary, only: sine_cosine
  use joint_forces, only: acts_as_spring, is_curved, is_held, joint_energy, joint_force, spring_force, spring_terms, strength_now
  use multibody, only: controller_t, joint_contact, load_t, multibody_t, most_degrees, most_joints, source_t, wave_value
  use kinds, only: int64, wp
  use tape_series, only: expand, prepare_series, series_t
  use tape_value, only: evaluate, sizes_of_nodes
  implicit none
  private

  public :: turning_at, joint_motion, joint_force, spring_force, spring_terms, strength_now, joint_energy, free_force, &
    running_control, rounding_of_speed, key_of, is_held, acts_as_spring, is_curved, is_marched, factor_now, load_branches, &
    load_variables, sizes_of_variables

  !> Phases of a joint. Friction, elastic or not: sticks (0), slides up or down (+1, -1). Contact: open (0), closed at its
  !> upper or lower stop (+1, -1). Soft contact: open (0), pressed (+1, -1), without force but not yet free (+2, -2). Section: not
  !> looked for (0), the watched coordinate moves towards it (+1) or away (-1).
  type, public :: multibody_state_t
    real(wp) :: q(most_degrees) = 0, v(most_degrees) = 0
    !> Since the section [s].
    real(wp) :: time = 0
    integer :: phase(most_joints) = 0
    !> Position of the slider of elastic friction [m]; speed at which a soft contact began [m/s].
    real(wp) :: slider(most_joints) = 0, touch_speed(most_joints) = 0
    !> The joint has just changed its phase: the guard of its new phase starts at zero. +1, -1: the stop it has left.
    integer :: left(most_joints) = 0
    !> Impacts in a row with next to no time between them; lanes and the event loop hand it to each other.
    integer :: burst = 0
    !> Fastest impact of the burst, the first excepted [m/s].
    real(wp) :: burst_speed = 0
    !> Time of the section since the start [s]; impulses given, samples of a controller taken, the force that it holds [N] and
    !> the integral of what it has seen [m s].
    real(wp) :: clock = 0, control = 0, integral = 0
    integer :: struck = 0, samples = 0
    !> The motion without a clock has just reached the section.
    logical :: at_section = .false.
  end type multibody_state_t

contains

  !> exp(i m Omega t) for m = 1, 2, ... at `time` [s].
  pure function turning_at(frequency, time, harmonics) result(turning)
    real(wp), intent(in) :: frequency, time
    integer, intent(in) :: harmonics
    complex(wp) :: turning(harmonics)
    real(wp) :: sine, cosine
    integer :: m
    do m = 1, harmonics
      call sine_cosine(m*frequency*time, sine, cosine)
      turning(m) = cmplx(cosine, sine, wp)
    end do
  end function turning_at

  !> Coordinate, speed and the given part of the acceleration of a joint.
  pure subroutine joint_motion(machine, j, q, v, time, turning, s, u, given)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    real(wp), intent(in) :: q(:), v(:), time
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: s, u
    real(wp), intent(out), optional :: given
    real(wp) :: value, rate
    associate (joint => machine%joints(j))
      call wave_value(joint%offset, machine%frequency, time, turning, value, rate, given)
      s = sum(joint%row*q(:machine%n)) + value
      u = sum(joint%row*v(:machine%n)) + rate
      if (.not. allocated(joint%memory)) return
      ! Deflection and sliding speed are what the forces of friction with memory depend on.
      call wave_value(joint%memory%slide%offset, machine%frequency, time, turning, value, rate, given)
      s = sum(joint%memory%deflection*v(:machine%n))
      u = sum(joint%memory%slide%row*v(:machine%n)) + rate
    end associate
  end subroutine joint_motion

  !> Rounding of the speed of a joint [m/s].
  pure real(wp) function rounding_of_speed(machine, j, state) result(negligible)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    type(multibody_state_t), intent(in) :: state
    associate (joint => machine%joints(j), n => machine%n)
      negligible = 64*epsilon(1.0_wp)*(sum(abs(joint%row*state%v(:n))) + abs(joint%offset%rate))
    end associate
  end function rounding_of_speed

  !> Whether a mode has a joint whose force is not linear.
  pure logical function is_marched(machine, phase)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: phase(:)
    integer :: j
    is_marched = .false.
    if (machine%linear) return
    do j = 1, size(machine%joints)
      if (is_curved(machine%joints(j), phase(j))) is_marched = .true.
    end do
  end function is_marched

  !> One bit for each joint that is a constraint or a spring.
  pure integer(int64) function key_of(machine, phase)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: phase(:)
    integer :: j
    key_of = 0
    do j = 1, size(machine%joints)
      if (is_held(machine%joints(j), phase(j)) .or. acts_as_spring(machine%joints(j), phase(j))) key_of = ibset(key_of, j - 1)
    end do
  end function key_of

  !> What the force of joint `j` is multiplied by, and its first two derivatives by the time: that of a spring by its strength,
  !> friction by its normal force [N], whose derivatives need the accelerations `a` and their rates.
  pure subroutine factor_now(machine, j, state, turning, factor, a, jerk)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: factor(0:2)
    real(wp), intent(in), optional :: a(:), jerk(:)
    if (.not. allocated(machine%joints(j)%load)) then
      call strength_now(machine%joints(j), machine%frequency, turning, factor(0), factor(1), factor(2))
      return
    end if
    associate (load => machine%joints(j)%load)
      block
        type(series_t) :: series
        integer :: branches(size(load%tape%switches)), fault
        real(wp) :: variables(size(load%rates)), parameters(size(load%parameters))
        parameters = load%parameters
        if (load%slip > 0) parameters(load%slip) = state%phase(j)
        call load_variables(machine, load, state, turning, variables, a, jerk)
        call load_branches(load, parameters, variables, sizes_of_variables(machine, load, state), branches)
        call prepare_series(load%tape, 2, load%rates, [load%node], branches, series)
        call expand(load%tape, variables, parameters, series, fault)
        factor = series%c(:, load%node)*[1, 1, 2]
        if (fault /= 0) factor = ieee_value(factor, ieee_quiet_nan)
      end block
    end associate
  end subroutine factor_now

  !> The variables of a normal force: the time, the phase, and of each source its value and three derivatives by the time.
  pure subroutine load_variables(machine, load, state, turning, variables, a, jerk)
    type(multibody_t), intent(in) :: machine
    type(load_t), intent(in) :: load
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: variables(:)
    real(wp), intent(in), optional :: a(:), jerk(:)
    real(wp) :: motion(0:3)
    integer :: i, n
    n = machine%n
    variables(:2) = [state%time, machine%frequency*state%time]
    if (load%by_clock) variables(1) = state%clock + state%time
    do i = 1, size(load%sources)
      associate (source => load%sources(i))
        call wave_value(source%offset, machine%frequency, state%time, turning, motion(0), motion(1), motion(2))
        motion(3) = 0
        motion(0) = motion(0) + sum(source%row*state%q(:n))
        motion(1) = motion(1) + sum(source%row*state%v(:n))
        if (present(a)) motion(2) = motion(2) + sum(source%row*a)
        if (present(jerk)) motion(3) = sum(source%row*jerk)
        if (source%joint > 0) call press_by(machine, source, state, motion)
        variables(4*i - 1:4*i + 2) = motion
      end associate
    end do
  end subroutine load_variables

  !> Sizes of what positions and velocities of the sources are sums of: bodies that are close to each other may be far from their
  !> origins.
  pure function sizes_of_variables(machine, load, state) result(sizes)
    type(multibody_t), intent(in) :: machine
    type(load_t), intent(in) :: load
    type(multibody_state_t), intent(in) :: state
    real(wp) :: sizes(size(load%rates))
    integer :: i, n
    n = machine%n
    sizes = 0
    do i = 1, size(load%sources)
      associate (source => load%sources(i))
        if (source%joint > 0) cycle
        sizes(4*i - 1) = sum(abs(source%row*state%q(:n))) + abs(source%offset%mean)
        sizes(4*i) = sum(abs(source%row*state%v(:n)))
      end associate
    end do
  end function sizes_of_variables

  !> Makes the force of a contact [N] and its first two derivatives, the law taken as linear, of the `motion` of its coordinate.
  pure subroutine press_by(machine, source, state, motion)
    type(multibody_t), intent(in) :: machine
    type(source_t), intent(in) :: source
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(inout) :: motion(0:3)
    real(wp) :: force, by_position, by_speed
    associate (j => source%joint)
      call joint_force(machine%joints(j), state%phase(j), state%slider(j), state%touch_speed(j), motion(0), motion(1), 1.0_wp, &
                       force, by_position, by_speed)
      motion = [force, by_position*motion(1) + by_speed*motion(2), by_position*motion(2) + by_speed*motion(3), 0.0_wp]
      motion = -sign(1, state%phase(j))*motion
    end associate
  end subroutine press_by

  !> Branches of the switching functions of a normal force: where one is zero to rounding, its derivatives decide. `of_variables`
  !> are the sizes of the variables.
  pure subroutine load_branches(load, parameters, variables, of_variables, branches)
    type(load_t), intent(in) :: load
    real(wp), intent(in) :: parameters(:), variables(:), of_variables(:)
    integer, intent(out) :: branches(:)
    type(series_t) :: series
    real(wp), dimension(load%tape%count) :: value, sizes
    real(wp) :: size_of
    integer :: faults(load%tape%count), nodes(size(branches)), i, k, fault
    call evaluate(load%tape, variables, parameters, value, faults)
    ! Copied: GNU Fortran 12 takes an associated component of an array for contiguous where that is a subscript.
    nodes = load%tape%switches%argument
    branches = merge(1, -1, value(nodes) >= 0)
    sizes = sizes_of_nodes(load%tape, value, of_variables)
    do i = 1, size(branches)
      associate (node => load%tape%nodes(nodes(i)))
        size_of = max(sizes(nodes(i)), maxval(abs(value([nodes(i), max(node%first, 1), max(node%second, 1)]))))
      end associate
      ! Events are found to 64 units of rounding of the sizes at the start of a flight.
      if (abs(value(nodes(i))) > 256*epsilon(1.0_wp)*size_of) cycle
      call prepare_series(load%tape, 3, load%rates, nodes, branches, series)
      call expand(load%tape, variables, parameters, series, fault)
      if (fault /= 0) return
      k = findloc(abs(series%c(1:, nodes(i))) > 0, .true., 1)
      if (k > 0) branches(i) = merge(1, -1, series%c(k, nodes(i)) > 0)
    end do
  end subroutine load_branches

  !> All forces on the coordinates but those of constraints [N]; with `rate` their rates of change for the accelerations
  !> `a` [N/s].
  pure subroutine free_force(machine, state, turning, force, a, rate)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: force(:)
    real(wp), intent(in), optional :: a(:)
    real(wp), intent(out), optional :: rate(:)
    real(wp) :: s, u, given, r, by_position, by_speed, factor(0:2), gained
    integer :: j, m, n
    n = machine%n
    force = machine%load - matmul(machine%damping, state%v(:n)) - matmul(machine%stiffness, state%q(:n))
    if (present(rate)) rate = -matmul(machine%damping, a) - matmul(machine%stiffness, state%v(:n))
    if (allocated(machine%controller)) then
      call running_control(machine%controller, state, s, u)
      force = force + s*machine%controller%row
      if (present(rate)) rate = rate + u*machine%controller%row
    end if
    do m = 1, size(machine%force, 2)
      force = force + real(machine%force(:, m)*turning(m))
      if (present(rate)) rate = rate - m*machine%frequency*aimag(machine%force(:, m)*turning(m))
    end do
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (is_held(joint, state%phase(j)) .or. joint%kind == joint_contact) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given)
        call factor_now(machine, j, state, turning, factor, a)
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, factor(0), r, by_position, by_speed)
        force = force + r*joint%row
        if (.not. present(rate)) cycle
        if (allocated(joint%memory)) then
          rate = rate + (by_position*sum(joint%memory%deflection*a) + by_speed*(sum(joint%memory%slide%row*a) + given))*joint%row
          cycle
        end if
        rate = rate + (by_position*u + by_speed*(sum(joint%row*a) + given))*joint%row
        if (.not. (allocated(joint%strength) .or. allocated(joint%load))) cycle
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, factor(1), gained)
        rate = rate + gained*joint%row
      end associate
    end do
  end subroutine free_force

  !> What a controller holds, and what is in its force because its reference runs on; and the rate [N, N/s].
  pure subroutine running_control(controller, state, force, rate)
    type(controller_t), intent(in) :: controller
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(out) :: force, rate
    force = state%control
    rate = 0
    if (controller%sample_time > 0) return
    rate = controller%proportional*controller%reference%rate
    force = force + rate*(state%clock + state%time)
  end subroutine running_control

end module multibody_state
