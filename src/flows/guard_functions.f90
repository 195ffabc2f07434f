! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The functions of time whose zeros end a flight: sums of powers, exponentials and harmonics, with derivatives and bounds.
module guard_functions
  use eigen, only: modulus
  use elementary, only: exponential, sine_cosine
  use flight_path, only: path_t
  use guards, only: joint_guard_t
  use multibody, only: multibody_t
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  use path_rows, only: force_powers, position_powers
  implicit none
  private

  public :: prepare_search, bases_at, derivatives, bound

  !> All functions of a path that are looked at, as sums: the guards, and after them watched coordinates. Made for every flight,
  !> where it is, of lengths that the flight has.
  type, public :: search_t
    integer :: guards, functions, terms
    complex(wp), pointer, contiguous, dimension(:, :) :: term => null(), turn => null()
    complex(wp), pointer, contiguous :: exponent(:)
    real(wp), pointer, contiguous :: decay(:), size_of_exponent(:), size_of_term(:, :)
    !> Angular frequency of the first harmonic [rad/s].
    real(wp) :: frequency
    real(wp), pointer, contiguous :: power(:, :)
    !> Bounds from the powers and harmonics on derivatives 0 to 6.
    real(wp), pointer, contiguous :: steady(:, :)
    !> Size of the sums that the amplitudes are, as the value and first three derivatives of a guard have it.
    real(wp), pointer, contiguous :: blur(:, :)
    !> By how much guards are raised that are nothing but rounding at the start, 0 for the others.
    real(wp), pointer, contiguous :: lift(:)
  end type search_t

