! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The torque of a motor and its own state as equations: nodes `torque`, `current`, `y_rate`; guards of its limits, of a table and
!> of a ramp.
module motor_torque
  use curve_law, only: curve_of, curve_t, most_knots, piece_at, pieces_of
  use equation_sheet, only: add_parameter, add_variable, define, node_of, parameter_number, sheet_t
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, value_of
  implicit none
  private

  public :: add_motor, set_limits, set_piece

  !> Guards of a motor, by name.
  character(len=*), parameter, public :: control_guards(8) = [character(len=13) :: 'ramp_end', 'limit_up', 'limit_down', &
    'integral_up', 'integral_down', 'resume', 'piece_up', 'piece_down']

  type, public :: motor_control_t
    !> Whether there is a state of its own; number of the variable that a ramp changes, 0 without a ramp.
    logical :: has_own = .false.
    integer :: supply = 0
    !> Begin, end and rate of the ramp.
    real(wp) :: from = 0, to = 0, rate = 0
    !> Largest torque of a speed control [N m], and the integral that gives it alone [rad]; 0: none.
    real(wp) :: torque_limit = 0, largest_integral = 0
    !> Nodes of a limited control: the torque that it asks for, and the reference less the speed.
    integer :: command = 0, miss = 0
    !> Table of the torque, and its polynomials.
    type(curve_t) :: curve
    real(wp) :: pieces(0:3, 0:most_knots) = 0
    !> Numbers of parameters: rate of the ramp; of a limited control whether the torque follows the control, the limit that it is
    !> at, and whether the integral grows; knots and coefficients of the piece of a table.
    integer :: ramp_rate = 0, follows = 0, limited = 0, integrates = 0, piece(7) = 0
  end type motor_control_t

