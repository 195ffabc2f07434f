! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The laws of a machine with a motor, and those that do not go with one.
module motor_choices
  use constants, only: two_pi
  use curve_law, only: continued_at, curve_of, curve_t, knots_problem, steepest, value_at
  use errors, only: error_t, fail
  use friction_law, only: friction_of, friction_t
  use kinds, only: real64, wp
  use law_table, only: effect_family, law_choice_t, list_of, motor_family, own_law, path_of, value_of
  use memory_rows, only: memory_names
  use law_texts, only: is_own
  use status, only: exit_bad_case
  use text, only: to_text
  implicit none
  private

  !> Largest decay over a turn at the no-load speed, as an exponent: of differences of speeds, velocities or currents.
  real(wp), parameter :: most_decay = 1e4_wp
  !> By how much a rod is longer than its crank at least, as a share: at the dead point the speed of the foot is infinite.
  real(wp), parameter :: dead_point = 1e-9_wp

  public :: cannot_start, has_motor, has_ramp, resonance_of, supply_of, number_of_family, refuse_laws, speed_of, start_of_motor

contains

  !> Whether a motor is among the choices.
  pure logical function has_motor(choices)
    type(law_choice_t), intent(in) :: choices(:)
    has_motor = number_of_family(choices, motor_family) > 0
  end function has_motor

  !> Number of the choice of a family; 0 if there is none.
  pure integer function number_of_family(choices, family) result(number)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: family
    integer :: i
    number = 0
    do i = 1, size(choices)
      if (choices(i)%family == family) number = i
    end do
  end function number_of_family

  !> Whether a motor is among the choices whose voltage or speed rises in a ramp.
  pure logical function has_ramp(choices)
    type(law_choice_t), intent(in) :: choices(:)
    has_ramp = has_motor(choices)
    if (.not. has_ramp) return
    associate (motor => choices(number_of_family(choices, motor_family)))
      has_ramp = motor%name /= 'table'
      if (has_ramp) has_ramp = value_of(motor, 'ramp_time') > 0
    end associate
  end function has_ramp

  !> Speed of the crank at resonance, the natural angular frequency of body and spring [rad/s]; 0 without a motor.
  pure real(wp) function resonance_of(choices) result(speed)
    type(law_choice_t), intent(in) :: choices(:)
    integer :: body, restoring
    speed = 0
    body = number_of_family(choices, 'body')
    restoring = number_of_family(choices, 'restoring')
    if (.not. has_motor(choices) .or. body == 0 .or. restoring == 0) return
    if (choices(restoring)%name /= 'linear') return
    speed = sqrt(value_of(choices(restoring), 'stiffness')/value_of(choices(body), 'mass'))
  end function resonance_of

  !> Key of what sets the speed of a motor.
  pure function supply_of(choices) result(key)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=:), allocatable :: key
    select case (choices(number_of_family(choices, motor_family))%name)
    case ('linear')
      key = 'motor.no_load_speed'
    case ('kloss')
      key = 'motor.synchronous_speed'
    case ('dc')
      key = 'motor.voltage'
    case ('pi')
      key = 'motor.reference'
    case default
      key = 'motor.torque'
    end select
  end function supply_of

  !> Whether a motor that starts from standstill never overcomes the friction of its bearing by itself. `torque` [N m] is the most
  !> that it has there, also during a ramp.
  pure subroutine cannot_start(choices, torque, remains)
    type(law_choice_t), intent(in) :: choices(:)
    real(wp), intent(out) :: torque
    logical, intent(out) :: remains
    torque = 0
    remains = has_motor(choices)
    if (.not. remains) return
    associate (motor => choices(number_of_family(choices, motor_family)))
      select case (motor%name)
      case ('linear')
        torque = value_of(motor, 'stall_torque')
      case ('kloss')
        associate (slip => value_of(motor, 'breakdown_slip'))
          torque = 2*value_of(motor, 'breakdown_torque')*slip/(1 + slip**2)
        end associate
      case ('dc')
        torque = value_of(motor, 'torque_constant')*largest_supply(motor, 'voltage')/value_of(motor, 'resistance')
        if (value_of(motor, 'inductance') > 0) torque = max(abs(torque), abs(value_of(motor, 'torque_constant')* &
                                                                             value_of(motor, 'start_current')))
      case ('pi')
        torque = value_of(motor, 'proportional')*largest_supply(motor, 'reference')
        if (value_of(motor, 'integral') > 0) torque = huge(torque)
        if (value_of(motor, 'torque_limit') > 0) torque = min(torque, value_of(motor, 'torque_limit'))
      case default
        torque = continued_at(curve_of(list_of(motor, 'speed'), list_of(motor, 'torque')), 0.0_wp)
      end select
      torque = abs(torque)
      remains = .not. abs(value_of(motor, 'crank_speed')) > 0 .and. torque <= value_of(motor, 'bearing_friction')
      remains = remains .and. value_of(motor, 'bearing_friction') > 0
    end associate
  end subroutine cannot_start

  !> What sets the speed of a motor, where it is largest on a ramp.
  pure real(wp) function largest_supply(motor, key) result(supply)
    type(law_choice_t), intent(in) :: motor
    character(len=*), intent(in) :: key
    supply = value_of(motor, key)
    if (.not. value_of(motor, 'ramp_time') > 0) return
    if (abs(value_of(motor, 'ramp_from')) > abs(supply)) supply = value_of(motor, 'ramp_from')
  end function largest_supply

  !> Speed of the crank [rad/s] and current [A] or integral [rad] at the start.
  pure function start_of_motor(choices) result(start)
    type(law_choice_t), intent(in) :: choices(:)
    real(wp) :: start(2)
    start = 0
    associate (motor => choices(number_of_family(choices, motor_family)))
      start(1) = value_of(motor, 'crank_speed')
      if (motor%name == 'dc') start(2) = value_of(motor, 'start_current')
      if (motor%name == 'pi') start(2) = value_of(motor, 'start_integral')
    end associate
  end function start_of_motor

  !> Laws that a motor does not go with.
  pure subroutine refuse_laws(choices, drive, motor, error)
    type(law_choice_t), intent(in) :: choices(:), drive, motor
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(choices)
      if (choices(i)%family == effect_family) then
        call fail(error, exit_bad_case, 'effect.'//trim(choices(i)%name)//': found with a table [motor], allowed without: '// &
                  'effects are not part of its equations')
        return
      else if (any(memory_names == choices(i)%name)) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.law: found "'//trim(choices(i)%name)// &
                  '", allowed without a table [motor]')
        return
      else if (choices(i)%name == own_law) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.law: found "expression", allowed without a table [motor]')
        return
      else if (is_own(choices(i))) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.load: found with a table [motor], allowed without')
        return
      end if
    end do
    if (all(drive%name /= [character(len=15) :: 'harmonic', 'fourier', 'slider_crank', 'crank_lever_rod', 'unbalance'])) then
      call fail(error, exit_bad_case, 'drive.law: found "'//trim(drive%name)// &
                '", allowed with a motor: harmonic, fourier, slider_crank, crank_lever_rod, unbalance')
    else if (.not. value_of(motor, 'inertia') > 0) then
      call fail(error, exit_bad_case, 'motor.inertia: allowed above 0')
    else if (motor%name == 'table') then
      call refuse_table(motor, error)
    else if (.not. abs(speed_of(motor)) > 0) then
      call fail(error, exit_bad_case, 'motor.voltage: found 0.0 V, allowed other than 0: the unit of time is a turn at '// &
                'the no-load speed')
    else
      call refuse_steep(motor, slope_of(motor), error)
      if (.not. allocated(error)) call refuse_control(motor, error)
    end if
    if (allocated(error)) return
    call refuse_rates(choices, motor, error)
    if (allocated(error)) return
    if (drive%name == 'slider_crank') then
      if (.not. value_of(drive, 'rod') > (1 + dead_point)*value_of(drive, 'crank')) then
        call fail(error, exit_bad_case, 'drive.rod: found '//shown(value_of(drive, 'rod'))//' m, allowed above drive.crank: '// &
                  'with a shorter rod the crank cannot turn fully, and one as long has a dead point')
      end if
    end if
  end subroutine refuse_laws

  !> Currents, integrals and velocities that settle, or oscillate, so fast that every turn takes thousands of steps.
  pure subroutine refuse_rates(choices, motor, error)
    type(law_choice_t), intent(in) :: choices(:), motor
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: fastest, inductance
    type(friction_t) :: friction
    fastest = most_decay*abs(speed_of(motor))/two_pi
    associate (inertia => value_of(motor, 'inertia'))
      if (motor%name == 'dc') then
        inductance = value_of(motor, 'inductance')
        if (inductance > 0 .and. value_of(motor, 'resistance') > fastest*inductance) then
          call fail(error, exit_bad_case, 'motor.inductance: found '//shown(inductance)//' H, allowed at least '// &
                    shown(value_of(motor, 'resistance')/fastest)//' H, or 0: the current follows the speed at once')
          return
        end if
      else if (motor%name == 'pi') then
        call refuse_above('motor.integral', value_of(motor, 'integral'), fastest**2*inertia, 'N m', error)
      end if
      if (allocated(error)) return
      call refuse_above('motor.bearing_damping', value_of(motor, 'bearing_damping'), fastest*inertia, 'N m s', error)
    end associate
    if (allocated(error)) return
    friction = friction_of(choices(number_of_family(choices, 'friction')), 0.0_wp)
    call refuse_above('friction.damping', friction%damping, &
                      fastest*value_of(choices(number_of_family(choices, 'body')), 'mass'), 'N s/m', error)
  end subroutine refuse_rates

  pure subroutine refuse_above(key, found, most, unit, error)
    character(len=*), intent(in) :: key, unit
    real(wp), intent(in) :: found, most
    type(error_t), allocatable, intent(inout) :: error
    if (found > most) call fail(error, exit_bad_case, key//': found '//shown(found)//' '//unit//', allowed at most '// &
      shown(most)//' '//unit//': what it drives settles within 1e-4 of a turn at the no-load speed')
  end subroutine refuse_above

  pure function shown(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(real(value, real64))
  end function shown

  !> What is wrong with a table of the torque; its own slopes bound those of the speed.
  pure subroutine refuse_table(motor, error)
    type(law_choice_t), intent(in) :: motor
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    type(curve_t) :: curve
    problem = knots_problem(list_of(motor, 'speed'), size(list_of(motor, 'torque')))
    if (len(problem) > 0) then
      call fail(error, exit_bad_case, 'motor.speed: '//problem//': motor.torque is given at these speeds')
    else if (.not. speed_of(motor) > 0) then
      call fail(error, exit_bad_case, 'motor.torque: allowed values that fall below 0 at a speed above 0; a turn at that '// &
                'speed is the unit of time')
    else
      curve = curve_of(list_of(motor, 'speed'), list_of(motor, 'torque'))
      if (curve%slope(curve%count) > 0) then
        call fail(error, exit_bad_case, 'motor.torque: found a slope of '//shown(curve%slope(curve%count))// &
                  ' N m s at the last speed, allowed at most 0: beyond it the torque would grow with the speed without a bound')
      else
        call refuse_steep(motor, steepest(curve), error)
      end if
    end if
  end subroutine refuse_table

  !> A slope of the torque [N m s] at which the speed settles too fast.
  pure subroutine refuse_steep(motor, slope, error)
    type(law_choice_t), intent(in) :: motor
    real(wp), intent(in) :: slope
    type(error_t), allocatable, intent(inout) :: error
    real(wp) :: least
    least = slope*two_pi/(abs(speed_of(motor))*most_decay)
    if (least > value_of(motor, 'inertia')) call fail(error, exit_bad_case, 'motor.inertia: found '// &
      shown(value_of(motor, 'inertia'))//' kg m^2, allowed at least '//shown(least)//' kg m^2: the crank speed settles within '// &
      '1e-4 of a turn; a drive of given speed has no [motor]')
  end subroutine refuse_steep

  !> What is wrong with a ramp or a limit of the torque.
  pure subroutine refuse_control(motor, error)
    type(law_choice_t), intent(in) :: motor
    type(error_t), allocatable, intent(out) :: error
    if (motor%name == 'table') return
    if (value_of(motor, 'ramp_time') > 0 .and. any(motor%name == ['linear', 'kloss '])) then
      if (.not. value_of(motor, 'ramp_from') > 0) then
        call fail(error, exit_bad_case, 'motor.ramp_from: found '//shown(value_of(motor, 'ramp_from'))// &
                  ' rad/s, allowed above 0: the torque is divided by this speed')
      end if
    else if (abs(value_of(motor, 'ramp_from')) > 0 .and. .not. value_of(motor, 'ramp_time') > 0) then
      call fail(error, exit_bad_case, 'motor.ramp_time: missing, allowed above 0 s: motor.ramp_from is given')
    end if
    if (motor%name /= 'pi' .or. allocated(error)) return
    associate (limit => value_of(motor, 'torque_limit'), own => abs(value_of(motor, 'start_integral')*value_of(motor, 'integral')))
      if (limit > 0 .and. own > limit) then
        call fail(error, exit_bad_case, 'motor.start_integral: multiplied by motor.integral it is '//shown(own)// &
                  ' N m, allowed at most motor.torque_limit')
      end if
    end associate
  end subroutine refuse_control

  !> Speed of the crank without torque [rad/s].
  pure real(wp) function speed_of(motor) result(speed)
    type(law_choice_t), intent(in) :: motor
    select case (motor%name)
    case ('linear')
      speed = value_of(motor, 'no_load_speed')
    case ('kloss')
      speed = value_of(motor, 'synchronous_speed')
    case ('dc')
      speed = value_of(motor, 'voltage')/value_of(motor, 'torque_constant')
    case ('pi')
      speed = value_of(motor, 'reference')
    case default
      speed = zero_of(curve_of(list_of(motor, 'speed'), list_of(motor, 'torque')))
    end select
  end function speed_of

  !> The highest speed at which a table of the torque falls through zero, by bisection; 0 without any above 0.
  pure real(wp) function zero_of(curve) result(speed)
    type(curve_t), intent(in) :: curve
    real(wp) :: low, high
    integer :: i, k
    speed = 0
    do i = 1, curve%count - 1
      if (.not. (curve%value(i) > 0 .and. curve%value(i + 1) <= 0 .and. curve%at(i + 1) > 0)) cycle
      low = max(0.0_wp, curve%at(i))
      high = curve%at(i + 1)
      do k = 1, digits(1.0_wp)
        speed = (low + high)/2
        if (value_at(curve, speed) > 0) then
          low = speed
        else
          high = speed
        end if
      end do
    end do
  end function zero_of

  !> Torque over the difference of the speed to that without torque [N m s].
  pure real(wp) function slope_of(motor) result(slope)
    type(law_choice_t), intent(in) :: motor
    select case (motor%name)
    case ('linear')
      slope = value_of(motor, 'stall_torque')/speed_of(motor)
    case ('kloss')
      slope = 2*value_of(motor, 'breakdown_torque')/(value_of(motor, 'breakdown_slip')*speed_of(motor))
    case ('dc')
      slope = value_of(motor, 'torque_constant')**2/value_of(motor, 'resistance')
    case default
      slope = value_of(motor, 'proportional')
    end select
  end function slope_of

end module motor_choices