contains

  !> The guards `list` of a path; row `watched` of the coordinates is the last function.
  pure subroutine prepare_search(machine, flow, path, list, count_guards, watched, search)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(joint_guard_t), intent(in) :: list(:)
    integer, intent(in) :: count_guards, watched
    type(search_t), intent(inout) :: search
    real(wp) :: position(0:3), force(0:3), w, largest
    integer :: g, k, m, n, order
    search%guards = count_guards
    search%functions = count_guards + 1
    search%terms = size(flow%exponent)
    n = search%terms
    search%exponent(:n) = flow%exponent
    search%frequency = machine%frequency
    search%decay(:n) = real(flow%exponent)
    search%size_of_exponent(:n) = flow%size_of_exponent
    search%lift = 0
    do g = 1, count_guards
      associate (guard => list(g))
        position = position_powers(machine, path, guard%joint)
        search%power(:, g) = guard%position*position
        search%power(0:2, g) = search%power(0:2, g) + guard%speed*[1, 2, 3]*position(1:3)
        search%power(0, g) = search%power(0, g) + guard%constant
        search%term(:n, g) = (guard%position + guard%speed*flow%exponent)*flow%joint_shape(:, guard%joint)
        do m = 1, size(path%turning)
          w = m*machine%frequency
          search%turn(m, g) = (guard%position + guard%speed*cmplx(0.0_wp, w, wp))*flow%joint_response(m, guard%joint)
        end do
        if (guard%held > 0) then
          force = force_powers(machine, flow, path, guard%held)
          search%power(:, g) = search%power(:, g) + guard%force*force
          search%term(:n, g) = search%term(:n, g) + guard%force*flow%force_shape(:, guard%held)
          search%turn(:, g) = search%turn(:, g) + guard%force*flow%force_response(:, guard%held)
        end if
        search%blur(:, g) = guard%blur
        do k = 1, n
          largest = (abs(guard%position) + abs(guard%speed)*flow%size_of_exponent(k))*flow%size_of_joint(k, guard%joint)
          if (guard%held > 0) largest = largest + abs(guard%force)*flow%size_of_force(k, guard%held)
          search%blur(:, g) = search%blur(:, g) &
                              + largest*path%size_of_amplitude(k)*flow%size_of_exponent(k)**[(order, order=0, 3)]
        end do
        if (guard%held > 0) search%blur(:, g) = search%blur(:, g) + blur_of_drive(machine, flow, path, guard)
      end associate
    end do
    g = search%functions
    search%power(:, g) = path%powers(watched, :)
    search%term(:n, g) = flow%shape(watched, :)
    search%turn(:, g) = flow%response(watched, :)
    do g = 1, search%functions
      search%term(:n, g) = search%term(:n, g)*path%amplitude(:n)
      search%size_of_term(:n, g) = modulus(search%term(:n, g))
      search%turn(:, g) = search%turn(:, g)*path%turning
      search%steady(:, g) = 0
      do k = 1, size(path%turning)
        largest = modulus(search%turn(k, g))
        do order = 0, 6
          search%steady(order, g) = search%steady(order, g) + largest*(k*machine%frequency)**order
        end do
      end do
    end do
  end subroutine prepare_search

  !> What a force of a constraint, as the value and first three derivatives of a guard have it, is a sum of beside the exponentials.
  pure function blur_of_drive(machine, flow, path, guard) result(blur)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(joint_guard_t), intent(in) :: guard
    real(wp) :: blur(0:3)
    integer :: m, order
    blur = 0
    blur(0) = sum(abs(flow%reaction(guard%held, :))*abs(path%force(:machine%n)))
    blur(1) = sum(abs(flow%reaction(guard%held, :))*abs(path%force_rate(:machine%n)))
    do m = 1, size(path%turning)
      blur = blur + flow%size_of_force_response(m, guard%held)*modulus(path%turning(m)) &
             *(m*machine%frequency)**[(order, order=0, 3)]
    end do
    blur = abs(guard%force)*blur
  end function blur_of_drive

  !> Exponentials and harmonics at `t` [s] after the start.
  pure subroutine bases_at(search, t, growth, turning)
    type(search_t), intent(in) :: search
    real(wp), intent(in) :: t
    complex(wp), intent(out) :: growth(:), turning(:)
    real(wp) :: sine, cosine
    integer :: k
    do k = 1, size(growth)
      call sine_cosine(aimag(search%exponent(k))*t, sine, cosine)
      growth(k) = exponential(search%decay(k)*t)*cmplx(cosine, sine, wp)
    end do
    do k = 1, size(turning)
      call sine_cosine(k*search%frequency*t, sine, cosine)
      turning(k) = cmplx(cosine, sine, wp)
    end do
  end subroutine bases_at

  !> Value and first three derivatives of a function.
  pure function derivatives(search, g, t, growth, turning) result(d)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g
    real(wp), intent(in) :: t
    complex(wp), intent(in) :: growth(:), turning(:)
    real(wp) :: d(0:3), w, p(0:3)
    complex(wp) :: now
    integer :: k
    p = search%power(:, g)
    d = [p(0) + t*(p(1) + t*(p(2) + t*p(3))), p(1) + t*(2*p(2) + 3*t*p(3)), 2*p(2) + 6*t*p(3), 6*p(3)]
    do k = 1, size(growth)
      associate (lambda => search%exponent(k))
        now = search%term(k, g)*growth(k)
        d(0) = d(0) + real(now)
        now = now*lambda
        d(1) = d(1) + real(now)
        now = now*lambda
        d(2) = d(2) + real(now)
        now = now*lambda
        d(3) = d(3) + real(now)
      end associate
    end do
    do k = 1, size(turning)
      w = k*search%frequency
      now = search%turn(k, g)*turning(k)
      d(0) = d(0) + real(now)
      d(1) = d(1) - w*aimag(now)
      d(2) = d(2) - w**2*real(now)
      d(3) = d(3) + w**3*aimag(now)
    end do
  end function derivatives

  !> Bound on derivative number `order` from `t` to `t` + `length`.
  pure real(wp) function bound(search, g, order, t, length)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g, order
    real(wp), intent(in) :: t, length
    real(wp) :: p(0:3), last
    integer :: k
    bound = search%steady(order, g)
    if (t > 0 .or. length > 0) then
      do k = 1, search%terms
        bound = bound + search%size_of_term(k, g)*search%size_of_exponent(k)**order &
                *exponential(search%decay(k)*t + max(search%decay(k), 0.0_wp)*length)
      end do
    else
      do k = 1, search%terms
        bound = bound + search%size_of_term(k, g)*search%size_of_exponent(k)**order
      end do
    end if
    p = abs(search%power(:, g))
    last = t + length
    select case (order)
    case (0)
      bound = bound + p(0) + last*(p(1) + last*(p(2) + last*p(3)))
    case (1)
      bound = bound + p(1) + last*(2*p(2) + 3*last*p(3))
    case (2)
      bound = bound + 2*p(2) + 6*last*p(3)
    case (3)
      bound = bound + 6*p(3)
    end select
  end function bound

end module guard_functions
