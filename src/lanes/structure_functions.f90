! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the lanes of a structure look at in one mode: of every joint a function of time whose limits end a flight.
module structure_functions
  use eigen, only: modulus
  use flight_path, only: begin_change, path_t
  use multibody, only: joint_friction, joint_soft, joint_t, multibody_t
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  use path_rows, only: force_powers, position_powers
  use structure_types, only: lane_functions, lane_powers, structure_mode_t
  implicit none
  private

  public :: never_pulls, set_functions

  !> position s + speed s' of a joint, or the force that holds it as constraint number `held`.
  type :: function_t
    integer :: joint = 0, held = 0
    real(wp) :: position = 0, speed = 0
  end type function_t

contains

  !> Whether a soft contact ends its push before its surface is free.
  pure elemental logical function never_pulls(joint)
    type(joint_t), intent(in) :: joint
    never_pulls = joint%kind == joint_soft .and. .not. joint%contact%tension .and. joint%contact%damping > 0
  end function never_pulls

  !> The functions of all joints in a mode, of which the exponents are known, and what the directions of joints, stops and drifts
  !> add to them and to the coordinates.
  pure subroutine set_functions(machine, flow, mode)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(structure_mode_t), intent(inout) :: mode
    type(function_t) :: list(size(machine%joints) + count(never_pulls(machine%joints)))
    integer :: j
    list = functions_of(machine, flow)
    do j = 1, size(list)
      call set_amplitudes(machine, flow, list(j), j, mode)
    end do
    call set_statics(machine, flow, list, mode)
    call set_drifts(machine, flow, list, mode)
  end subroutine set_functions

  !> One function of each joint, and after them the forces of soft contacts that never pull where they are not pressed.
  pure function functions_of(machine, flow) result(list)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(function_t) :: list(size(machine%joints) + count(never_pulls(machine%joints)))
    integer :: j, pushes
    pushes = size(machine%joints)
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        list(j) = function_t(j, findloc(flow%held, j, 1), position=1.0_wp)
        if (joint%kind == joint_friction) list(j) = function_t(j, list(j)%held, speed=1.0_wp)
        if (.not. never_pulls(joint)) cycle
        pushes = pushes + 1
        if (is_pressed(machine, flow, j)) then
          list(j) = push_of(joint, j)
          list(pushes) = function_t(j)
        else
          list(pushes) = push_of(joint, j)
        end if
      end associate
    end do
  end function functions_of

  !> k s + c s' of a soft contact.
  pure type(function_t) function push_of(joint, j)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: j
    push_of = function_t(j, position=joint%contact%stiffness, speed=joint%contact%damping)
  end function push_of

  pure logical function is_pressed(machine, flow, j)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    integer, intent(in) :: j
    is_pressed = machine%joints(j)%kind == joint_soft .and. btest(flow%key, j - 1)
  end function is_pressed

  !> Exponentials and harmonics in function number `at`.
  pure subroutine set_amplitudes(machine, flow, look, at, mode)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(function_t), intent(in) :: look
    integer, intent(in) :: at
    type(structure_mode_t), intent(inout) :: mode
    complex(wp) :: part, amplitude
    integer :: k, m
    do k = 1, size(flow%exponent)
      if (look%held > 0) then
        part = flow%force_shape(k, look%held)
      else
        part = flow%joint_shape(k, look%joint)*(look%position + look%speed*flow%exponent(k))
      end if
      mode%part_re(at, k) = real(part)
      mode%part_im(at, k) = aimag(part)
      mode%part_size(at, k) = modulus(part)
    end do
    do m = 1, size(flow%response, 2)
      if (look%held > 0) then
        amplitude = flow%force_response(m, look%held)
      else
        amplitude = flow%joint_response(m, look%joint)*cmplx(look%position, look%speed*(m*machine%frequency), wp)
      end if
      mode%amplitude_re(at, m) = real(amplitude)
      mode%amplitude_im(at, m) = aimag(amplitude)
      mode%steady(at) = mode%steady(at) + modulus(amplitude)
      mode%steady_sixth(at) = mode%steady_sixth(at) + modulus(amplitude)*(m*machine%frequency)**6
    end do
  end subroutine set_amplitudes

  !> Where the load and the surfaces would take the structure, by powers of time, and what each joint adds to that: friction in
  !> its direction, the position where it is held, or that of the stop that is pressed.
  pure subroutine set_statics(machine, flow, list, mode)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(function_t), intent(in) :: list(:)
    type(structure_mode_t), intent(inout) :: mode
    real(wp), dimension(machine%n) :: none, force, position
    type(path_t) :: path
    logical :: drifts
    integer :: j, i
    none = 0
    associate (n => machine%n)
      force = machine%load
      do j = 1, size(machine%joints)
        if (.not. is_pressed(machine, flow, j)) cycle
        associate (joint => machine%joints(j))
          force = force - joint%contact%stiffness*joint%offset%mean*joint%row
        end associate
      end do
      call begin_change(machine, flow, none, none, force, path, -machine%joints%offset%rate)
      mode%still(:n, :) = path%powers(:n, :)
      call set_levels(machine, flow, list, path, .true., mode%level)
      drifts = mode%drifts > 0 .or. any(abs(path%powers(:n, 1:)) > 0)
      do j = 1, size(machine%joints)
        associate (joint => machine%joints(j))
          i = findloc(flow%held, j, 1)
          force = 0
          position = 0
          if (i > 0) position = flow%carried(:, i)
          if (joint%kind == joint_friction .and. i == 0) force = -joint%friction%kinetic*joint%row
          if (is_pressed(machine, flow, j)) force = joint%contact%stiffness*joint%row
        end associate
        call begin_change(machine, flow, position, none, force, path)
        mode%still_by_joint(:n, j, :) = path%powers(:n, :)
        call set_levels(machine, flow, list, path, .false., mode%level_by_joint(j, :, :))
        drifts = drifts .or. any(abs(path%powers(:n, 1:)) > 0)
      end do
    end associate
    mode%powers = merge(lane_powers, 1, drifts)
  end subroutine set_statics

  !> What a position and a pace along each direction without a spring add to the functions.
  pure subroutine set_drifts(machine, flow, list, mode)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(function_t), intent(in) :: list(:)
    type(structure_mode_t), intent(inout) :: mode
    real(wp) :: level(lane_functions, lane_powers)
    type(path_t) :: path
    integer :: d
    path%force = 0
    path%force_rate = 0
    do d = 1, nint(mode%drifts)
      path%powers = 0
      path%powers(:machine%n, 0) = mode%drift(:machine%n, d)
      level = 0
      call set_levels(machine, flow, list, path, .false., level)
      mode%level_by_position(:, d) = level(:, 1)
      path%powers = 0
      path%powers(:machine%n, 1) = mode%drift(:machine%n, d)
      level = 0
      call set_levels(machine, flow, list, path, .false., level)
      mode%level_by_pace(:, d, :) = level(:, :2)
    end do
  end subroutine set_drifts

  !> Powers of time in the functions (rows) along a path, with the given part of their coordinates or without.
  pure subroutine set_levels(machine, flow, list, path, with_offset, level)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(function_t), intent(in) :: list(:)
    type(path_t), intent(in) :: path
    logical, intent(in) :: with_offset
    real(wp), intent(inout) :: level(:, :)
    real(wp) :: powers(0:3)
    integer :: k
    do k = 1, size(list)
      if (list(k)%held > 0) then
        level(k, :) = force_powers(machine, flow, path, list(k)%held)
        cycle
      end if
      powers = matmul(machine%joints(list(k)%joint)%row, path%powers(:machine%n, :))
      if (with_offset) powers = position_powers(machine, path, list(k)%joint)
      level(k, :) = list(k)%position*powers + list(k)%speed*[powers(1), 2*powers(2), 3*powers(3), 0.0_wp]
    end do
  end subroutine set_levels

end module structure_functions
