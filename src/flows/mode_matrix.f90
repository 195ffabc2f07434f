! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The motion of a multibody structure in one mode as y' = A y: for the exponential series, which every linear structure has.
module mode_matrix
  use eigen, only: modulus
  use multibody, only: multibody_t, offset_of
  use kinds, only: wp
  use mode_flow_type, only: mode_flow_t
  implicit none
  private

  public :: set_matrix

contains

  !> The matrix of the motion with everything that drives it. Constant and linear parts of the forces belong to the flight:
  !> their columns are left to it.
  pure subroutine set_matrix(machine, flow, forcing, surface)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(inout) :: flow
    complex(wp), intent(in) :: forcing(:, :), surface(:, :)
    real(wp), allocatable :: push(:, :), power(:, :)
    complex(wp), allocatable :: driven(:)
    real(wp) :: size_of_matrix, size_of_power, w
    integer :: n, m, i, harmonics, c
    n = machine%n
    harmonics = size(forcing, 2)
    allocate (flow%matrix(2*n + 2 + 2*harmonics, 2*n + 2 + 2*harmonics), source=0.0_wp)
    push = held_mobility(machine, flow)
    do i = 1, n
      flow%matrix(i, n + i) = 1
    end do
    flow%matrix(n + 1:2*n, :n) = -matmul(push, flow%stiffness)
    flow%matrix(n + 1:2*n, n + 1:2*n) = -matmul(push, flow%damping)
    flow%matrix(2*n + 2, 2*n + 1) = 1
    do m = 1, harmonics
      c = 2*n + 1 + 2*m
      w = m*machine%frequency
      driven = matmul(push, forcing(:, m)) + w**2*matmul(flow%carried, surface(flow%independent, m))
      flow%matrix(n + 1:2*n, c) = real(driven)
      flow%matrix(n + 1:2*n, c + 1) = -aimag(driven)
      flow%matrix(c, c + 1) = -w
      flow%matrix(c + 1, c) = w
    end do
    size_of_matrix = maxval(sum(abs(flow%matrix), dim=1))
    power = flow%matrix/size_of_matrix
    do i = 1, 4
      power = matmul(power, power)
    end do
    size_of_power = maxval(sum(abs(power), dim=1))
    do i = 1, 4
      size_of_power = sqrt(size_of_power)
    end do
    flow%rate = max(size_of_matrix*size_of_power, machine%frequency)
    call set_matrix_rows(machine, flow, forcing, surface)
  end subroutine set_matrix

  !> Joint coordinates, speeds and forces of constraints as rows over the unknowns of the matrix; their constant and linear
  !> parts are left to the flight.
  pure subroutine set_matrix_rows(machine, flow, forcing, surface)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(inout) :: flow
    complex(wp), intent(in) :: forcing(:, :), surface(:, :)
    complex(wp), allocatable :: driven(:)
    complex(wp) :: amplitude
    real(wp) :: w
    integer :: n, m, j, c, unknowns
    n = machine%n
    unknowns = size(flow%matrix, 1)
    allocate (flow%position_row(unknowns, size(machine%joints)), flow%speed_row(unknowns, size(machine%joints)), &
              flow%force_row(unknowns, size(flow%held)), flow%size_of_force_row(unknowns, size(flow%held)), source=0.0_wp)
    do j = 1, size(machine%joints)
      flow%position_row(:n, j) = machine%joints(j)%row
      flow%speed_row(n + 1:2*n, j) = machine%joints(j)%row
    end do
    flow%force_row(:n, :) = transpose(matmul(flow%reaction, flow%stiffness))
    flow%force_row(n + 1:2*n, :) = transpose(matmul(flow%reaction, flow%damping))
    flow%size_of_force_row(:n, :) = transpose(matmul(abs(flow%reaction), abs(flow%stiffness)))
    flow%size_of_force_row(n + 1:2*n, :) = transpose(matmul(abs(flow%reaction), abs(flow%damping)))
    do m = 1, size(forcing, 2)
      c = 2*n + 1 + 2*m
      w = m*machine%frequency
      do j = 1, size(machine%joints)
        amplitude = offset_of(machine%joints(j), m)
        flow%position_row(c:c + 1, j) = [real(amplitude), -aimag(amplitude)]
        amplitude = amplitude*cmplx(0.0_wp, w, wp)
        flow%speed_row(c:c + 1, j) = [real(amplitude), -aimag(amplitude)]
      end do
      driven = -matmul(flow%reaction, forcing(:, m)) + w**2*matmul(flow%hold, surface(:, m))
      flow%force_row(c, :) = real(driven)
      flow%force_row(c + 1, :) = -aimag(driven)
      flow%size_of_force_row(c, :) = matmul(abs(flow%reaction), modulus(forcing(:, m))) &
                                     + w**2*matmul(abs(flow%hold), modulus(surface(:, m)))
      flow%size_of_force_row(c + 1, :) = flow%size_of_force_row(c, :)
    end do
  end subroutine set_matrix_rows

  !> Accelerations per force on the coordinates, with the constraints held.
  pure function held_mobility(machine, flow) result(push)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    real(wp) :: push(machine%n, machine%n)
    integer :: i, k
    push = machine%mobility
    do i = 1, size(flow%independent)
      associate (row => machine%joints(flow%held(flow%independent(i)))%row)
        do k = 1, machine%n
          push(:, k) = push(:, k) - flow%carried(:, i)*sum(row*machine%mobility(:, k))
        end do
      end associate
    end do
  end function held_mobility

end module mode_matrix
