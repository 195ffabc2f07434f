! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Flights of a multibody structure in one mode over a given time, with their derivatives by the start: in closed form where the
!> mode is linear, else by steps of the equations together with their variations. Coordinates are those of module `structure`.
module structure_flight
  use flight_path, only: begin_change, begin_path, path_at, path_t
  use guarded_march, only: begin_march, guard_t, march_failed, march_t, march_time_over, most_equations, system_t, take_step
  use multibody, only: joint_contact, joint_elastic, multibody_t
  use multibody_flows, only: multibody_motion_t, ready, with_matrix
  use multibody_state, only: free_force, is_held, is_marched, joint_force, joint_motion, multibody_state_t, key_of, &
    spring_force, strength_now, turning_at
  use kinds, only: int64, wp
  use mode_flow, only: build_flow, mode_flow_t
  use motion_state, only: flight_adaptive
  implicit none
  private

  public :: fly_mode, flow_of, put_state, rates, rate_slopes, accelerations, force_slopes, surface_jerk

  integer, parameter :: most_steps = 100000
  !> Displacements below this share of the natural size are integrated to an absolute error.
  real(wp), parameter :: fine = 1e-3_wp

  !> A mode, what its coordinates are, and what may change in it.
  type, public :: frame_t
    type(multibody_motion_t) :: moving
    !> Directions of the positions and of the velocities (columns), joints with an extension, numbers of positions and velocities.
    real(wp), allocatable :: directions(:, :), velocities(:, :)
    integer, allocatable :: elastic(:)
    integer :: positions = 0, speeds = 0
  end type frame_t

  !> The displacement from a start and, after it, changes of it, column by column.
  type, extends(system_t) :: varied_t
    type(frame_t) :: frame
    type(mode_flow_t) :: flow
    type(multibody_state_t) :: state
    real(wp), allocatable :: start(:)
    !> +1, or -1 backwards.
    integer :: way = 1
  contains
    procedure :: slope => slope_of_varied
  end type varied_t

