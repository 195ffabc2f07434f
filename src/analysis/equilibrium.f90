! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Equilibria of a machine without a clock in a given mode: Newton's method on the rates and on what the mode
!> holds, and the eigenvalues of the motion beside them that stays in the mode.
module equilibrium
  use body_family, only: family_t
  use branch_point, only: no_label
  use eigen, only: general_eigen
  use errors, only: error_t
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use matrices, only: solve
  use rest_modes, only: margins_of_rest, misses_of_rest, rates_of_rest
  use variations, only: by_difference, neighbourhood_t
  implicit none
  private

  public :: correct_equilibrium, tangent_of_equilibrium, eigen_of, is_isolated, count_unstable, lasts

  integer, parameter :: most_newton = 30
  !> Newton's method has converged when a step, in natural sizes, is below this.
  real(wp), parameter :: converged_step = 1e-12_wp
  !> A change that a mode lets be less than this share of is held.
  real(wp), parameter :: held_below = 1e-8_wp
  !> An eigenvalue below this, times the size of times, is none: the equilibrium is one of a continuum.
  real(wp), parameter :: neutral = 1e-9_wp

  !> An equilibrium at the value `parameter`, in a mode. `tangent`: the direction in which it goes on, over coordinates and
  !> parameter in natural sizes.
  type, public :: equilibrium_t
    integer :: mode = 0, label = no_label
    real(wp) :: parameter = 0
    real(wp), allocatable :: y(:), tangent(:)
    !> Of the motion in the mode [1/s], largest real part first.
    complex(wp), allocatable :: values(:)
    !> What keeps it in its mode, positive where it does.
    real(wp), allocatable :: margins(:)
  end type equilibrium_t

