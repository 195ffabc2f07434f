! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Multibody structures that lanes fly.
module lane_structures
  use multibody_machine, only: multibody_machine_t
  use contact_law, only: contact_kelvin_voigt, contact_linear, contact_power, contact_t, contact_viscoelastic
  use multibody, only: joint_contact, joint_soft, joint_t, multibody_t
  use multibody_machines, only: barrier, body, fit, on_section, push, rub, spring
  use kinds, only: wp
  use lane_types, only: widest_lanes
  use machines, only: uniform
  implicit none
  private

  public :: structure_number, chain, made_ready

  !> Structures whose every mode oscillates; that no spring ties to the ground, or a damper alone, on belts and with strong
  !> dampers; with a restitution that depends on the speed; with stops that have springs and dampers.
  integer, parameter, public :: oscillating = 1, drifting = 2, restituting = 3, pressing = 4

contains

  !> Structure number i of a kind: a chain of bodies with one or two friction joints, on the ground or between bodies, whose level
  !> at rest is that of sliding or more, and one wall or two, fixed or a body's.
  function structure_number(kind, i) result(moving)
    integer, intent(in) :: kind, i
    type(multibody_machine_t) :: moving
    if (kind == drifting) then
      moving = drifting_structure(i)
    else if (kind == pressing) then
      moving = pressing_structure(i)
    else
      moving = oscillating_structure(i, kind == restituting)
    end if
  end function structure_number

  function oscillating_structure(i, restituting) result(moving)
    integer, intent(in) :: i
    logical, intent(in) :: restituting
    type(multibody_machine_t) :: moving
    type(multibody_t) :: machine
    character(len=2) :: name
    character(len=2), parameter :: last(0:2) = ['b2', 'b4', 'b8']
    real(wp) :: static
    integer :: n, k
    n = 2**(1 + modulo(i, 3))
    machine%frequency = uniform(1.0_wp, 2.5_wp)
    do k = 1, n
      write (name, '(a, i1)') 'b', k
      call body(machine, name, uniform(0.5_wp, 2.0_wp))
      if (k == 1) call spring(machine, 'ground', name, uniform(1.0_wp, 3.0_wp), 0.05_wp)
      if (k > 1) call spring(machine, machine%names(k - 1), name, uniform(2.0_wp, 6.0_wp), 0.05_wp)
    end do
    static = merge(0.3_wp, 0.45_wp, modulo(i, 2) == 0)
    if (modulo(i, 4) < 2) call rub(machine, 'ground', 'b1', 0.3_wp, static)
    if (modulo(i, 4) >= 2) call rub(machine, 'b1', 'b2', 0.3_wp, static)
    if (modulo(i, 5) == 4) call rub(machine, 'ground', 'b2', 0.1_wp, 0.1_wp)
    if (restituting) then
      call fit(machine, 'ground', last(modulo(i, 3)), stop_with_law(i))
    else if (modulo(i, 7) == 6) then
      call barrier(machine, 'b1', 'b2', uniform(0.3_wp, 0.9_wp), upper=0.6_wp, lower=-0.5_wp)
    else
      call barrier(machine, 'ground', last(modulo(i, 3)), uniform(0.3_wp, 0.9_wp), upper=0.4_wp)
    end if
    call push(machine, last(modulo(i, 3)), 0.2_wp, uniform(0.5_wp, 2.0_wp), 0.3_wp)
    moving = made_ready(machine)
  end function oscillating_structure

  !> Two or four bodies in a row that may rub at up to three positions: stops with a spring and a damper, light or so strong
  !> that the body creeps back, some of which pull; on one side of the last body or both, between bodies, on a surface that moves,
  !> beside rigid ones.
  function pressing_structure(i) result(moving)
    integer, intent(in) :: i
    type(multibody_machine_t) :: moving
    type(multibody_t) :: machine
    type(joint_t) :: stop
    character(len=2) :: name
    integer :: n, k
    n = 2**(1 + modulo(i, 2))
    machine%frequency = uniform(1.0_wp, 2.5_wp)
    do k = 1, n
      write (name, '(a, i1)') 'b', k
      call body(machine, name, uniform(0.5_wp, 2.0_wp))
      if (k == 1) call spring(machine, 'ground', name, uniform(1.0_wp, 3.0_wp), 0.05_wp)
      if (k > 1) call spring(machine, machine%names(k - 1), name, uniform(2.0_wp, 6.0_wp), 0.05_wp)
    end do
    if (modulo(i, 4) < 3) call rub(machine, 'ground', 'b1', 0.3_wp, merge(0.3_wp, 0.45_wp, modulo(i, 4) < 2))
    if (modulo(i, 6) == 2) call rub(machine, 'b1', 'b2', 0.1_wp, 0.15_wp)
    if (modulo(i, 6) == 2) call rub(machine, 'ground', name, 0.1_wp, 0.1_wp, belt=0.1_wp)
    stop%kind = joint_soft
    stop%upper = 0.2_wp
    if (modulo(i, 3) == 0) stop%lower = -0.3_wp
    if (modulo(i, 7) == 3) stop%offset%mean = 0.05_wp
    if (modulo(i, 7) == 3) stop%offset%harmonic = [(0.03_wp, 0.02_wp)]
    stop%contact = contact_t(kind=contact_kelvin_voigt, soft=.true., stiffness=uniform(20.0_wp, 2000.0_wp), &
                             damping=merge(0.0_wp, uniform(0.2_wp, 20.0_wp), modulo(i, 5) == 4), tension=modulo(i, 5) > 2)
    call fit(machine, 'ground', name, stop)
    if (modulo(i, 6) == 5) call barrier(machine, 'b1', 'b2', uniform(0.3_wp, 0.9_wp), upper=0.4_wp)
    stop%lower = -0.2_wp
    stop%contact%damping = uniform(1.0_wp, 3.0_wp)
    stop%contact%tension = .false.
    if (modulo(i, 6) == 4) call fit(machine, 'b1', 'b2', stop)
    call push(machine, name, 0.2_wp, uniform(0.5_wp, 2.0_wp), 0.3_wp)
    moving = made_ready(machine)
  end function pressing_structure

  !> A stop whose restitution depends on the speed.
  function stop_with_law(i) result(joint)
    integer, intent(in) :: i
    type(joint_t) :: joint
    joint%kind = joint_contact
    joint%upper = 0.4_wp
    select case (modulo(i/3, 3))
    case (0)
      joint%contact = contact_t(kind=contact_linear, restitution=0.7_wp, coefficients=[0.2_wp, 0.0_wp])
    case (1)
      joint%contact = contact_t(kind=contact_power, restitution=0.8_wp, coefficients=[0.1_wp, 0.25_wp])
    case default
      joint%contact = contact_t(kind=contact_viscoelastic, coefficients=[0.4_wp, 0.096_wp])
    end select
  end function stop_with_law

  !> Two or four bodies in a row: no spring to the ground; some with a damper there, so strong that nothing oscillates, or
  !> on a belt.
  function drifting_structure(i) result(moving)
    integer, intent(in) :: i
    type(multibody_machine_t) :: moving
    type(multibody_t) :: machine
    character(len=2) :: name
    integer :: n, k
    n = 2**(1 + modulo(i, 2))
    machine%frequency = uniform(1.0_wp, 2.5_wp)
    do k = 1, n
      write (name, '(a, i1)') 'b', k
      call body(machine, name, uniform(0.5_wp, 2.0_wp))
      if (k > 1) call spring(machine, machine%names(k - 1), name, uniform(2.0_wp, 6.0_wp), merge(8.0_wp, 0.1_wp, modulo(i, 5) == 1))
    end do
    if (modulo(i, 4) == 1) call spring(machine, 'ground', 'b1', 0.0_wp, 0.2_wp)
    if (modulo(i, 7) < 5) call rub(machine, 'ground', 'b1', 0.3_wp, merge(0.3_wp, 0.4_wp, modulo(i, 2) == 0), &
                                   merge(0.2_wp, 0.0_wp, modulo(i, 3) == 2))
    if (modulo(i, 3) > 0 .and. modulo(i, 4) > 1) call rub(machine, 'b1', 'b2', 0.2_wp, 0.2_wp)
    call barrier(machine, 'ground', name, uniform(0.3_wp, 0.9_wp), upper=0.5_wp, lower=-0.6_wp)
    if (modulo(i, 3) > 0 .and. modulo(i, 2) > 0) call barrier(machine, 'b1', 'b2', 0.7_wp, upper=0.6_wp, lower=-0.5_wp)
    call push(machine, name, 0.05_wp, uniform(0.5_wp, 2.0_wp), 0.3_wp)
    moving = made_ready(machine)
  end function drifting_structure

  !> A chain of n bodies: the first rubs on the ground, the last is driven and meets a stop.
  function chain(n, restitution, load, amplitude) result(moving)
    integer, intent(in) :: n
    real(wp), intent(in) :: restitution
    real(wp), intent(in), optional :: load, amplitude
    type(multibody_machine_t) :: moving
    type(multibody_t) :: machine
    character(len=2) :: name, before
    real(wp) :: mean, cosine
    integer :: k
    machine%frequency = 8
    before = ''
    do k = 1, n
      write (name, '(a, i1)') 'b', k
      call body(machine, name, 1.0_wp)
      if (k == 1) call spring(machine, 'ground', name, 400.0_wp, 0.2_wp)
      if (k > 1) call spring(machine, before, name, 400.0_wp, 0.2_wp)
      before = name
    end do
    call rub(machine, 'ground', 'b1', 2.0_wp, 2.0_wp)
    call barrier(machine, 'ground', name, restitution, upper=0.05_wp)
    mean = 0
    cosine = 8
    if (present(load)) mean = load
    if (present(amplitude)) cosine = amplitude
    call push(machine, name, mean, cosine, 0.0_wp)
    moving = made_ready(machine)
  end function chain

  !> The machine ready to move, in the widest lanes.
  function made_ready(machine) result(moving)
    type(multibody_t), intent(in) :: machine
    type(multibody_machine_t) :: moving
    moving = on_section(machine, lane_width=widest_lanes())
  end function made_ready

end module lane_structures
