! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Structures of several coordinates as parts of a machine: their matrices, how they start where one of their points is
!> moved, and the point as a coordinate.
module structure_block
  use assembly, only: add_body
  use eigen, only: symmetric_eigen, undamped_modes
  use multibody, only: multibody_t
  use kinds, only: wp
  use text, only: to_text
  implicit none
  private

  public :: add_structure, modal_damping, start_shapes, make_coordinate, is_symmetric, smallest_share

  !> Squared frequencies below this share of the highest are those of rigid motions.
  real(wp), parameter, public :: rigid_share = 1e-12_wp

contains

  !> Adds the coordinates NAME.1, NAME.2, ... with their matrices; `start`: their values and rates (rows) at the start.
  pure subroutine add_structure(machine, name, mass, damping, stiffness, start)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: mass(:, :), damping(:, :), stiffness(:, :), start(:, :)
    integer :: i, first, last
    first = machine%n + 1
    do i = 1, size(mass, 1)
      call add_body(machine, name//'.'//to_text(i), 0.0_wp, 0.0_wp)
    end do
    last = machine%n
    machine%mass(first:last, first:last) = mass
    machine%damping(first:last, first:last) = damping
    machine%stiffness(first:last, first:last) = stiffness
    machine%start(:, first:last) = start
  end subroutine add_structure

  !> The damping matrix that gives every mode the damping ratio `ratio`: sum of 2 ratio w (M phi) (M phi)'.
  pure function modal_damping(mass, stiffness, ratio) result(damping)
    real(wp), intent(in) :: mass(:, :), stiffness(:, :), ratio
    real(wp) :: damping(size(mass, 1), size(mass, 1))
    real(wp), dimension(size(mass, 1), size(mass, 1)) :: shapes, momenta
    real(wp) :: squares(size(mass, 1))
    integer :: i, k
    call undamped_modes(stiffness, mass, squares, shapes)
    momenta = matmul(mass, shapes)
    damping = 0
    do k = 1, size(squares)
      do i = 1, size(squares)
        damping(:, i) = damping(:, i) + 2*ratio*sqrt(max(squares(k), 0.0_wp))*momenta(:, k)*momenta(i, k)
      end do
    end do
  end function modal_damping

  !> How a structure starts where the point `row` is moved by one: displaced as a force there bends it at rest (of one that
  !> such a force moves away, its rigid motion), and with the velocities that an impulse there gives.
  pure subroutine start_shapes(mass, stiffness, row, position, velocity)
    real(wp), intent(in) :: mass(:, :), stiffness(:, :), row(:)
    real(wp), intent(out) :: position(:), velocity(:)
    real(wp) :: squares(size(row)), shapes(size(row), size(row)), share(size(row)), weight(size(row))
    logical :: rigid(size(row))
    call undamped_modes(stiffness, mass, squares, shapes)
    share = matmul(row, shapes)
    rigid = squares <= rigid_share*maxval(abs(squares)) .and. abs(share) > 1e-9_wp*maxval(abs(share))
    weight = share
    velocity = matmul(shapes, weight)/sum(share*weight)
    if (any(rigid)) then
      weight = merge(share, 0.0_wp, rigid)
    else
      weight = merge(share/max(squares, tiny(1.0_wp)), 0.0_wp, squares > rigid_share*maxval(abs(squares)))
    end if
    position = matmul(shapes, weight)/sum(share*weight)
  end subroutine start_shapes

  !> Makes the displacement row(:, k) of a position a coordinate, in place of the one that has the largest part in it among those
  !> not yet `taken`; `at` is its number, 0 if the position moves with those that are taken. All rows follow.
  pure subroutine make_coordinate(machine, rows, k, name, taken, at)
    type(multibody_t), intent(inout) :: machine
    real(wp), intent(inout) :: rows(:, :)
    integer, intent(in) :: k
    character(len=*), intent(in) :: name
    logical, intent(inout) :: taken(:)
    integer, intent(out) :: at
    real(wp) :: change(machine%n, machine%n), row(machine%n)
    integer :: i
    row = rows(:, k)
    at = maxloc(abs(row), 1, mask=.not. taken)
    if (at > 0) then
      if (abs(row(at)) <= 1e-9_wp*maxval(abs(row))) at = 0
    end if
    if (at == 0) return
    taken(at) = .true.
    machine%names(at) = name
    change = 0
    do i = 1, machine%n
      change(i, i) = 1
    end do
    change(at, :) = -row/row(at)
    change(at, at) = 1/row(at)
    machine%mass = matmul(transpose(change), matmul(machine%mass, change))
    machine%damping = matmul(transpose(change), matmul(machine%damping, change))
    machine%stiffness = matmul(transpose(change), matmul(machine%stiffness, change))
    machine%load = matmul(transpose(change), machine%load)
    machine%force = matmul(transpose(change), machine%force)
    machine%start(:, at) = matmul(machine%start, row)
    if (allocated(machine%start_shape)) machine%start_shape(at, :) = matmul(row, machine%start_shape)
    do i = 1, size(rows, 2)
      rows(:, i) = matmul(transpose(change), rows(:, i))
    end do
    ! It is one but for rounding.
    rows(:, k) = 0
    rows(at, k) = 1
  end subroutine make_coordinate

  !> Symmetric to ten digits.
  pure logical function is_symmetric(matrix)
    real(wp), intent(in) :: matrix(:, :)
    is_symmetric = maxval(abs(matrix - transpose(matrix))) <= 1e-10_wp*maxval(abs(matrix))
  end function is_symmetric

  !> The smallest eigenvalue of a symmetric matrix over the largest; what is not above rounding makes it singular.
  pure real(wp) function smallest_share(matrix)
    real(wp), intent(in) :: matrix(:, :)
    real(wp) :: values(size(matrix, 1)), vectors(size(matrix, 1), size(matrix, 1))
    call symmetric_eigen(matrix, values, vectors)
    smallest_share = values(1)/max(maxval(abs(values)), tiny(1.0_wp))
  end function smallest_share

end module structure_block