contains

  !> The equations and their derivatives by coordinates and parameter, in natural sizes.
  pure subroutine equations(machines, machine, point, parameter_size, miss, slopes)
    type(neighbourhood_t), intent(in) :: machines
    class(hybrid_t), intent(in) :: machine
    type(equilibrium_t), intent(in) :: point
    real(wp), intent(in) :: parameter_size
    real(wp), intent(out) :: miss(:), slopes(:, :)
    real(wp) :: near(size(miss), 4), rate(size(point%y)), held(size(point%y)), time
    real(wp), dimension(size(point%y), size(point%y)) :: by_state, kept
    integer :: i, n
    n = size(point%y)
    time = machine%size_of_time()
    miss = misses_of_rest(machine, point%mode, point%y)
    near = 0
    do i = 1, 4
      near(:, i) = misses_of_rest(machines%near(i)%machine, point%mode, point%y)
    end do
    slopes(:, n + 1) = by_difference(machines, miss, near)*parameter_size
    call rates_of_rest(machine, point%mode, point%y, rate, by_state)
    call machine%fly(point%mode, 0.0_wp, point%y, 0.0_wp, held, kept)
    slopes(:n, :n) = by_state
    slopes(n + 1:, :n) = -kept
    do i = 1, n
      slopes(n + i, i) = slopes(n + i, i) + 1
    end do
    do i = 1, n
      slopes(:, i) = slopes(:, i)*machine%size_of(i)
    end do
    do i = 1, n
      miss(i) = miss(i)*time/machine%size_of(i)
      slopes(i, :) = slopes(i, :)*time/machine%size_of(i)
      miss(n + i) = miss(n + i)/machine%size_of(i)
      slopes(n + i, :) = slopes(n + i, :)/machine%size_of(i)
    end do
  end subroutine equations

  !> Newton's method across `direction`, a row over coordinates and parameter: one along the parameter keeps that fixed. `machines`
  !> in the end are those of the point found. There are more equations than unknowns, which do not contradict each other.
  subroutine correct_equilibrium(family, machines, point, direction, ok)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(inout) :: machines
    type(equilibrium_t), intent(inout) :: point
    real(wp), intent(in) :: direction(:)
    logical, intent(out) :: ok
    real(wp) :: miss(2*size(point%y) + 1), slopes(2*size(point%y) + 1, size(point%y) + 1), step(size(point%y) + 1)
    real(wp) :: before, length
    type(error_t), allocatable :: error
    integer :: i, n
    n = size(point%y)
    length = huge(length)
    do i = 1, most_newton
      call equations(machines, machines%centre, point, family%parameter_size, miss(:2*n), slopes(:2*n, :))
      slopes(2*n + 1, :) = direction
      miss(2*n + 1) = 0
      call solve(matmul(transpose(slopes), slopes), -matmul(transpose(slopes), miss), step, ok)
      if (ok) ok = all(abs(step) <= 1e3_wp)
      if (.not. ok) return
      ! Least squares leave a fixed parameter fixed but for rounding.
      if (.not. any(abs(direction(:n)) > 0)) step(n + 1) = 0
      before = length
      length = norm2(step)
      point%y = point%y + step(:n)*machines%centre%size_of
      if (abs(step(n + 1)) > 0) then
        point%parameter = point%parameter + step(n + 1)*family%parameter_size
        call machine_neighbourhood(family, point%parameter, machines, error)
        ok = .not. allocated(error)
        if (.not. ok) return
      end if
      if (length < 1e-15_wp .or. (length < converged_step .and. length >= 0.1_wp*before)) exit
    end do
    ok = length < converged_step .and. maxval(abs(miss)) < 1e3_wp*converged_step
    if (.not. ok) return
    point%margins = margins_of_rest(machines%centre, point%mode, point%y)
    call set_eigenvalues(machines%centre, point)
  end subroutine correct_equilibrium

  !> Direction in which the equilibria go on, a unit vector in natural sizes on the side of `along`.
  pure subroutine tangent_of_equilibrium(machines, point, parameter_size, along, ok)
    type(neighbourhood_t), intent(in) :: machines
    type(equilibrium_t), intent(inout) :: point
    real(wp), intent(in) :: parameter_size, along(:)
    logical, intent(out) :: ok
    real(wp) :: miss(2*size(point%y) + 1), slopes(2*size(point%y) + 1, size(point%y) + 1), tangent(size(point%y) + 1)
    integer :: n
    n = size(point%y)
    call equations(machines, machines%centre, point, parameter_size, miss(:2*n), slopes(:2*n, :))
    slopes(2*n + 1, :) = along
    call solve(matmul(transpose(slopes), slopes), along, tangent, ok)
    if (ok) point%tangent = tangent/norm2(tangent)
  end subroutine tangent_of_equilibrium

  !> Orthonormal directions (columns, in natural sizes) in which the mode lets the coordinates change.
  pure function free_directions(machine, mode, y) result(directions)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp), allocatable :: directions(:, :)
    real(wp) :: kept(size(y), size(y)), held(size(y)), column(size(y)), basis(size(y), size(y))
    integer :: i, k, pass, found
    call machine%fly(mode, 0.0_wp, y, 0.0_wp, held, kept)
    found = 0
    do k = 1, size(y)
      column = kept(:, k)*machine%size_of(k)/machine%size_of
      do pass = 1, 2
        do i = 1, found
          column = column - basis(:, i)*sum(basis(:, i)*column)
        end do
      end do
      if (norm2(column) < held_below) cycle
      found = found + 1
      basis(:, found) = column/norm2(column)
    end do
    directions = basis(:, :found)
  end function free_directions

  !> Eigenvalues of the motion that stays in the mode [1/s], and their eigenvectors (columns, in natural sizes).
  pure subroutine eigen_of(machine, point, values, vectors)
    class(hybrid_t), intent(in) :: machine
    type(equilibrium_t), intent(in) :: point
    complex(wp), allocatable, intent(out) :: values(:), vectors(:, :)
    real(wp) :: rate(size(point%y)), by_state(size(point%y), size(point%y))
    real(wp), allocatable :: directions(:, :), reduced(:, :)
    integer :: i, n
    logical :: ok
    call rates_of_rest(machine, point%mode, point%y, rate, by_state)
    do i = 1, size(point%y)
      by_state(:, i) = by_state(:, i)*machine%size_of(i)/machine%size_of
    end do
    directions = free_directions(machine, point%mode, point%y)
    reduced = matmul(transpose(directions), matmul(by_state, directions))
    n = size(reduced, 1)
    allocate (values(n), vectors(n, n))
    ok = n > 0
    if (ok) call general_eigen(reduced, values, vectors, ok)
    if (.not. ok) values = huge(1.0_wp)
    vectors = matmul(directions, vectors)
  end subroutine eigen_of

  !> Eigenvalues of an equilibrium, in order.
  pure subroutine set_eigenvalues(machine, point)
    class(hybrid_t), intent(in) :: machine
    type(equilibrium_t), intent(inout) :: point
    complex(wp), allocatable :: values(:), vectors(:, :)
    complex(wp) :: moved
    real(wp) :: change
    integer :: i, k
    call eigen_of(machine, point, values, vectors)
    point%values = values
    where (abs(aimag(point%values)) <= 1e-12_wp*maxval(abs(point%values))) &
      point%values = cmplx(real(point%values), 0.0_wp, wp)
    do i = 2, size(point%values)
      moved = point%values(i)
      do k = i - 1, 1, -1
        change = real(moved - point%values(k))
        ! The real parts of a pair differ by rounding.
        if (abs(change) <= 1e-12_wp*maxval(abs(values))) change = aimag(moved - point%values(k))
        if (change <= 0) exit
        point%values(k + 1) = point%values(k)
      end do
      point%values(k + 1) = moved
    end do
  end subroutine set_eigenvalues

  !> Whether no equilibria are next to this one at the same value.
  pure logical function is_isolated(machine, point)
    class(hybrid_t), intent(in) :: machine
    type(equilibrium_t), intent(in) :: point
    is_isolated = all(abs(point%values)*machine%size_of_time() > neutral)
  end function is_isolated

  !> Eigenvalues with a positive real part.
  pure integer function count_unstable(point)
    type(equilibrium_t), intent(in) :: point
    count_unstable = count(real(point%values) > 0)
  end function count_unstable

  !> Whether the equilibrium is one of its mode, not beyond its ends.
  pure logical function lasts(point)
    type(equilibrium_t), intent(in) :: point
    lasts = all(point%margins > 0)
  end function lasts

end module equilibrium
