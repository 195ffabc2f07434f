! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Multibody structures for the tests, written down part by part.
module multibody_machines
  use assembly, only: add_body, add_force, add_joint, add_link, finish, index_of, move_surface
  use contact_law, only: contact_kelvin_voigt
  use errors, only: error_t
  use multibody_machine, only: multibody_machine_t, set_structure
  use multibody, only: joint_contact, joint_elastic, joint_friction, joint_soft, joint_t, multibody_t, wave_t
  use multibody_motion, only: advance_multibody, multibody_motion_t, start_multibody
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use motion_state, only: flight_adaptive, flight_auto, options_t, tally_t
  implicit none
  private

  public :: on_section, body, spring, barrier, soft_barrier, rub, elastic_rub, fit, push, ready, go_on, set_off

contains

  !> A body of a mass [kg] under a constant force [N].
  subroutine body(machine, name, mass, load)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: mass
    real(wp), intent(in), optional :: load
    real(wp) :: pull
    pull = 0
    if (present(load)) pull = load
    call add_body(machine, name, mass, pull)
  end subroutine body

  !> A spring and damper between two bodies.
  subroutine spring(machine, first, second, stiffness, damping, length)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: first, second
    real(wp), intent(in) :: stiffness
    real(wp), intent(in), optional :: damping, length
    real(wp) :: c, l
    c = 0
    l = 0
    if (present(damping)) c = damping
    if (present(length)) l = length
    call add_link(machine, row(machine, first, second), stiffness, c, l)
  end subroutine spring

  function row(machine, first, second)
    type(multibody_t), intent(in) :: machine
    character(len=*), intent(in) :: first, second
    real(wp), allocatable :: row(:)
    logical :: found
    call row_between(machine, first, second, row, found)
    if (.not. found) error stop 'a test names a body that is not there'
  end function row

  !> Rigid stops of second - first.
  subroutine barrier(machine, first, second, restitution, upper, lower)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: first, second
    real(wp), intent(in) :: restitution
    real(wp), intent(in), optional :: upper, lower
    type(joint_t) :: joint
    joint%kind = joint_contact
    joint%row = row(machine, first, second)
    joint%contact%restitution = restitution
    if (present(upper)) joint%upper = upper
    if (present(lower)) joint%lower = lower
    call add_joint(machine, joint)
  end subroutine barrier

  !> A stop with a spring and a damper.
  subroutine soft_barrier(machine, first, second, stiffness, damping, upper, tension)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: first, second
    real(wp), intent(in) :: stiffness, damping, upper
    logical, intent(in) :: tension
    type(joint_t) :: joint
    joint%kind = joint_soft
    joint%row = row(machine, first, second)
    joint%contact%soft = .true.
    joint%contact%kind = contact_kelvin_voigt
    joint%contact%stiffness = stiffness
    joint%contact%damping = damping
    joint%contact%tension = tension
    joint%upper = upper
    call add_joint(machine, joint)
  end subroutine soft_barrier

  !> Friction of second over first, whose surface moves at `belt` [m/s].
  subroutine rub(machine, first, second, kinetic, static, belt, fading)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: first, second
    real(wp), intent(in) :: kinetic, static
    real(wp), intent(in), optional :: belt, fading
    type(joint_t) :: joint
    type(wave_t) :: wave
    joint%kind = joint_friction
    joint%row = row(machine, first, second)
    joint%friction%kinetic = kinetic
    joint%friction%break_away = static
    if (present(fading)) joint%friction%fading_speed = fading
    if (present(belt)) wave%mean = belt
    call move_surface(joint, machine%frequency, wave)
    call add_joint(machine, joint)
  end subroutine rub

  !> Spring and slider in series.
  subroutine elastic_rub(machine, first, second, stiffness, level)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: first, second
    real(wp), intent(in) :: stiffness, level
    type(joint_t) :: joint
    joint%kind = joint_elastic
    joint%row = row(machine, first, second)
    joint%stiffness = stiffness
    joint%friction%kinetic = level
    joint%friction%break_away = level
    call add_joint(machine, joint)
  end subroutine elastic_rub

  !> Any joint between two bodies.
  subroutine fit(machine, first, second, joint)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: first, second
    type(joint_t), intent(in) :: joint
    type(joint_t) :: fitted
    fitted = joint
    fitted%row = row(machine, first, second)
    call add_joint(machine, fitted)
  end subroutine fit

  !> A force: mean, and cosine and sine of the drive.
  subroutine push(machine, name, mean, cosine, sine)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: mean, cosine, sine
    call add_force(machine, row(machine, 'ground', name), mean, [cmplx(cosine, -sine, wp)])
  end subroutine push

  !> The machine ready to move, `adaptive` by marching alone.
  function ready(machine, adaptive) result(moving)
    type(multibody_t), intent(in) :: machine
    logical, intent(in), optional :: adaptive
    type(multibody_motion_t) :: moving
    type(multibody_machine_t) :: whole
    whole = on_section(machine, adaptive)
    moving = whole%bodies
  end function ready

  !> The same on its section.
  function on_section(machine, adaptive, lane_width) result(moving)
    type(multibody_t), intent(in) :: machine
    logical, intent(in), optional :: adaptive
    integer, intent(in), optional :: lane_width
    type(multibody_machine_t) :: moving
    type(multibody_t) :: whole
    type(options_t) :: options
    type(error_t), allocatable :: error
    whole = machine
    call finish(whole, error)
    if (allocated(error)) error stop 'a machine of a test is refused'
    options%step_budget = 10000000
    if (present(adaptive)) options%flight = merge(flight_adaptive, flight_auto, adaptive)
    if (present(lane_width)) options%lane_width = lane_width
    call set_structure(whole, options, moving)
  end function on_section

  !> A state; the drive begins at its phase 0.
  function set_off(moving, q, v) result(state)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: q(:), v(:)
    type(multibody_state_t) :: state
    logical :: ok
    call start_multibody(moving, q, v, 0.0_wp, state, ok)
    if (.not. ok) error stop 'a state of a test has no mode'
  end function set_off

  !> Moves on for `duration` [s], as a drive of any period would.
  subroutine go_on(moving, state, duration, tally, reason)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(in) :: duration
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    call advance_multibody(moving, state, state%time + duration, tally, reason)
  end subroutine go_on

  !> The row of q_second - q_first, the ground being 0; `found` is false if there is no such body.
  pure subroutine row_between(machine, first, second, row, found)
    type(multibody_t), intent(in) :: machine
    character(len=*), intent(in) :: first, second
    real(wp), allocatable, intent(out) :: row(:)
    logical, intent(out) :: found
    integer :: a, b
    allocate (row(machine%n), source=0.0_wp)
    a = index_of(machine, first)
    b = index_of(machine, second)
    found = (a > 0 .or. first == 'ground') .and. (b > 0 .or. second == 'ground')
    if (a > 0) row(a) = row(a) - 1
    if (b > 0) row(b) = row(b) + 1
  end subroutine row_between

end module multibody_machines
