! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Positions and velocities on which the motion of a multibody structure depends: a structure that nothing ties to the ground may be
!> anywhere, and looks the same from a frame that moves along.
module section_directions
  use eigen, only: symmetric_eigen
  use multibody, only: integral_of, is_stop, joint_bristle, joint_friction, joint_section, joint_spring, multibody_t, &
    most_degrees
  use kinds, only: wp
  implicit none
  private

  public :: directions_of, speeds_of

  !> Much, as a share of the most; no ratio of small integers, so that rounding does not decide.
  real(wp), parameter :: much = 0.3_wp

contains

  !> Directions of the positions on which forces and stops depend, orthonormal columns: the bodies themselves if all count. Where
  !> fewer count between the stops, those that count only for the stops come first. They follow from what is tied to what, not how
  !> strongly: machines of one build have the same.
  pure subroutine directions_of(machine, directions, count_directions)
    type(multibody_t), intent(in) :: machine
    real(wp), intent(out) :: directions(most_degrees, most_degrees)
    integer, intent(out) :: count_directions
    real(wp) :: between(most_degrees, most_degrees)
    integer :: count_between
    call directions_with(machine, .true., directions, count_directions)
    call directions_with(machine, .false., between, count_between)
    if (count_between == count_directions .or. count_between == 0) return
    call distinguish(directions(:machine%n, :count_directions), between(:machine%n, :count_between))
  end subroutine directions_of

  !> Turns orthonormal directions so that the last ones are `last`, which lie among them.
  pure subroutine distinguish(directions, last)
    real(wp), intent(inout) :: directions(:, :)
    real(wp), intent(in) :: last(:, :)
    real(wp) :: rest(size(directions, 1), size(directions, 2))
    integer :: i, k, first
    first = size(directions, 2) - size(last, 2)
    rest = directions
    do k = 1, size(last, 2)
      call take_out(last(:, k), rest)
    end do
    do k = 1, first
      associate (left => norm2(rest, 1))
        i = findloc(left > much*maxval(left), .true., 1)
      end associate
      directions(:, k) = rest(:, i)/norm2(rest(:, i))
      call take_out(directions(:, k), rest)
    end do
    directions(:, first + 1:) = last
  end subroutine distinguish

  !> The same, with the stops or without.
  pure subroutine directions_with(machine, stops, directions, count_directions)
    type(multibody_t), intent(in) :: machine
    logical, intent(in) :: stops
    real(wp), intent(out) :: directions(most_degrees, most_degrees)
    integer, intent(out) :: count_directions
    real(wp) :: depends(machine%n, machine%n)
    integer :: i, j, n
    n = machine%n
    depends = without_signs(machine%stiffness)
    do j = 1, size(machine%joints)
      if (allocated(machine%joints(j)%load)) then
        do i = 1, size(machine%joints(j)%load%sources)
          call add_row(machine%joints(j)%load%sources(i)%row, depends)
        end do
      end if
      if (any(machine%joints(j)%kind == [joint_friction, joint_section, joint_bristle])) cycle
      if (machine%joints(j)%kind == joint_spring .and. allocated(machine%joints(j)%load)) cycle
      if (.not. stops .and. is_stop(machine%joints(j)%kind)) cycle
      call add_row(machine%joints(j)%row, depends)
    end do
    call span_of(depends, directions, count_directions)
  end subroutine directions_with

  !> Adds the square of a row, on which something depends.
  pure subroutine add_row(row, depends)
    real(wp), intent(in) :: row(:)
    real(wp), intent(inout) :: depends(:, :)
    integer :: i
    do i = 1, size(row)
      depends(:, i) = depends(:, i) + row*row(i)
    end do
  end subroutine add_row

  !> Directions of the velocities on which anything depends, likewise: all of them, unless the whole may move along at any speed. A
  !> motion without a clock is looked at where a body turns: there its own velocity counts.
  pure subroutine speeds_of(machine, directions, count_directions)
    type(multibody_t), intent(in) :: machine
    real(wp), intent(out) :: directions(most_degrees, most_degrees)
    integer, intent(out) :: count_directions
    real(wp) :: depends(machine%n, machine%n)
    integer :: i, j
    depends = without_signs(machine%stiffness) + without_signs(machine%damping)
    do j = 1, size(machine%joints)
      if (machine%joints(j)%kind == joint_section) cycle
      call add_row(machine%joints(j)%row, depends)
      if (.not. allocated(machine%joints(j)%load)) cycle
      do i = 1, size(machine%joints(j)%load%sources)
        call add_row(machine%joints(j)%load%sources(i)%row, depends)
      end do
    end do
    if (.not. (machine%driven .or. machine%section_time > 0) .or. .not. any(abs(depends) > 0)) depends = unit(machine%n)
    if (integral_of(machine) > 0) then
      ! What a controller sees determines how its integral grows.
      depends(:, integral_of(machine)) = 0
      depends(integral_of(machine), :) = 0
    end if
    call span_of(depends, directions, count_directions)
  end subroutine speeds_of

  pure function unit(n)
    integer, intent(in) :: n
    real(wp) :: unit(n, n)
    integer :: i
    unit = 0
    do i = 1, n
      unit(i, i) = 1
    end do
  end function unit

  !> A symmetric matrix by the size of its largest element, its eigenvalues without their signs: a negative stiffness would cancel
  !> what a joint adds.
  pure function without_signs(matrix) result(depends)
    real(wp), intent(in) :: matrix(:, :)
    real(wp), dimension(size(matrix, 1), size(matrix, 1)) :: depends, vectors
    real(wp) :: values(size(matrix, 1))
    integer :: i
    depends = matrix/max(maxval(abs(matrix)), tiny(1.0_wp))
    ! The integral of a controller is not asked for by what it adds up.
    if (maxval(abs(depends - transpose(depends))) > 1e-12_wp) depends = (depends + transpose(depends))/2
    call symmetric_eigen(depends, values, vectors)
    do i = 1, size(matrix, 1)
      depends(:, i) = matmul(vectors, abs(values)*vectors(i, :))
    end do
  end function without_signs

  !> Orthonormal directions (columns) that a matrix does not take to zero: the coordinates themselves if there are no others.
  pure subroutine span_of(depends, directions, count_directions)
    real(wp), intent(in) :: depends(:, :)
    real(wp), intent(out) :: directions(most_degrees, most_degrees)
    integer, intent(out) :: count_directions
    real(wp) :: values(size(depends, 1)), vectors(size(depends, 1), size(depends, 1))
    integer :: i, n
    n = size(depends, 1)
    call symmetric_eigen(depends, values, vectors)
    count_directions = count(abs(values) > 1e-12_wp*maxval(abs(values)))
    directions = 0
    if (count_directions == n) then
      directions(:n, :n) = unit(n)
    else
      vectors(:, :n - count_directions) = vectors(:, pack([(i, i=1, n)], .not. abs(values) > 1e-12_wp*maxval(abs(values))))
      call complement_of(vectors(:, :n - count_directions), directions(:n, :count_directions))
    end if
  end subroutine span_of

  !> An orthonormal basis of what is across some orthonormal columns: unit vectors less those and one another, at each step the
  !> first of which much is left.
  pure subroutine complement_of(free, basis)
    real(wp), intent(in) :: free(:, :)
    real(wp), intent(out) :: basis(:, :)
    real(wp) :: rest(size(free, 1), size(free, 1))
    integer :: i, k
    rest = 0
    do i = 1, size(rest, 1)
      rest(i, i) = 1
    end do
    do k = 1, size(free, 2)
      call take_out(free(:, k), rest)
    end do
    do k = 1, size(basis, 2)
      associate (left => norm2(rest, 1))
        i = findloc(left > much*maxval(left), .true., 1)
      end associate
      basis(:, k) = rest(:, i)/norm2(rest(:, i))
      call take_out(basis(:, k), rest)
    end do
  end subroutine complement_of

  !> Takes a direction out of vectors (columns), twice because of rounding.
  pure subroutine take_out(direction, vectors)
    real(wp), intent(in) :: direction(:)
    real(wp), intent(inout) :: vectors(:, :)
    integer :: i, pass
    do pass = 1, 2
      do i = 1, size(vectors, 2)
        vectors(:, i) = vectors(:, i) - direction*sum(direction*vectors(:, i))
      end do
    end do
  end subroutine take_out

end module section_directions
