! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Orbits and points of branches as a list of numbers and back, to the bit: so they go from one process to another.
module orbit_numbers
  use branch_point, only: point_t
  use hybrid_machine, only: event_t, most_states
  use kinds, only: wp
  use orbit_search, only: found_t
  use periodic_orbit, only: orbit_t
  implicit none
  private

  !> Numbers of an event: six integers, the time, and the states before and after.
  integer, parameter :: event_numbers = 7 + 2*most_states

  !> A list that is written, then read, from the front.
  type, public :: numbers_t
    real(wp), allocatable :: values(:)
    integer :: written = 0, taken = 0
  contains
    procedure :: put
    procedure :: put_integer
    procedure :: put_orbit
    procedure :: put_points
    procedure :: put_found
    procedure :: take
    procedure :: take_integer
    procedure :: take_orbit
    procedure :: take_points
    procedure :: take_found
  end type numbers_t

contains

  pure subroutine put(self, values)
    class(numbers_t), intent(inout) :: self
    real(wp), intent(in) :: values(:)
    real(wp), allocatable :: longer(:)
    integer :: needed
    if (.not. allocated(self%values)) allocate (self%values(64))
    needed = self%written + size(values)
    if (needed > size(self%values)) then
      allocate (longer(2*needed))
      longer(:self%written) = self%values(:self%written)
      call move_alloc(longer, self%values)
    end if
    self%values(self%written + 1:needed) = values
    self%written = needed
  end subroutine put

  pure subroutine put_integer(self, value)
    class(numbers_t), intent(inout) :: self
    integer, intent(in) :: value
    call self%put([real(value, wp)])
  end subroutine put_integer

  !> The next numbers, as many as `values` has.
  pure subroutine take(self, values)
    class(numbers_t), intent(inout) :: self
    real(wp), intent(out) :: values(:)
    values = self%values(self%taken + 1:self%taken + size(values))
    self%taken = self%taken + size(values)
  end subroutine take

  pure subroutine take_integer(self, value)
    class(numbers_t), intent(inout) :: self
    integer, intent(out) :: value
    real(wp) :: one(1)
    call self%take(one)
    value = nint(one(1))
  end subroutine take_integer

  pure subroutine put_orbit(self, orbit)
    class(numbers_t), intent(inout) :: self
    type(orbit_t), intent(in) :: orbit
    integer :: i
    call self%put_integer(orbit%periods)
    call self%put_integer(orbit%mode)
    call self%put([orbit%parameter])
    call put_list(self, orbit%y)
    call self%put_integer(length_of(allocated(orbit%events)))
    if (allocated(orbit%events)) then
      call self%put_integer(size(orbit%events))
      do i = 1, size(orbit%events)
        associate (event => orbit%events(i))
          call self%put([real([event%kind, event%side, event%joint, event%guard, event%before, event%after], wp), event%time, &
                         event%arrival, event%departure])
        end associate
      end do
    end if
    call self%put_integer(length_of(allocated(orbit%multipliers)))
    if (allocated(orbit%multipliers)) then
      call put_list(self, real(orbit%multipliers, wp))
      call put_list(self, aimag(orbit%multipliers))
    end if
    call self%put_integer(length_of(allocated(orbit%matrix)))
    if (allocated(orbit%matrix)) call self%put(reshape(orbit%matrix, [size(orbit%matrix)]))
  end subroutine put_orbit

  pure subroutine take_orbit(self, orbit)
    class(numbers_t), intent(inout) :: self
    type(orbit_t), intent(out) :: orbit
    real(wp) :: one(1), numbers(event_numbers)
    real(wp), allocatable :: re(:), im(:), matrix(:)
    integer :: i, given, count
    call self%take_integer(orbit%periods)
    call self%take_integer(orbit%mode)
    call self%take(one)
    orbit%parameter = one(1)
    call take_list(self, orbit%y)
    call self%take_integer(given)
    if (given > 0) then
      call self%take_integer(count)
      allocate (orbit%events(count))
      do i = 1, count
        call self%take(numbers)
        orbit%events(i) = event_t(nint(numbers(1)), nint(numbers(2)), nint(numbers(3)), nint(numbers(4)), nint(numbers(5)), &
                                  nint(numbers(6)), numbers(7), numbers(8:7 + most_states), numbers(8 + most_states:))
      end do
    end if
    call self%take_integer(given)
    if (given > 0) then
      call take_list(self, re)
      call take_list(self, im)
      orbit%multipliers = cmplx(re, im, wp)
    end if
    call self%take_integer(given)
    if (given == 0) return
    allocate (matrix(size(orbit%y)**2))
    call self%take(matrix)
    orbit%matrix = reshape(matrix, [size(orbit%y), size(orbit%y)])
  end subroutine take_orbit

  pure subroutine put_points(self, points)
    class(numbers_t), intent(inout) :: self
    type(point_t), intent(in) :: points(:)
    integer :: i
    call self%put_integer(size(points))
    do i = 1, size(points)
      associate (point => points(i))
        call self%put_orbit(point%orbit)
        call self%put([real(point%label, wp), point%x_max, point%x_min, merge(1.0_wp, 0.0_wp, point%symmetric)])
        call self%put_integer(length_of(allocated(point%tangent)))
        if (allocated(point%tangent)) call put_list(self, point%tangent)
      end associate
    end do
  end subroutine put_points

  pure subroutine take_points(self, points)
    class(numbers_t), intent(inout) :: self
    type(point_t), allocatable, intent(out) :: points(:)
    real(wp) :: numbers(4)
    integer :: i, count, given
    call self%take_integer(count)
    allocate (points(count))
    do i = 1, count
      call self%take_orbit(points(i)%orbit)
      call self%take(numbers)
      points(i)%label = nint(numbers(1))
      points(i)%x_max = numbers(2)
      points(i)%x_min = numbers(3)
      points(i)%symmetric = numbers(4) > 0
      call self%take_integer(given)
      if (given > 0) call take_list(self, points(i)%tangent)
    end do
  end subroutine take_points

  pure subroutine put_found(self, found)
    class(numbers_t), intent(inout) :: self
    type(found_t), intent(in) :: found
    integer :: i
    call self%put(real([found%families, found%equilibria, found%starts, found%lost, size(found%orbits)], wp))
    do i = 1, size(found%orbits)
      call self%put_orbit(found%orbits(i))
    end do
  end subroutine put_found

  pure subroutine take_found(self, found)
    class(numbers_t), intent(inout) :: self
    type(found_t), intent(out) :: found
    real(wp) :: numbers(5)
    integer :: i
    call self%take(numbers)
    found%families = nint(numbers(1))
    found%equilibria = nint(numbers(2))
    found%starts = nint(numbers(3))
    found%lost = nint(numbers(4))
    allocate (found%orbits(nint(numbers(5))))
    do i = 1, size(found%orbits)
      call self%take_orbit(found%orbits(i))
    end do
  end subroutine take_found

  pure subroutine put_list(self, values)
    class(numbers_t), intent(inout) :: self
    real(wp), intent(in) :: values(:)
    call self%put_integer(size(values))
    call self%put(values)
  end subroutine put_list

  pure subroutine take_list(self, values)
    class(numbers_t), intent(inout) :: self
    real(wp), allocatable, intent(out) :: values(:)
    integer :: count
    call self%take_integer(count)
    allocate (values(count))
    call self%take(values)
  end subroutine take_list

  !> 1 where something is given, else 0.
  pure integer function length_of(given)
    logical, intent(in) :: given
    length_of = merge(1, 0, given)
  end function length_of

end module orbit_numbers
