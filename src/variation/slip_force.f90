! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Modes of one body, and the acceleration of a slip in them. Modes are those of module `one_body`.
module slip_force
  use contact_law, only: contact_force, contact_pushes
  use drive_law, only: foot_motion
  use effect_law, only: slip_memory_t
  use friction_law, only: sliding_friction
  use kinds, only: wp
  use motion_state, only: mode_slip_minus, mode_slip_plus
  use oscillator, only: extra_force, oscillator_t
  use restoring_law, only: restoring_force
  implicit none
  private

  public :: slips_in, direction_in, pressed_side, pushes, quarter, slip_acceleration, surface_of

  !> Added to a slip's mode while the body presses the upper or the lower soft barrier.
  integer, parameter, public :: on_upper = 10, on_lower = 20

contains

  !> Whether the body slips in a mode.
  pure elemental logical function slips_in(mode)
    integer, intent(in) :: mode
    slips_in = modulo(mode, 10) == mode_slip_plus .or. modulo(mode, 10) == mode_slip_minus
  end function slips_in

  !> Direction of the slip, 0 at rest.
  pure elemental integer function direction_in(mode)
    integer, intent(in) :: mode
    direction_in = 0
    if (modulo(mode, 10) == mode_slip_plus) direction_in = 1
    if (modulo(mode, 10) == mode_slip_minus) direction_in = -1
  end function direction_in

  !> Side of the soft barrier that is pressed in a mode, 0 without.
  pure elemental integer function pressed_side(mode)
    integer, intent(in) :: mode
    pressed_side = 0
    if (mode > on_upper .and. mode < on_lower) pressed_side = 1
    if (mode > on_lower) pressed_side = -1
  end function pressed_side

  !> Whether the force of a soft barrier that may not pull is there: not on a flight off it, and not where it would pull.
  pure logical function pushes(machine, mode, y)
    type(oscillator_t), intent(in) :: machine
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(2)
    integer :: side
    side = pressed_side(mode)
    pushes = side /= 0
    if (.not. pushes .or. machine%contact%tension) return
    pushes = contact_pushes(machine%contact, side*(y(1) - surface_of(machine, side)), side*y(2))
  end function pushes

  !> Difference of fourth order of the values two and one steps back, one and two further: derivative times the step.
  pure real(wp) function quarter(far_back, back, further, far) result(change)
    real(wp), intent(in) :: far_back, back, further, far
    change = (8*(further - back) - (far - far_back))/12
  end function quarter

  !> Acceleration [m/s^2] in a slip; `pushing`: a soft barrier acts; by these `pieces` of tables, without them by those it is in.
  pure real(wp) function slip_acceleration(machine, mode, pushing, t, x, v, pieces) result(a)
    type(oscillator_t), intent(in) :: machine
    integer, intent(in) :: mode
    logical, intent(in) :: pushing
    real(wp), intent(in) :: t, x, v
    type(slip_memory_t), intent(in), optional :: pieces
    type(slip_memory_t) :: slip
    real(wp) :: foot, extension, direction
    integer :: side
    direction = direction_in(mode)
    if (present(pieces)) slip = pieces
    slip%direction = direction
    slip%x = x
    call foot_motion(machine%drive, machine%drive_frequency*t, foot)
    extension = machine%restoring%free_length + foot - x
    a = restoring_force(machine%restoring, extension) + sliding_friction(machine%friction, v, direction)
    if (machine%extra) a = a + extra_force(machine, slip, t, x, v, extension)
    side = pressed_side(mode)
    if (side /= 0 .and. pushing) a = a - side*contact_force(machine%contact, side*(x - surface_of(machine, side)), side*v)
    a = a/machine%mass
  end function slip_acceleration

  pure real(wp) function surface_of(machine, side) result(surface)
    type(oscillator_t), intent(in) :: machine
    integer, intent(in) :: side
    surface = merge(machine%contact%soft_upper, machine%contact%soft_lower, side > 0)
  end function surface_of

end module slip_force
