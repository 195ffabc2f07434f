! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The motion of a linear mode from a state on: exponentials, powers of time up to the third, and harmonics, or the
!> exponential series.
module flight_path
  use elementary, only: exponential, sine_cosine
  use multibody, only: joint_elastic, joint_friction, joint_soft, multibody_t, most_degrees
  use multibody_state, only: acts_as_spring, is_curved, is_held, joint_force, multibody_state_t, running_control, turning_at
  use kinds, only: wp
  use mode_flow, only: harmonics_of, mode_flow_t
  use polynomial, only: value_at
  implicit none
  private

  public :: begin_path, begin_change, begin_series, path_at, series_step, constant_forces

  !> Terms of the exponential series over an interval no longer than 1/rate.
  integer, parameter, public :: terms = merge(20, 30, epsilon(1.0_wp) > 1e-20_wp)

  type, public :: path_t
    !> Time of the start since the section [s].
    real(wp) :: start = 0
    !> Amplitudes of the exponentials, harmonics at the start, powers of the time since then.
    complex(wp) :: amplitude(2*most_degrees)
    !> Sizes of the sums that the amplitudes are, for their rounding.
    real(wp) :: size_of_amplitude(2*most_degrees)
    complex(wp), allocatable :: turning(:)
    real(wp) :: powers(most_degrees, 0:3)
    !> Constant forces on the coordinates and their rates [N, N/s].
    real(wp) :: force(most_degrees), force_rate(most_degrees)
    !> Unknowns of the series at the start, and the matrix with its constant columns.
    real(wp), allocatable :: unknowns(:), matrix(:, :)
    !> Of a step of a marched flight: its length [s], and the coordinates and speeds by rising powers of its fraction; 0 of
    !> other flights.
    real(wp) :: length = 0
    real(wp), allocatable :: step(:, :)
  end type path_t

