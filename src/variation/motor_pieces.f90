! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Pieces of the equations of a motor, between which the rates of a flight are continuous but for that of an integral that begins to
!> be held: those of a table of the torque, a torque at its limit, an integral at its own.
module motor_pieces
  use curve_law, only: piece_at
  use kinds, only: wp
  use motor_system, only: w_at, y_at
  use motor_torque, only: motor_control_t, set_limits, set_piece
  implicit none
  private

  public :: has_pieces, piece_of, set_parameters, stop_at_piece, value_of

  !> Parts of a step at whose ends it is looked whether a piece ends.
  integer, parameter :: parts = 16

  type, public :: motor_piece_t
    !> Piece of the table; limit (1, -1; 0: none) at which the torque is, and at which the integral is held.
    integer :: table = 0, limited = 0, held = 0
  end type motor_piece_t

contains

  !> Whether the equations change from piece to piece.
  pure logical function has_pieces(control)
    type(motor_control_t), intent(in) :: control
    has_pieces = control%curve%count > 0 .or. control%command > 0
  end function has_pieces

  !> The piece in which a state is, by its variables and the values of the nodes.
  pure type(motor_piece_t) function piece_of(control, z, value) result(piece)
    type(motor_control_t), intent(in) :: control
    real(wp), intent(in) :: z(:), value(:)
    if (control%curve%count > 0) piece%table = piece_at(control%curve, z(w_at))
    if (control%command == 0) return
    if (abs(value(control%command)) > control%torque_limit) piece%limited = nint(sign(1.0_wp, value(control%command)))
    if (.not. control%largest_integral > 0) return
    if (abs(z(y_at)) >= control%largest_integral .and. z(y_at)*value(control%miss) > 0) piece%held = nint(sign(1.0_wp, z(y_at)))
  end function piece_of

  !> The parameters of a piece.
  pure subroutine set_parameters(control, piece, parameters)
    type(motor_control_t), intent(in) :: control
    type(motor_piece_t), intent(in) :: piece
    real(wp), intent(inout) :: parameters(:)
    if (control%curve%count > 0) call set_piece(control, piece%table, parameters)
    if (control%command > 0) call set_limits(control, piece%limited, piece%held, parameters)
  end subroutine set_parameters

  !> Shortens a step with the coefficients `c` of all nodes to where its piece ends. `next` is the piece after it; `own`: nodes of
  !> crank speed and integral.
  pure subroutine stop_at_piece(control, c, own, step, piece, next)
    type(motor_control_t), intent(in) :: control
    real(wp), intent(in) :: c(0:, :)
    integer, intent(in) :: own(2)
    real(wp), intent(inout) :: step
    type(motor_piece_t), intent(in) :: piece
    type(motor_piece_t), intent(out) :: next
    real(wp) :: inside, beyond, middle
    integer :: i
    next = piece
    if (.not. has_pieces(control)) return
    do i = 1, parts
      if (.not. ends(piece, after(control, c, own, step*i/parts, piece))) cycle
      inside = step*(i - 1)/parts
      beyond = step*i/parts
      do
        middle = (inside + beyond)/2
        if (.not. (abs(middle - inside) > 0 .and. abs(middle - beyond) > 0)) exit
        if (ends(piece, after(control, c, own, middle, piece))) then
          beyond = middle
        else
          inside = middle
        end if
      end do
      step = beyond
      next = after(control, c, own, step, piece)
      return
    end do
  end subroutine stop_at_piece

  pure logical function ends(piece, next)
    type(motor_piece_t), intent(in) :: piece, next
    ends = piece%table /= next%table .or. piece%limited /= next%limited .or. piece%held /= next%held
  end function ends

  !> The piece that follows at a time of a step, or the same one.
  pure type(motor_piece_t) function after(control, c, own, t, piece) result(next)
    type(motor_control_t), intent(in) :: control
    real(wp), intent(in) :: c(0:, :), t
    integer, intent(in) :: own(2)
    type(motor_piece_t), intent(in) :: piece
    real(wp) :: command, integral
    next = piece
    if (control%curve%count > 0) next%table = piece%table + side_of(control, piece%table, value_of(c(:, own(1)), t))
    if (control%command == 0) return
    command = value_of(c(:, control%command), t)
    if (abs(command) > control%torque_limit) then
      next%limited = nint(sign(1.0_wp, command))
    else if (piece%limited*command < control%torque_limit) then
      next%limited = 0
    end if
    if (.not. control%largest_integral > 0) return
    if (piece%held /= 0) then
      if (piece%held*value_of(c(:, control%miss), t) < 0) next%held = 0
    else
      integral = value_of(c(:, own(2)), t)
      if (abs(integral) > control%largest_integral .and. integral*value_of(c(:, control%miss), t) > 0) then
        next%held = nint(sign(1.0_wp, integral))
      end if
    end if
  end function after

  !> Whether a speed is below (-1) or above (1) a piece of the table.
  pure integer function side_of(control, piece, w) result(side)
    type(motor_control_t), intent(in) :: control
    integer, intent(in) :: piece
    real(wp), intent(in) :: w
    side = 0
    associate (curve => control%curve)
      if (piece > 0) then
        if (w < curve%at(piece)) side = -1
      end if
      if (piece < curve%count) then
        if (w > curve%at(piece + 1)) side = 1
      end if
    end associate
  end function side_of

  pure real(wp) function value_of(c, t) result(value)
    real(wp), intent(in) :: c(0:), t
    integer :: k
    value = 0
    do k = ubound(c, 1), 0, -1
      value = value*t + c(k)
    end do
  end function value_of

end module motor_pieces
