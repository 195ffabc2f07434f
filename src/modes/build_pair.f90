! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies that dry friction couples, in the short form of a case: the parts that they are, and the multibody structure of
!> these. The driving body m1 has spring, viscous damping and drive; the driven body m2 feels the interface and a stop:
!>   m1 v1' = u - a1 v1 + a2 (l0 - x1) - f,   m2 v2' = f - F_c,   f in b Sgn(v1 - v2).
!> The stop bounds x2 (fixed to the ground) or x2 - x1 (carried by m1: backlash).
module build_pair
  use assembly, only: index_of, set_sizes
  use build_multibody, only: complete, join_parts, joined_t
  use constants, only: two_pi, unreachable
  use contact_law, only: barrier_positions, contact_of, contact_t
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: effect_family, families, law_choice, law_choice_t, parameter_row_t, parameters_of, part_family, &
    set_value, table_of, value_of
  use multibody, only: joint_friction, multibody_t
  use status, only: exit_bad_case
  implicit none
  private

  public :: is_pair, pair_of, parts_of_pair

  !> Numbers of the bodies among the reference points.
  integer, parameter :: ground = 0, driving = 1, driven = 2

contains

  !> Whether the laws describe two bodies.
  pure logical function is_pair(choices)
    type(law_choice_t), intent(in) :: choices(:)
    integer :: i
    is_pair = .false.
    do i = 1, size(choices)
      if (choices(i)%family == 'body') is_pair = choices(i)%name == 'friction_pair' .or. choices(i)%name == 'backlash_pair'
    end do
  end function is_pair

  !> The structure of two bodies: coordinates are the positions of both on the ground, or of the driven one where the motion of the
  !> other is given. Refuses laws that a pair does not admit; the message begins with the key.
  pure subroutine pair_of(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: parts(:)
    type(joined_t) :: joined
    integer :: i
    call refuse_others(choices, error)
    if (allocated(error)) return
    parts = parts_of_pair(choices)
    call join_parts(parts, machine, joined, error)
    if (allocated(error)) return
    machine%section_time = section_time_of(law_of(choices, 'body'), law_of(choices, 'drive'), law_of(choices, 'restoring'))
    do i = 1, size(machine%joints)
      associate (joint => machine%joints(i))
        ! Messages name the keys of the short form.
        joint%name = merge('body.friction', 'contact      ', joint%kind == joint_friction)
        ! A tie of forces sticks.
        joint%friction%break_away = joint%friction%kinetic*(1 + 32*epsilon(1.0_wp))
      end associate
    end do
    call complete(parts, joined, machine, error)
    if (.not. allocated(error)) call describe_driver(choices, machine)
  end subroutine pair_of

  !> The laws of a pair as those of a case with [body.NAME]: its bodies, joints and drive, in the order of such a case.
  pure function parts_of_pair(choices) result(parts)
    type(law_choice_t), intent(in) :: choices(:)
    type(law_choice_t), allocatable :: parts(:)
    type(law_choice_t) :: body, part
    integer :: i
    body = law_of(choices, 'body')
    allocate (parts(size(families)))
    parts(1) = law_choice('body', 'structure')
    do i = 2, size(families)
      parts(i) = law_choice(families(i), 'none')
    end do
    part = part_of('body:mass', 'driving')
    call set_value(part, 'mass', [value_of(body, 'mass')])
    if (.not. is_given(law_of(choices, 'drive'))) then
      call set_value(part, 'x0', [value_of(body, 'driver_x0')])
      call set_value(part, 'v0', [value_of(body, 'driver_v0')])
    end if
    parts = [parts, part]
    part = part_of('body:watched', 'driven')
    call set_value(part, 'mass', [value_of(body, 'driven_mass')])
    parts = [parts, part]
    call add_frame(choices, parts)
    call add_joints(body, law_of(choices, 'contact'), parts)
    call add_drive(law_of(choices, 'drive'), parts)
    if (.not. abs(value_of(body, 'impulse')) > 0) return
    part = part_of('drive:impulse', 'hammer')
    call set_value(part, 'body', [real(driven, wp)])
    call set_value(part, 'impulse', [value_of(body, 'impulse')])
    call set_value(part, 'time', [value_of(body, 'impulse_time')])
    parts = [parts, part]
  end function parts_of_pair

  pure type(law_choice_t) function part_of(law, label) result(part)
    character(len=*), intent(in) :: law, label
    part = law_choice(part_family, law)
    part%label = label
  end function part_of

  !> A joint between two reference points.
  pure type(law_choice_t) function joint_of(law, label, first, second) result(part)
    character(len=*), intent(in) :: law, label
    integer, intent(in) :: first, second
    part = part_of(law, label)
    call set_value(part, 'first_end', [real(first, wp)])
    call set_value(part, 'second_end', [real(second, wp)])
  end function joint_of

  !> Refuses laws of machines of one body, and effects.
  pure subroutine refuse_others(choices, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(choices)
      associate (name => choices(i)%name)
        select case (choices(i)%family)
        case ('friction')
          if (name == 'none' .or. name == 'viscous') cycle
          call fail(error, exit_bad_case, 'friction.law: found "'//trim(name)//'", allowed with two bodies '// &
                    'none, viscous: it acts between the ground and the driving body')
        case ('drive')
          if (name == 'none' .or. name == 'force' .or. is_given(choices(i)) .or. is_controller(choices(i))) cycle
          call fail(error, exit_bad_case, 'drive.law: found "'//trim(name)//'", allowed with two bodies none, force, '// &
                    'velocity, sine, pid_velocity, pid_sine')
        case (effect_family)
          call fail(error, exit_bad_case, table_of(effect_family, name)//': found with two bodies, allowed with '// &
                    'body.law = "point_mass"')
        end select
      end associate
      if (allocated(error)) return
    end do
  end subroutine refuse_others

  !> The law of a family, none where it is not there.
  pure type(law_choice_t) function law_of(choices, family) result(choice)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: family
    integer :: i
    i = findloc(choices%family == family, .true., dim=1, back=.true.)
    if (i > 0) then
      choice = choices(i)
    else
      choice = law_choice(family, 'none')
    end if
  end function law_of

  !> Whether the drive gives the motion of the driving body.
  pure logical function is_given(drive)
    type(law_choice_t), intent(in) :: drive
    is_given = drive%name == 'velocity' .or. drive%name == 'sine'
  end function is_given

  !> Whether a controller moves the driving body.
  pure logical function is_controller(drive)
    type(law_choice_t), intent(in) :: drive
    is_controller = drive%name == 'pid_velocity' .or. drive%name == 'pid_sine'
  end function is_controller

  !> Whether the motion of the driving body, or what the controller follows, has a constant velocity.
  pure logical function moves_on(drive)
    type(law_choice_t), intent(in) :: drive
    moves_on = drive%name == 'velocity' .or. drive%name == 'pid_velocity'
  end function moves_on

  !> The stops are carried by the driving body.
  pure logical function is_carried(body)
    type(law_choice_t), intent(in) :: body
    is_carried = body%name == 'backlash_pair'
  end function is_carried

  pure real(wp) function frequency_of(drive) result(frequency)
    type(law_choice_t), intent(in) :: drive
    frequency = 0
    if (any(drive%name == [character(len=8) :: 'force', 'sine', 'pid_sine'])) frequency = value_of(drive, 'frequency')
  end function frequency_of

  !> Period of the section [s]: of the drive, the spring with both bodies, or one second.
  pure real(wp) function section_time_of(body, drive, spring) result(period)
    type(law_choice_t), intent(in) :: body, drive, spring
    period = 1
    if (frequency_of(drive) > 0) then
      period = two_pi/frequency_of(drive)
    else if (spring%name == 'linear' .and. .not. is_given(drive)) then
      if (value_of(spring, 'stiffness') > 0) period = two_pi*sqrt((value_of(body, 'mass') + value_of(body, 'driven_mass'))/ &
                                                                   value_of(spring, 'stiffness'))
    end if
  end function section_time_of

  !> Spring and damper between the ground and the driving body, where that is free.
  pure subroutine add_frame(choices, parts)
    type(law_choice_t), intent(in) :: choices(:)
    type(law_choice_t), allocatable, intent(inout) :: parts(:)
    type(law_choice_t) :: spring, damper, part
    spring = law_of(choices, 'restoring')
    damper = law_of(choices, 'friction')
    if (is_given(law_of(choices, 'drive')) .or. (spring%name /= 'linear' .and. damper%name /= 'viscous')) return
    part = joint_of('spring:linear', 'frame', ground, driving)
    if (spring%name == 'linear') call set_value(part, 'stiffness', [value_of(spring, 'stiffness')])
    if (spring%name == 'linear') call set_value(part, 'free_length', [value_of(spring, 'free_length')])
    if (damper%name == 'viscous') call set_value(part, 'damping', [value_of(damper, 'damping')])
    parts = [parts, part]
  end subroutine add_frame

  !> Friction between the bodies, and stops of the driven one on the ground or on the other.
  pure subroutine add_joints(body, stop, parts)
    type(law_choice_t), intent(in) :: body, stop
    type(law_choice_t), allocatable, intent(inout) :: parts(:)
    type(law_choice_t) :: part
    type(contact_t) :: contact
    type(parameter_row_t), allocatable :: rows(:)
    real(wp) :: positions(2), force
    integer :: i
    contact = contact_of(stop, mass=1.0_wp)
    positions = barrier_positions(contact)
    force = value_of(body, 'friction')
    ! Stops without room leave friction along them nothing to do.
    if (force > 0 .and. .not. (is_carried(body) .and. .not. contact%soft .and. .not. positions(1) > positions(2))) then
      part = joint_of('friction:coulomb', 'interface', driving, driven)
      call set_value(part, 'force', [force])
      call set_value(part, 'static_force', [force])
      parts = [parts, part]
    end if
    if (positions(1) >= unreachable .and. positions(2) <= -unreachable) return
    part = joint_of('contact:'//trim(stop%name), 'stop', merge(driving, ground, is_carried(body)), driven)
    rows = parameters_of(stop%family, stop%name)
    do i = 1, size(rows)
      call set_value(part, trim(rows(i)%name), [value_of(stop, trim(rows(i)%name))])
    end do
    parts = [parts, part]
  end subroutine add_joints

  !> The force on the driving body, its given motion, or the controller that moves it.
  pure subroutine add_drive(drive, parts)
    type(law_choice_t), intent(in) :: drive
    type(law_choice_t), allocatable, intent(inout) :: parts(:)
    character(len=12), parameter :: gains(4) = [character(len=12) :: 'proportional', 'integral', 'derivative', 'sample_time']
    type(law_choice_t) :: part
    integer :: i
    select case (drive%name)
    case ('force')
      part = part_of('drive:force', 'force')
      call set_value(part, 'mean', [value_of(drive, 'mean')])
      call set_value(part, 'amplitude', [value_of(drive, 'amplitude')])
    case ('velocity', 'sine')
      part = part_of('drive:motion', 'motion')
    case ('pid_velocity', 'pid_sine')
      part = part_of('drive:controller', 'integral')
      do i = 1, size(gains)
        call set_value(part, trim(gains(i)), [value_of(drive, trim(gains(i)))])
      end do
    case default
      return
    end select
    call set_value(part, 'body', [real(driving, wp)])
    if (drive%name == 'sine' .or. drive%name == 'pid_sine') call set_value(part, 'sine', [value_of(drive, 'amplitude')])
    if (frequency_of(drive) > 0) call set_value(part, 'frequency', [frequency_of(drive)])
    if (moves_on(drive)) call set_value(part, 'rate', [value_of(drive, 'velocity')])
    parts = [parts, part]
  end subroutine add_drive

  !> What is reported of the driving body.
  pure subroutine describe_driver(choices, machine)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t) :: body, drive
    body = law_of(choices, 'body')
    drive = law_of(choices, 'drive')
    allocate (machine%driver)
    associate (driver => machine%driver)
      driver%at = index_of(machine, 'driving')
      driver%carries = is_carried(body)
      allocate (driver%running(machine%n), driver%push(machine%n), source=0.0_wp)
      if (driver%at == 0) then
        driver%motion = machine%given(1)
        associate (wave => driver%motion)
          if (driver%carries) driver%stops_run = wave%rate
          call set_sizes(machine, value_of(body, 'driven_mass')*(abs(real(wave%harmonic(1))) + abs(aimag(wave%harmonic(1))))* &
                         machine%frequency**2)
        end associate
      else if (is_controller(drive)) then
        driver%running(driver%at) = machine%controller%reference%rate
        if (driver%carries) driver%running(machine%watched) = machine%controller%reference%rate
      else if (drive%name == 'force') then
        driver%push(driver%at) = value_of(drive, 'mean')
      end if
    end associate
  end subroutine describe_driver

end module build_pair