contains

  !> The number of the flow that is ready for the mode with these phases, or 0 and the flow itself, made for it.
  pure subroutine flow_of(moving, phase, at, spare)
    type(multibody_motion_t), intent(in) :: moving
    integer, intent(in) :: phase(:)
    integer, intent(out) :: at
    type(mode_flow_t), intent(out) :: spare
    integer(int64) :: key
    key = key_of(moving%machine, phase)
    at = ready(moving, key)
    if (at == 0) call build_flow(moving%machine, key, with_matrix(moving), spare)
  end subroutine flow_of

  !> From `state`, whose coordinates are `y0`, to `t1` [s]: `y1`, and its derivative by `y0`. `sizes` are those of the coordinates.
  pure subroutine fly_mode(frame, sizes, state, y0, t1, y1, flight)
    type(frame_t), intent(in) :: frame
    real(wp), intent(in) :: sizes(:), y0(:), t1
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(out) :: y1(:)
    real(wp), intent(out), optional :: flight(:, :)
    type(mode_flow_t) :: spare
    integer :: at
    call flow_of(frame%moving, state%phase, at, spare)
    if (at > 0) then
      call fly_flow(frame, frame%moving%flows(at), sizes, state, y0, t1, y1, flight)
    else
      call fly_flow(frame, spare, sizes, state, y0, t1, y1, flight)
    end if
  end subroutine fly_mode

  !> The same, by its flow.
  pure subroutine fly_flow(frame, flow, sizes, state, y0, t1, y1, flight)
    type(frame_t), intent(in) :: frame
    type(mode_flow_t), intent(in) :: flow
    real(wp), intent(in) :: sizes(:), y0(:), t1
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(out) :: y1(:)
    real(wp), intent(out), optional :: flight(:, :)
    if (frame%moving%options%flight == flight_adaptive .or. is_marched(frame%moving%machine, state%phase)) then
      call march(frame, flow, sizes, state, y0, t1, y1, flight)
    else
      call fly_closed(frame, flow, state, y0, t1, y1, flight)
    end if
  end subroutine fly_flow

  !> In closed form: the difference of two motions is a motion that nothing drives.
  pure subroutine fly_closed(frame, flow, state, y0, t1, y1, flight)
    type(frame_t), intent(in) :: frame
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(in) :: y0(:), t1
    real(wp), intent(out) :: y1(:)
    real(wp), intent(out), optional :: flight(:, :)
    type(path_t) :: path
    real(wp), dimension(frame%moving%machine%n) :: q, v, force, from
    real(wp) :: unit(size(y0)), after(size(y0)), s0, s1, u, span
    complex(wp) :: turning(frame%moving%harmonics)
    integer :: i, j, k
    span = t1 - state%time
    associate (machine => frame%moving%machine, d => frame%directions, p => frame%positions, &
      n => frame%positions + frame%speeds)
      call begin_path(machine, flow, state, path)
      call path_at(machine, flow, path, span, q, v)
      y1(:p) = matmul(q, d)
      y1(p + 1:n) = matmul(v, frame%velocities)
      y1(n + 1:) = y0(n + 1:)
      do i = 1, size(frame%elastic)
        j = frame%elastic(i)
        if (state%phase(j) /= 0) cycle
        turning = turning_at(machine%frequency, state%time, frame%moving%harmonics)
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s0, u)
        turning = turning_at(machine%frequency, t1, frame%moving%harmonics)
        call joint_motion(machine, j, q, v, t1, turning, s1, u)
        y1(n + i) = y0(n + i) + (s1 - s0)
      end do
      if (.not. present(flight)) return
      do k = 1, size(y0)
        unit = 0
        unit(k) = 1
        from = matmul(d, unit(:p))
        force = 0
        do i = 1, size(frame%elastic)
          associate (joint => machine%joints(frame%elastic(i)))
            if (state%phase(frame%elastic(i)) == 0) force = force &
              + joint%stiffness*(sum(joint%row*from) - unit(n + i))*joint%row
          end associate
        end do
        call begin_change(machine, flow, from, matmul(frame%velocities, unit(p + 1:n)), force, path)
        call path_at(machine, flow, path, span, q, v)
        after(:p) = matmul(q, d)
        after(p + 1:n) = matmul(v, frame%velocities)
        after(n + 1:) = 0
        do i = 1, size(frame%elastic)
          if (state%phase(frame%elastic(i)) == 0) after(n + i) = unit(n + i) &
            + sum(machine%joints(frame%elastic(i))%row*(q - from))
        end do
        flight(:, k) = after
      end do
    end associate
  end subroutine fly_closed

  !> By steps, backwards by the mirrored equations; of many coordinates the changes are taken along a few at a time.
  pure subroutine march(frame, flow, sizes, state, y0, t1, y1, flight)
    type(frame_t), intent(in) :: frame
    type(mode_flow_t), intent(in) :: flow
    real(wp), intent(in) :: sizes(:), y0(:), t1
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(out) :: y1(:)
    real(wp), intent(out), optional :: flight(:, :)
    type(varied_t) :: system
    type(march_t) :: steps
    type(guard_t) :: none(0)
    real(wp) :: all(most_equations), scale(most_equations), span
    integer :: n, first, columns, i, k, ended, most
    n = size(y0)
    span = t1 - state%time
    system%frame = frame
    system%flow = flow
    system%state = state
    system%start = y0
    system%way = merge(1, -1, span > 0)
    most = 0
    if (present(flight)) most = most_equations/n - 1
    first = 1
    do
      columns = min(most, n - first + 1)
      all = 0
      scale(:n) = fine*sizes
      do k = 1, columns
        all(k*n + first + k - 1) = 1
        scale(k*n + 1:(k + 1)*n) = sizes/sizes(first + k - 1)
      end do
      associate (equations => (columns + 1)*n)
        call begin_march(steps, system, frame%moving%options%tolerance, scale(:equations), abs(span), 0.0_wp, all(:equations))
        do i = 1, most_steps
          call take_step(steps, system, none, abs(span), ended)
          if (ended == march_time_over .or. ended == march_failed) exit
        end do
      end associate
      y1 = y0 + steps%y(:n)
      if (ended /= march_time_over) y1 = huge(1.0_wp)
      do k = 1, columns
        flight(:, first + k - 1) = steps%y(k*n + 1:(k + 1)*n)
      end do
      first = first + columns
      if (columns == 0 .or. first > n) exit
    end do
  end subroutine march

  pure function slope_of_varied(self, time, y) result(slope)
    class(varied_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: slope(size(y))
    type(multibody_state_t) :: state
    real(wp) :: by_state(size(self%start), size(self%start)), now(size(self%start))
    integer :: n, k
    n = size(self%start)
    now = self%start + y(:n)
    call put_state(self%frame, self%state, self%state%time + self%way*time, now, state)
    slope(:n) = self%way*rates(self%frame, self%flow, state)
    if (size(y) == n) return
    call rate_slopes(self%frame, self%flow, state, by_state)
    do k = 1, size(y)/n - 1
      slope(k*n + 1:(k + 1)*n) = self%way*matmul(by_state, y(k*n + 1:(k + 1)*n))
    end do
  end function slope_of_varied

  !> A new state gets the coordinates `y` at a time, in the mode of `mode`.
  pure subroutine put_state(frame, mode, time, y, state)
    type(frame_t), intent(in) :: frame
    type(multibody_state_t), intent(in) :: mode
    real(wp), intent(in) :: time, y(:)
    type(multibody_state_t), intent(inout) :: state
    complex(wp) :: turning(frame%moving%harmonics)
    real(wp) :: s, u
    integer :: k
    associate (machine => frame%moving%machine, p => frame%positions, n => frame%positions + frame%speeds)
      state%phase = mode%phase
      state%time = time
      state%q(:machine%n) = matmul(frame%directions, y(:p))
      state%v(:machine%n) = matmul(frame%velocities, y(p + 1:n))
      if (size(frame%elastic) == 0) return
      turning = turning_at(machine%frequency, time, frame%moving%harmonics)
      do k = 1, size(frame%elastic)
        call joint_motion(machine, frame%elastic(k), state%q, state%v, time, turning, s, u)
        state%slider(frame%elastic(k)) = s - y(n + k)
      end do
    end associate
  end subroutine put_state

  !> Time derivative of the coordinates.
  pure function rates(frame, flow, state) result(slope)
    type(frame_t), intent(in) :: frame
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    real(wp) :: slope(frame%positions + frame%speeds + size(frame%elastic)), s, u
    complex(wp) :: turning(frame%moving%harmonics)
    integer :: k
    associate (machine => frame%moving%machine, p => frame%positions, n => frame%positions + frame%speeds)
      turning = turning_at(machine%frequency, state%time, frame%moving%harmonics)
      slope(:p) = matmul(state%v(:machine%n), frame%directions)
      slope(p + 1:n) = matmul(accelerations(machine, flow, state, turning), frame%velocities)
      do k = 1, size(frame%elastic)
        slope(n + k) = 0
        if (state%phase(frame%elastic(k)) /= 0) cycle
        call joint_motion(machine, frame%elastic(k), state%q, state%v, state%time, turning, s, u)
        slope(n + k) = u
      end do
    end associate
  end function rates

  !> Derivatives of the rates by the coordinates.
  pure subroutine rate_slopes(frame, flow, state, by_state)
    type(frame_t), intent(in) :: frame
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(out) :: by_state(:, :)
    real(wp), dimension(frame%moving%machine%n, size(by_state, 2)) :: force, a
    real(wp) :: by_time(frame%moving%machine%n)
    complex(wp) :: turning(frame%moving%harmonics)
    integer :: i, k, j
    associate (machine => frame%moving%machine, p => frame%positions, n => frame%positions + frame%speeds)
      turning = turning_at(machine%frequency, state%time, frame%moving%harmonics)
      call force_slopes(frame, state, turning, force, by_time)
      force = matmul(machine%mobility, force)
      a = force
      do i = 1, size(flow%independent)
        j = flow%held(flow%independent(i))
        do k = 1, size(by_state, 2)
          a(:, k) = a(:, k) - flow%carried(:, i)*sum(machine%joints(j)%row*force(:, k))
        end do
      end do
      by_state = 0
      by_state(:p, p + 1:n) = matmul(transpose(frame%directions), frame%velocities)
      by_state(p + 1:n, :) = matmul(transpose(frame%velocities), a)
      do k = 1, size(frame%elastic)
        if (state%phase(frame%elastic(k)) /= 0) cycle
        by_state(n + k, p + 1:n) = matmul(machine%joints(frame%elastic(k))%row, frame%velocities)
      end do
    end associate
  end subroutine rate_slopes

  !> Accelerations of all coordinates in a mode [m/s^2].
  pure function accelerations(machine, flow, state, turning) result(a)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp) :: a(machine%n), force(machine%n), free(machine%n), s, u, given
    integer :: i, j
    call free_force(machine, state, turning, force)
    free = matmul(machine%mobility, force)
    a = free
    do i = 1, size(flow%independent)
      j = flow%held(flow%independent(i))
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given)
      a = a - flow%carried(:, i)*(sum(machine%joints(j)%row*free) + given)
    end do
  end function accelerations

  !> Derivatives of the forces on the coordinates, those of constraints excepted, by the state and by the time.
  pure subroutine force_slopes(frame, state, turning, by_state, by_time)
    type(frame_t), intent(in) :: frame
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: by_state(:, :), by_time(:)
    real(wp) :: s, u, given, r, by_position, by_speed, surface, rate, strength, growth
    integer :: i, j, m
    associate (machine => frame%moving%machine, p => frame%positions, n => frame%positions + frame%speeds, &
               d => frame%directions, e => frame%velocities)
      by_state = 0
      by_state(:, :p) = -matmul(machine%stiffness, d)
      by_state(:, p + 1:n) = -matmul(machine%damping, e)
      by_time = 0
      do m = 1, size(machine%force, 2)
        by_time = by_time - m*machine%frequency*aimag(machine%force(:, m)*turning(m))
      end do
      do j = 1, size(machine%joints)
        associate (joint => machine%joints(j))
          if (is_held(joint, state%phase(j)) .or. joint%kind == joint_contact) cycle
          if (joint%kind == joint_elastic .and. state%phase(j) == 0) then
            i = findloc(frame%elastic, j, 1)
            by_state(:, n + i) = -joint%stiffness*joint%row
            cycle
          end if
          call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given)
          call strength_now(joint, machine%frequency, turning, strength, growth)
          call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, strength, r, by_position, by_speed)
          surface = u - sum(joint%row*state%v(:machine%n))
          rate = by_position*surface + by_speed*given
          if (allocated(joint%strength)) then
            call spring_force(joint, s, growth, r)
            rate = rate + r
          end if
          by_time = by_time + rate*joint%row
          do i = 1, p
            by_state(:, i) = by_state(:, i) + by_position*sum(joint%row*d(:, i))*joint%row
          end do
          do i = 1, n - p
            by_state(:, p + i) = by_state(:, p + i) + by_speed*sum(joint%row*e(:, i))*joint%row
          end do
        end associate
      end do
    end associate
  end subroutine force_slopes

  !> Third derivative of the given part of a joint coordinate [m/s^3].
  pure real(wp) function surface_jerk(machine, j, turning) result(jerk)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    complex(wp), intent(in) :: turning(:)
    integer :: m
    jerk = 0
    associate (offset => machine%joints(j)%offset)
      if (.not. allocated(offset%harmonic)) return
      do m = 1, size(offset%harmonic)
        jerk = jerk + (m*machine%frequency)**3*aimag(offset%harmonic(m)*turning(m))
      end do
    end associate
  end function surface_jerk

end module structure_flight