contains

  !> Adds a motor. `w` is a variable of the sheet.
  pure subroutine add_motor(motor, sheet, control)
    type(law_choice_t), intent(in) :: motor
    type(sheet_t), intent(inout) :: sheet
    type(motor_control_t), intent(out) :: control
    integer :: i
    ! The variable of the motor comes before that of a ramp.
    select case (motor%name)
    case ('linear')
      call add_supply(motor, 'no_load_speed', sheet, control)
      call add_values(motor, ['stall_torque'], sheet)
      call define(sheet, 'torque', 'stall_torque*(1 - w/no_load_speed)')
    case ('kloss')
      call add_supply(motor, 'synchronous_speed', sheet, control)
      call add_values(motor, [character(len=16) :: 'breakdown_torque', 'breakdown_slip'], sheet)
      call define(sheet, 'lag', '1 - w/synchronous_speed')
      call define(sheet, 'torque', '2*breakdown_torque*breakdown_slip*lag/(lag^2 + breakdown_slip^2)')
    case ('dc')
      control%has_own = value_of(motor, 'inductance') > 0
      if (control%has_own) call add_variable(sheet, 'y')
      call add_supply(motor, 'voltage', sheet, control)
      call add_values(motor, [character(len=15) :: 'torque_constant', 'resistance', 'inductance'], sheet)
      if (control%has_own) then
        call define(sheet, 'y_rate', '(voltage - resistance*y - torque_constant*w)/inductance')
        call define(sheet, 'current', 'y')
      else
        call define(sheet, 'current', '(voltage - torque_constant*w)/resistance')
      end if
      call define(sheet, 'torque', 'torque_constant*current')
    case ('pi')
      control%has_own = .true.
      call add_variable(sheet, 'y')
      call add_supply(motor, 'reference', sheet, control)
      call add_values(motor, [character(len=12) :: 'proportional', 'integral'], sheet)
      call add_control(motor, sheet, control)
    case default
      call add_table(motor, sheet, control)
    end select
    do i = 1, size(control_guards)
      if (node_of(sheet, control_guards(i)) == 0) call define(sheet, control_guards(i), '0')
    end do
  end subroutine add_motor

  pure subroutine add_values(choice, names, sheet)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: names(:)
    type(sheet_t), intent(inout) :: sheet
    integer :: i
    do i = 1, size(names)
      call add_parameter(sheet, names(i), value_of(choice, trim(names(i))))
    end do
  end subroutine add_values

  !> What a ramp changes: a parameter, with a ramp a variable that grows at a steady rate.
  pure subroutine add_supply(motor, name, sheet, control)
    type(law_choice_t), intent(in) :: motor
    character(len=*), intent(in) :: name
    type(sheet_t), intent(inout) :: sheet
    type(motor_control_t), intent(inout) :: control
    control%to = value_of(motor, name)
    if (.not. value_of(motor, 'ramp_time') > 0) then
      call add_parameter(sheet, name, control%to)
      return
    end if
    call add_variable(sheet, name)
    control%supply = sheet%variables
    control%from = value_of(motor, 'ramp_from')
    control%rate = (control%to - control%from)/value_of(motor, 'ramp_time')
    call add_parameter(sheet, 'ramp_rate', control%rate)
    call add_parameter(sheet, 'ramp_to', control%to)
    call define(sheet, 'ramp_end', name//' - ramp_to')
    control%ramp_rate = parameter_number(sheet, 'ramp_rate')
  end subroutine add_supply

  !> A speed control; its integral is held where it alone gives the largest torque, so that it does not wind up.
  pure subroutine add_control(motor, sheet, control)
    type(law_choice_t), intent(in) :: motor
    type(sheet_t), intent(inout) :: sheet
    type(motor_control_t), intent(inout) :: control
    call define(sheet, 'miss', 'reference - w')
    call define(sheet, 'command', 'proportional*miss + integral*y')
    control%torque_limit = value_of(motor, 'torque_limit')
    if (.not. control%torque_limit > 0) then
      call define(sheet, 'y_rate', 'miss')
      call define(sheet, 'torque', 'command')
      return
    end if
    if (value_of(motor, 'integral') > 0) control%largest_integral = control%torque_limit/value_of(motor, 'integral')
    call add_parameter(sheet, 'torque_limit', control%torque_limit)
    call add_parameter(sheet, 'follows', 1.0_wp)
    call add_parameter(sheet, 'limited', 0.0_wp)
    call add_parameter(sheet, 'integrates', 1.0_wp)
    call define(sheet, 'y_rate', 'integrates*miss')
    call define(sheet, 'torque', 'follows*command + limited*torque_limit')
    call define(sheet, 'limit_up', 'command - torque_limit')
    call define(sheet, 'limit_down', 'command + torque_limit')
    call define(sheet, 'integral_up', 'integral*y - torque_limit')
    call define(sheet, 'integral_down', 'integral*y + torque_limit')
    call define(sheet, 'resume', 'w - reference')
    control%command = node_of(sheet, 'command')
    control%miss = node_of(sheet, 'miss')
    control%follows = parameter_number(sheet, 'follows')
    control%limited = parameter_number(sheet, 'limited')
    control%integrates = parameter_number(sheet, 'integrates')
  end subroutine add_control

  !> A table of the torque: the polynomial of one piece, whose coefficients change from piece to piece.
  pure subroutine add_table(motor, sheet, control)
    type(law_choice_t), intent(in) :: motor
    type(sheet_t), intent(inout) :: sheet
    type(motor_control_t), intent(inout) :: control
    character(len=*), parameter :: names(7) = [character(len=10) :: 'knot', 'piece_c0', 'piece_c1', 'piece_c2', 'piece_c3', &
      'piece_low', 'piece_high']
    integer :: i
    control%curve = curve_of(list_of(motor, 'speed'), list_of(motor, 'torque'))
    ! Straight on before the first knot, too.
    control%pieces(:, :control%curve%count) = pieces_of(control%curve)
    control%pieces(1, 0) = control%curve%slope(1)
    do i = 1, size(names)
      call add_parameter(sheet, names(i), 0.0_wp)
      control%piece(i) = parameter_number(sheet, names(i))
    end do
    call define(sheet, 'from_knot', 'w - knot')
    call define(sheet, 'torque', 'piece_c0 + from_knot*(piece_c1 + from_knot*(piece_c2 + from_knot*piece_c3))')
    call define(sheet, 'piece_up', 'w - piece_high')
    call define(sheet, 'piece_down', 'w - piece_low')
    call set_piece(control, piece_at(control%curve, 0.0_wp), sheet%parameters)
  end subroutine add_table

  !> The parameters of a torque and of an integral at a limit (1, -1) or not (0).
  pure subroutine set_limits(control, limited, held, parameters)
    type(motor_control_t), intent(in) :: control
    integer, intent(in) :: limited, held
    real(wp), intent(inout) :: parameters(:)
    parameters(control%follows) = merge(1, 0, limited == 0)
    parameters(control%limited) = limited
    parameters(control%integrates) = merge(1, 0, held == 0)
  end subroutine set_limits

  !> The parameters of a piece of the table.
  pure subroutine set_piece(control, piece, parameters)
    type(motor_control_t), intent(in) :: control
    integer, intent(in) :: piece
    real(wp), intent(inout) :: parameters(:)
    associate (at => control%curve%at, last => control%curve%count)
      parameters(control%piece) = [at(max(1, piece)), control%pieces(:, piece), at(max(1, piece)), at(min(piece + 1, last))]
    end associate
  end subroutine set_piece

end module motor_torque
