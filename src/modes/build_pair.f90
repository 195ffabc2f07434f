! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From the laws of two bodies that dry friction couples to the multibody structure that they are. The driving body m1 has spring,
!> viscous damping and drive; the driven body m2 feels the interface and a stop:
!>   m1 v1' = u - a1 v1 + a2 (l0 - x1) - f,   m2 v2' = f - F_c,   f in b Sgn(v1 - v2).
!> The stop bounds x2 (fixed to the ground) or x2 - x1 (carried by m1: backlash).
module build_pair
  use assembly, only: add_body, add_force, add_joint, add_link, finish, give_motion, index_of, &
    set_sizes
  use constants, only: two_pi, unreachable
  use contact_law, only: barrier_positions, contact_of, contact_t
  use control, only: add_controller, add_impulse
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: effect_family, law_choice, law_choice_t, table_of, value_of
  use multibody, only: controller_t, impulse_t, joint_contact, joint_friction, joint_soft, joint_t, multibody_t, wave_t
  use status, only: exit_bad_case
  implicit none
  private

  public :: is_pair, pair_of

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
    type(law_choice_t) :: body, contact, damper, drive, spring
    type(wave_t) :: wave
    call refuse_others(choices, error)
    if (allocated(error)) return
    body = law_of(choices, 'body')
    contact = law_of(choices, 'contact')
    damper = law_of(choices, 'friction')
    drive = law_of(choices, 'drive')
    spring = law_of(choices, 'restoring')
    wave = wave_of_pair(drive)
    machine%frequency = frequency_of(drive)
    machine%section_time = section_time_of(body, drive, spring)
    call add_body(machine, 'driving', value_of(body, 'mass'), 0.0_wp)
    call add_body(machine, 'driven', value_of(body, 'driven_mass'), 0.0_wp)
    machine%watched = 2
    call add_joints(body, contact, is_given(drive), machine)
    if (is_given(drive)) then
      call give_motion(machine, 'driving', wave)
    else
      call add_frame(spring, damper, machine)
      call add_drive(drive, wave, machine, error)
      if (allocated(error)) return
    end if
    call finish(machine, error)
    if (allocated(error)) return
    call name_driver(body, drive, wave, machine)
    if (.not. abs(value_of(body, 'impulse')) > 0) return
    call add_impulse(machine, impulse_t(row=merge(1.0_wp, 0.0_wp, machine%names == 'driven'), &
                                        amount=value_of(body, 'impulse'), time=value_of(body, 'impulse_time')))
  end subroutine pair_of

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
    choice = law_choice(family, 'none')
    do i = 1, size(choices)
      if (choices(i)%family == family) choice = choices(i)
    end do
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

  !> The stops are carried by the driving body.
  pure logical function is_carried(body)
    type(law_choice_t), intent(in) :: body
    is_carried = body%name == 'backlash_pair'
  end function is_carried

  !> Force [N], motion [m] or reference [m].
  pure type(wave_t) function wave_of_pair(drive) result(wave)
    type(law_choice_t), intent(in) :: drive
    real(wp) :: cosine, sine
    cosine = 0
    sine = 0
    select case (drive%name)
    case ('force')
      wave%mean = value_of(drive, 'mean')
      cosine = value_of(drive, 'amplitude')
    case ('velocity', 'pid_velocity')
      wave%rate = value_of(drive, 'velocity')
    case ('sine', 'pid_sine')
      sine = value_of(drive, 'amplitude')
    end select
    wave%harmonic = [cmplx(cosine, -sine, wp)]
  end function wave_of_pair

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

  !> Spring and damper between the ground and the driving body.
  pure subroutine add_frame(spring, damper, machine)
    type(law_choice_t), intent(in) :: spring, damper
    type(multibody_t), intent(inout) :: machine
    real(wp) :: stiffness, free_length, damping
    stiffness = 0
    free_length = 0
    damping = 0
    if (spring%name == 'linear') then
      stiffness = value_of(spring, 'stiffness')
      free_length = value_of(spring, 'free_length')
    end if
    if (damper%name == 'viscous') damping = value_of(damper, 'damping')
    call add_link(machine, [1.0_wp, 0.0_wp], stiffness, damping, free_length)
  end subroutine add_frame

  !> The force on the driving body, or the controller that moves it.
  pure subroutine add_drive(drive, wave, machine, error)
    type(law_choice_t), intent(in) :: drive
    type(wave_t), intent(in) :: wave
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(controller_t) :: controller
    if (is_controller(drive)) then
      controller = controller_t(row=[1.0_wp, 0.0_wp], reference=wave, proportional=value_of(drive, 'proportional'), &
                                integral=value_of(drive, 'integral'), derivative=value_of(drive, 'derivative'), &
                                sample_time=value_of(drive, 'sample_time'))
      call add_controller(machine, controller, 'integral.1', error)
    else
      call add_force(machine, [1.0_wp, 0.0_wp], wave%mean, wave%harmonic)
    end if
  end subroutine add_drive

  !> What is reported of the driving body, and where it starts.
  pure subroutine name_driver(body, drive, wave, machine)
    type(law_choice_t), intent(in) :: body, drive
    type(wave_t), intent(in) :: wave
    type(multibody_t), intent(inout) :: machine
    allocate (machine%driver)
    associate (driver => machine%driver)
      driver%at = index_of(machine, 'driving')
      driver%carries = is_carried(body)
      allocate (driver%running(machine%n), driver%push(machine%n), source=0.0_wp)
      if (driver%at == 0) then
        driver%motion = wave
        if (driver%carries) driver%stops_run = wave%rate
        call set_sizes(machine, value_of(body, 'driven_mass')*(abs(real(wave%harmonic(1))) + abs(aimag(wave%harmonic(1))))* &
                       machine%frequency**2)
        return
      end if
      machine%start(:, driver%at) = [value_of(body, 'driver_x0'), value_of(body, 'driver_v0')]
      if (.not. is_controller(drive)) then
        driver%push(driver%at) = wave%mean
        return
      end if
      driver%running(driver%at) = wave%rate
      if (driver%carries) driver%running(machine%watched) = wave%rate
    end associate
  end subroutine name_driver

  !> Friction between the bodies, and stops of the driven one on the ground or on the other; `given`: the other has a given motion.
  pure subroutine add_joints(body, stop, given, machine)
    type(law_choice_t), intent(in) :: body, stop
    logical, intent(in) :: given
    type(multibody_t), intent(inout) :: machine
    real(wp), parameter :: relative(2) = [-1.0_wp, 1.0_wp], driven(2) = [0.0_wp, 1.0_wp]
    type(joint_t) :: friction, contact
    real(wp) :: positions(2), mass
    logical :: carried
    carried = is_carried(body)
    ! The mass that an impact between the two bodies sees, or of m2 with the ground or with a given motion.
    mass = machine%mass(2, 2)
    if (carried .and. .not. given) mass = machine%mass(1, 1)*machine%mass(2, 2)/(machine%mass(1, 1) + machine%mass(2, 2))
    contact%contact = contact_of(stop, mass)
    positions = barrier_positions(contact%contact)
    friction%friction%kinetic = value_of(body, 'friction')
    ! Stops without room leave friction along them nothing to do.
    if (friction%friction%kinetic > 0 .and. &
        .not. (carried .and. .not. contact%contact%soft .and. .not. positions(1) > positions(2))) then
      friction%name = 'body.friction'
      friction%kind = joint_friction
      friction%row = relative
      ! A tie of forces sticks.
      friction%friction%break_away = friction%friction%kinetic*(1 + 32*epsilon(1.0_wp))
      call add_joint(machine, friction)
    end if
    if (positions(1) >= unreachable .and. positions(2) <= -unreachable) return
    contact%name = 'contact'
    contact%kind = merge(joint_soft, joint_contact, contact%contact%soft)
    contact%row = merge(relative, driven, carried)
    if (positions(1) < unreachable) contact%upper = positions(1)
    if (positions(2) > -unreachable) contact%lower = positions(2)
    call add_joint(machine, contact)
  end subroutine add_joints

end module build_pair