contains

  !> The motion from `state` on.
  pure subroutine begin_path(machine, flow, state, path)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    type(path_t), intent(out) :: path
    integer :: n
    n = machine%n
    path%start = state%time
    path%turning = turning_at(machine%frequency, state%time, harmonics_of(machine))
    call constant_forces(machine, state, path%force(:n), path%force_rate(:n))
    if (flow%modal) then
      call begin_modal(machine, flow, state, -machine%joints%offset%rate, path)
    else
      call begin_series(machine, flow, state, path)
    end if
  end subroutine begin_path

  !> How far apart two motions of one mode are: nothing drives their difference, which starts as `q`, `v`, under the constant
  !> `force` on the coordinates; in modes with a closed form the `surface`s of constraints may run at constant speeds [m/s].
  pure subroutine begin_change(machine, flow, q, v, force, path, surface)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    real(wp), intent(in) :: q(:), v(:), force(:)
    type(path_t), intent(out) :: path
    real(wp), intent(in), optional :: surface(:)
    type(multibody_state_t) :: change
    real(wp) :: still(size(machine%joints))
    change%q(:machine%n) = q
    change%v(:machine%n) = v
    allocate (path%turning(harmonics_of(machine)), source=(0.0_wp, 0.0_wp))
    path%force(:machine%n) = force
    path%force_rate(:machine%n) = 0
    still = 0
    if (present(surface)) still = surface
    if (flow%modal) then
      call begin_modal(machine, flow, change, still, path)
    else
      call begin_series(machine, flow, change, path)
    end if
  end subroutine begin_change

  !> Forces of the joints that do not depend on the state within the mode, and the load.
  pure subroutine constant_forces(machine, state, force, rate)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(out) :: force(:), rate(:)
    real(wp) :: r, now, zero, k, c
    integer :: j
    force = machine%load
    rate = 0
    if (allocated(machine%controller)) then
      call running_control(machine%controller, state, now, r)
      force = force + now*machine%controller%row
      rate = rate + r*machine%controller%row
    end if
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (is_held(joint, state%phase(j)) .or. is_curved(joint, state%phase(j))) cycle
        if (acts_as_spring(joint, state%phase(j))) then
          now = joint%offset%mean + joint%offset%rate*state%time
          if (joint%kind == joint_soft) then
            zero = merge(joint%upper, joint%lower, state%phase(j) > 0)
            k = joint%contact%stiffness
            c = joint%contact%damping
          else
            zero = state%slider(j)
            k = joint%stiffness
            c = 0
          end if
          force = force - (k*(now - zero) + c*joint%offset%rate)*joint%row
          rate = rate - k*joint%offset%rate*joint%row
        else if (joint%kind == joint_friction .or. joint%kind == joint_elastic) then
          call joint_force(joint, state%phase(j), 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, r)
          force = force + r*joint%row
        end if
      end associate
    end do
  end subroutine constant_forces

  !> `surface` are the speeds at which constraints hold [m/s].
  pure subroutine begin_modal(machine, flow, state, surface, path)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(in) :: surface(:)
    type(path_t), intent(inout) :: path
    real(wp), dimension(most_degrees) :: q, v, position, speed, push, push_rate
    real(wp) :: w
    integer :: n, m, free
    n = machine%n
    free = size(flow%basis, 2)
    ! What is left of the state without the periodic response.
    q(:n) = state%q(:n)
    v(:n) = state%v(:n)
    do m = 1, size(path%turning)
      w = m*machine%frequency
      q(:n) = q(:n) - real(flow%response(:, m)*path%turning(m))
      v(:n) = v(:n) + w*aimag(flow%response(:, m)*path%turning(m))
    end do
    path%powers(:n, :) = 0
    call carry_along(machine, flow, q, surface, path)
    push(:n) = path%force(:n)
    push_rate(:n) = path%force_rate(:n)
    push(:n) = push(:n) - matmul(flow%stiffness, path%powers(:n, 0)) - matmul(flow%damping, path%powers(:n, 1))
    push_rate(:n) = push_rate(:n) - matmul(flow%stiffness, path%powers(:n, 1))
    ! In basis coordinates.
    position(:n) = matmul(machine%mass, q(:n))
    speed(:n) = matmul(machine%mass, v(:n))
    position(:free) = matmul(transpose(flow%basis), position(:n))
    speed(:free) = matmul(transpose(flow%basis), speed(:n))
    push(:free) = matmul(transpose(flow%basis), push(:n))
    push_rate(:free) = matmul(transpose(flow%basis), push_rate(:n))
    call begin_exponentials(flow, n, speed, push, push_rate, position, path)
    call begin_rigid(flow, n, position, speed, push, push_rate, path)
  end subroutine begin_modal

  !> What constraints do to all coordinates, `q` [m] being the start.
  pure subroutine carry_along(machine, flow, q, surface, path)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    real(wp), intent(in) :: q(:), surface(:)
    type(path_t), intent(inout) :: path
    real(wp) :: held_at, held_rate
    integer :: n, i, j
    n = machine%n
    do i = 1, size(flow%independent)
      j = flow%held(flow%independent(i))
      held_at = sum(machine%joints(j)%row*q(:n))
      held_rate = surface(j)
      path%powers(:n, 0) = path%powers(:n, 0) + flow%carried(:, i)*held_at
      path%powers(:n, 1) = path%powers(:n, 1) + flow%carried(:, i)*held_rate
    end do
  end subroutine carry_along

  !> Amplitudes of the exponentials, and the steady part of their response to a push that grows steadily; `position` is less what
  !> they carry of the damped rigid coordinates. All in basis coordinates.
  pure subroutine begin_exponentials(flow, n, speed, push, push_rate, position, path)
    type(mode_flow_t), intent(in) :: flow
    integer, intent(in) :: n
    real(wp), intent(in) :: speed(:), push(:), push_rate(:)
    real(wp), intent(inout) :: position(:)
    type(path_t), intent(inout) :: path
    complex(wp) :: forced, forced_rate, lambda
    integer :: i, k, f, d
    f = flow%flexible
    d = flow%damped
    do k = 1, size(flow%exponent)
      lambda = flow%exponent(k)
      path%amplitude(k) = sum(flow%left(k, :f)*flow%frequency*position(:f)) + sum(flow%left(k, f + 1:)*speed(:f + d))
      forced = -sum(flow%left(k, f + 1:)*push(:f + d))/lambda
      forced_rate = -sum(flow%left(k, f + 1:)*push_rate(:f + d))/lambda
      forced = forced + forced_rate/lambda
      path%size_of_amplitude(k) = sum(flow%size_of_left(k, :f)*flow%frequency*abs(position(:f))) + &
        sum(flow%size_of_left(k, f + 1:)*(abs(speed(:f + d)) + abs(push(:f + d))/flow%size_of_exponent(k)))
      do i = 1, d
        position(f + i) = position(f + i) - real(flow%drift(i, k)*path%amplitude(k))
      end do
      path%amplitude(k) = path%amplitude(k) - forced
      path%powers(:n, 0) = path%powers(:n, 0) + real(flow%shape(:, k)*forced)
      path%powers(:n, 1) = path%powers(:n, 1) + real(flow%shape(:, k)*forced_rate)
    end do
  end subroutine begin_exponentials

  !> Rigid coordinates: with damping, of which the exponentials have carried their part, then without.
  pure subroutine begin_rigid(flow, n, position, speed, push, push_rate, path)
    type(mode_flow_t), intent(in) :: flow
    integer, intent(in) :: n
    real(wp), intent(in) :: position(:), speed(:), push(:), push_rate(:)
    type(path_t), intent(inout) :: path
    real(wp) :: b0, b1
    integer :: i, k, r, f, d
    f = flow%flexible
    d = flow%damped
    do i = 1, d
      b0 = 0
      b1 = 0
      do k = 1, size(flow%exponent)
        b0 = b0 - real(flow%drift(i, k)*sum(flow%left(k, f + 1:)*push(:f + d)))
        b1 = b1 - real(flow%drift(i, k)*sum(flow%left(k, f + 1:)*push_rate(:f + d)))
      end do
      path%powers(:n, 0) = path%powers(:n, 0) + flow%basis(:, f + i)*position(f + i)
      path%powers(:n, 1) = path%powers(:n, 1) + flow%basis(:, f + i)*b0
      path%powers(:n, 2) = path%powers(:n, 2) + flow%basis(:, f + i)*(b1/2)
    end do
    do r = f + d + 1, size(flow%basis, 2)
      path%powers(:n, 0) = path%powers(:n, 0) + flow%basis(:, r)*position(r)
      path%powers(:n, 1) = path%powers(:n, 1) + flow%basis(:, r)*speed(r)
      path%powers(:n, 2) = path%powers(:n, 2) + flow%basis(:, r)*(push(r)/2)
      path%powers(:n, 3) = path%powers(:n, 3) + flow%basis(:, r)*(push_rate(r)/6)
    end do
  end subroutine begin_rigid

  !> The unknowns of the series, and its matrix with what is constant in this flight.
  pure subroutine begin_series(machine, flow, state, path)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    type(path_t), intent(inout) :: path
    real(wp) :: push(machine%n), push_rate(machine%n)
    integer :: n, i
    n = machine%n
    path%unknowns = unknowns_of(machine, state, path%turning)
    path%matrix = flow%matrix
    push = matmul(machine%mobility, path%force(:n))
    push_rate = matmul(machine%mobility, path%force_rate(:n))
    push = push - matmul(flow%carried, [(sum(machine%joints(flow%held(flow%independent(i)))%row*push), &
                                         i=1, size(flow%independent))])
    push_rate = push_rate - matmul(flow%carried, [(sum(machine%joints(flow%held(flow%independent(i)))%row*push_rate), &
                                                   i=1, size(flow%independent))])
    path%matrix(n + 1:2*n, 2*n + 1) = push
    path%matrix(n + 1:2*n, 2*n + 2) = push_rate
  end subroutine begin_series

  !> Coordinates, speeds, one, time since the start, cosines and sines.
  pure function unknowns_of(machine, state, turning) result(y)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp) :: y(2*machine%n + 2 + 2*size(turning))
    integer :: n, m
    n = machine%n
    y(:n) = state%q(:n)
    y(n + 1:2*n) = state%v(:n)
    y(2*n + 1) = 1
    y(2*n + 2) = 0
    do m = 1, size(turning)
      y(2*n + 1 + 2*m) = real(turning(m))
      y(2*n + 2 + 2*m) = aimag(turning(m))
    end do
  end function unknowns_of

  !> The unknowns over an interval of `length` [s] by rising powers of its fraction.
  pure subroutine series_step(matrix, y, length, powers)
    real(wp), intent(in) :: matrix(:, :), y(:), length
    real(wp), intent(out) :: powers(:, 0:)
    integer :: i, k
    powers(:, 0) = y
    do k = 1, ubound(powers, 2)
      powers(:, k) = 0
      do i = 1, size(y)
        if (abs(powers(i, k - 1)) > 0) powers(:, k) = powers(:, k) + matrix(:, i)*(powers(i, k - 1)*(length/k))
      end do
    end do
  end subroutine series_step

  !> Coordinates and speeds `t` [s] after the start of the path.
  pure subroutine path_at(machine, flow, path, t, q, v)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    real(wp), intent(in) :: t
    real(wp), intent(out) :: q(:), v(:)
    complex(wp) :: now
    real(wp) :: sine, cosine, w
    integer :: k, n
    n = machine%n
    if (path%length > 0) then
      do k = 1, n
        q(k) = value_at(path%step(:, k), t/path%length)
        v(k) = value_at(path%step(:, n + k), t/path%length)
      end do
      return
    else if (.not. flow%modal) then
      call series_at(machine, flow, path, t, q, v)
      return
    end if
    associate (p => path%powers)
      q(:n) = p(:n, 0) + t*(p(:n, 1) + t*(p(:n, 2) + t*p(:n, 3)))
      v(:n) = p(:n, 1) + t*(2*p(:n, 2) + 3*t*p(:n, 3))
    end associate
    do k = 1, size(flow%exponent)
      associate (lambda => flow%exponent(k))
        call sine_cosine(aimag(lambda)*t, sine, cosine)
        now = path%amplitude(k)*(exponential(real(lambda)*t)*cmplx(cosine, sine, wp))
        q(:n) = q(:n) + real(flow%shape(:, k)*now)
        v(:n) = v(:n) + real(flow%shape(:, k)*(lambda*now))
      end associate
    end do
    do k = 1, size(path%turning)
      w = k*machine%frequency
      call sine_cosine(w*t, sine, cosine)
      now = path%turning(k)*cmplx(cosine, sine, wp)
      q(:n) = q(:n) + real(flow%response(:, k)*now)
      v(:n) = v(:n) - w*aimag(flow%response(:, k)*now)
    end do
  end subroutine path_at

  !> The same by intervals of the series.
  pure subroutine series_at(machine, flow, path, t, q, v)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    real(wp), intent(in) :: t
    real(wp), intent(out) :: q(:), v(:)
    real(wp) :: y(size(path%unknowns)), powers(size(path%unknowns), 0:terms), length
    integer :: intervals, i, n
    n = machine%n
    y = path%unknowns
    intervals = max(1, ceiling(flow%rate*abs(t)))
    length = t/intervals
    do i = 1, intervals
      call series_step(path%matrix, y, length, powers)
      y = sum(powers, dim=2)
    end do
    q(:n) = y(:n)
    v(:n) = y(n + 1:2*n)
  end subroutine series_at

end module flight_path
