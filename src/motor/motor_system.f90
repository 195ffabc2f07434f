! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The equations of a body with a motor, or by expressions, on one tape: its variables, guards, modes and flights.
module motor_system
  use contact_law, only: contact_t
  use equation_sheet, only: sheet_t
  use friction_law, only: friction_t
  use kinds, only: wp
  use motor_torque, only: motor_control_t
  use series_flight, only: flight_t
  use tape_series, only: series_t
  implicit none
  private

  public :: stays_within_half_turn

  !> Variables.
  integer, parameter, public :: phi_at = 1, w_at = 2, x_at = 3, v_at = 4, y_at = 5

  !> Guards: the stops; v and w zero; a turn forwards or back; what holds the body and the crank at its limits; the largest
  !> velocity, which ends no mode; those of the motor (`control_guards`).
  integer, parameter, public :: guard_upper = 1, guard_lower = 2, guard_turning = 3, guard_standstill = 4, guard_section = 5, &
    guard_back = 6, guard_body_up = 7, guard_body_down = 8, guard_crank_up = 9, guard_crank_down = 10, guard_fastest = 11, &
    guard_ramp_end = 12, guard_limit_up = 13, guard_limit_down = 14, guard_integral_up = 15, guard_integral_down = 16, &
    guard_resume = 17, guard_piece_up = 18, guard_piece_down = 19, guard_count = 19
  !> A mode of the equations: which of body and crank move.
  integer, parameter, public :: both_move = 1, body_held = 2, crank_held = 3, both_held = 4
  !> Terms that decide which way a motion from rest goes.
  integer, parameter, public :: low_order = 8
  !> Stops that are not there [m]: bounds of their guards stay finite.
  real(wp), parameter, public :: far = 1e30_wp

  type, public :: motor_system_t
    type(sheet_t) :: sheet
    !> Number of variables: 4, and states beside them; with a motor one of its own and one that a ramp changes.
    integer :: variables = 4
    type(motor_control_t) :: control
    !> A motion per mode, without and with work, dry and viscous losses [J] as three further states.
    type(flight_t) :: flights(4, 0:1)
    !> With a motor: room for the first Taylor coefficients of everything in a mode.
    type(series_t) :: low(4)
    real(wp) :: mass = 1, stiffness = 0, free_length = 0
    type(friction_t) :: friction
    type(contact_t) :: contact
    !> The body carries an unbalance of this moment [kg m]; 0: a mechanism moves the foot of the spring.
    real(wp) :: moment = 0
    !> Largest torque by which the bearing holds the crank [N m], force by which friction holds the body [N]; at least rounding, so
    !> that a machine without dry friction comes to rest.
    real(wp) :: crank_level = 0, body_level = 0
    !> Speed without torque [rad/s]; size of the motor's own state, current [A] or integral [rad].
    real(wp) :: no_load_speed = 0, own_size = 1
    !> Numbers of the parameters of signs.
    integer :: slip = 0, turning = 0
    !> Inertia of the crank alone [kg m^2].
    real(wp) :: rotor_inertia = 1
    !> Nodes: torque of the motor, of the spring or body on the crank, foot, its slope, energies, inertia, its slope, current.
    integer :: torque = 0, load = 0, foot = 0, foot_slope = 0, kinetic = 0, energy = 0, inertia = 0, inertia_slope = 0, current = 0
    !> Node of the energy of the spring, where its foot follows an expression; 0 otherwise.
    integer :: stored = 0
    !> Nodes, by mode: what holds the body [N] and the crank [N m] or would if they were at rest.
    integer :: body_hold(4) = 0, crank_hold(4) = 0
    !> Nothing is driven by a motor: the first variable is the time [s], the second one the phase [rad].
    logical :: clock = .false.
    !> Without a motor: time from section to section [s], none if it is 0; whether forces depend on the time without any period.
    real(wp) :: period = 0
    logical :: aperiodic = .false.
    !> Without a motor: the angle [rad] after which the equations are the same again, 0 of a position. Without a drive the motion
    !> then passes from half a turn to the other side of it, which is a section.
    real(wp) :: turn = 0
    !> Without a motor, nodes: restitution, friction at rest [N], slope of the forces over the position [N/m]; and each force [N].
    integer :: restitution = 0, rest_friction = 0, force_slope = 0
    integer, allocatable :: forces(:)
  end type motor_system_t

contains

  !> Whether an angle without a drive stays within half a turn, which it passes by an event.
  pure logical function stays_within_half_turn(system)
    type(motor_system_t), intent(in) :: system
    stays_within_half_turn = system%turn > 0 .and. .not. system%period > 0 .and. .not. system%aperiodic
  end function stays_within_half_turn

end module motor_system
