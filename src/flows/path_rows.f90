! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What joints and guards are along the motion of a linear mode.
module path_rows
  use flight_path, only: path_t
  use guards, only: joint_guard_t
  use multibody, only: multibody_t
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  implicit none
  private

  public :: position_powers, force_powers, guard_row, size_of_row

contains

  !> Powers of time in a joint coordinate.
  pure function position_powers(machine, path, j) result(p)
    type(multibody_t), intent(in) :: machine
    type(path_t), intent(in) :: path
    integer, intent(in) :: j
    real(wp) :: p(0:3)
    associate (joint => machine%joints(j))
      p = matmul(joint%row, path%powers(:machine%n, :))
      p(0) = p(0) + joint%offset%mean + joint%offset%rate*path%start
      p(1) = p(1) + joint%offset%rate
    end associate
  end function position_powers

  !> Powers of time in the force of constraint number `i` of the mode.
  pure function force_powers(machine, flow, path, i) result(p)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    integer, intent(in) :: i
    real(wp) :: p(0:3), by_position(machine%n), by_speed(machine%n)
    integer :: n
    n = machine%n
    by_position = matmul(flow%reaction(i, :), flow%stiffness)
    by_speed = matmul(flow%reaction(i, :), flow%damping)
    p = matmul(by_position, path%powers(:n, :))
    p(0:2) = p(0:2) + [1, 2, 3]*matmul(by_speed, path%powers(:n, 1:3))
    p(0) = p(0) - sum(flow%reaction(i, :)*path%force(:n))
    p(1) = p(1) - sum(flow%reaction(i, :)*path%force_rate(:n))
  end function force_powers

  !> The row of a guard over the unknowns of the series.
  pure function guard_row(machine, flow, path, guard) result(row)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(joint_guard_t), intent(in) :: guard
    real(wp) :: row(size(path%unknowns))
    integer :: one
    one = 2*machine%n + 1
    associate (offset => machine%joints(guard%joint)%offset, n => machine%n)
      row = guard%position*flow%position_row(:, guard%joint) + guard%speed*flow%speed_row(:, guard%joint)
      row(one) = row(one) + guard%constant + guard%position*(offset%mean + offset%rate*path%start) + guard%speed*offset%rate
      row(one + 1) = row(one + 1) + guard%position*offset%rate
      if (guard%held > 0) then
        row = row + guard%force*flow%force_row(:, guard%held)
        row(one) = row(one) - guard%force*sum(flow%reaction(guard%held, :)*path%force(:n))
        row(one + 1) = row(one + 1) - guard%force*sum(flow%reaction(guard%held, :)*path%force_rate(:n))
      end if
    end associate
  end function guard_row

  !> Sizes of what the row of a guard is a sum of, for its rounding.
  pure function size_of_row(machine, flow, path, guard) result(row)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(joint_guard_t), intent(in) :: guard
    real(wp) :: row(size(path%unknowns))
    integer :: one
    one = 2*machine%n + 1
    associate (offset => machine%joints(guard%joint)%offset, n => machine%n)
      row = abs(guard%position*flow%position_row(:, guard%joint)) + abs(guard%speed*flow%speed_row(:, guard%joint))
      row(one) = row(one) + abs(guard%constant) + abs(guard%position)*(abs(offset%mean) + abs(offset%rate*path%start)) &
                 + abs(guard%speed*offset%rate)
      row(one + 1) = row(one + 1) + abs(guard%position*offset%rate)
      if (guard%held == 0) return
      row = row + abs(guard%force)*flow%size_of_force_row(:, guard%held)
      row(one) = row(one) + abs(guard%force)*sum(abs(flow%reaction(guard%held, :))*abs(path%force(:n)))
      row(one + 1) = row(one + 1) + abs(guard%force)*sum(abs(flow%reaction(guard%held, :))*abs(path%force_rate(:n)))
    end associate
  end function size_of_row

end module path_rows
