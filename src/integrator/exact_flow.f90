! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The motion between two events in closed form, for a linear spring, constant and viscous friction and
!> a periodic drive:
!>   y'' + 2 g y' + w^2 y = f(phi),  y = x - x_equilibrium,  phi = Omega t.
!> With z = y' + g y + i w_d y this is z' = lambda z + f, lambda = -g + i w_d, so
!>   z = periodic response + exp(lambda s) Z.
!> The one harmonic that may be near resonance is kept out of the periodic response; its answer from
!> rest, (exp(i n Omega s) - exp(lambda s))/(i n Omega - lambda), is written with exp(x) - 1 and stays
!> accurate through undamped exact resonance.
!> Far above critical damping the exponents are real, -slow and -fast: u = y' + fast y and w = y' + slow y then replace the two
!> parts of z, with u' = -slow u + f and w' = -fast w + f.
module exact_flow
  use effect_law, only: constant_force
  use elementary, only: exponential, exponential_minus_one, sine_cosine
  use kinds, only: wp
  use oscillator, only: oscillator_t
  implicit none
  private

  public :: prepare_flow, begin_segment, evaluate, jerk_bound_at, snap_bound_at, secular_factor, largest_damping_ratio

  !> Largest damping ratio for which dividing by the damped frequency is harmless.
  real(wp), parameter :: largest_damping_ratio = 0.9_wp
  !> Damping ratio from which on the exponents are far enough apart to be taken one by one; below it they are no stiff system. Times
  !> shorter than this share of the period are rounding.
  real(wp), parameter :: overdamped_from = 4, shortest_decay = 1e-12_wp
  !> An exponential of minus this is 0.
  real(wp), parameter :: gone = 746
  !> Above it [rad/s] the fourth power of a frequency, which the bounds of a motion take, is not finite.
  real(wp), parameter :: fastest = sqrt(sqrt(huge(1.0_wp)))

  !> Coefficients that depend on the machine and the drive frequency only.
  type, public :: flow_t
    !> False if the machine has no closed form here.
    logical :: available = .false.
    real(wp) :: natural = 0, damped = 0, decay = 0, drive_frequency = 0
    !> Real exponents, and their sizes [1/s].
    logical :: overdamped = .false.
    real(wp) :: slow = 0, fast = 0
    !> Equilibria while slipping down, at rest without the mean sliding friction, and up [m].
    real(wp) :: equilibrium(-1:1) = 0
    integer :: harmonics = 0
    !> Periodic response z = sum p cos n phi + q sin n phi and forcing f = sum f_cos cos + f_sin sin.
    real(wp), allocatable :: p_re(:), p_im(:), q_re(:), q_im(:), f_cos(:), f_sin(:)
    !> Harmonic near resonance (0 = none), half its forcing, and i n Omega - lambda.
    integer :: resonant = 0
    complex(wp) :: half_forcing = 0, detuning = 0
    !> Bounds on |y'''| and |y''''|: of the periodic response, and per unit of |Z|.
    real(wp) :: jerk_periodic = 0, snap_periodic = 0, jerk_free = 0, snap_free = 0
  end type flow_t

  !> One flight from its start.
  type, public :: segment_t
    real(wp) :: equilibrium = 0, start = 0
    real(wp) :: z_re = 0, z_im = 0
    complex(wp) :: resonant_start = 0
    !> Bounds on the third and fourth derivative of the position [m/s^3, m/s^4].
    real(wp) :: jerk_bound = 0, snap_bound = 0
  end type segment_t

  !> Position and its first three derivatives, SI.
  type, public :: kinematics_t
    real(wp) :: x = 0, v = 0, a = 0, j = 0
  end type kinematics_t

contains

  !> Closed form of a machine; `available`: whether it has one.
  pure subroutine prepare_flow(machine, flow)
    type(oscillator_t), intent(in) :: machine
    type(flow_t), intent(out) :: flow
    complex(wp) :: lambda, h, forward, backward
    real(wp) :: w, amplitude
    integer :: n
    flow%natural = machine%natural_frequency
    flow%decay = machine%friction%damping/(2*machine%mass)
    flow%overdamped = flow%decay >= overdamped_from*flow%natural
    flow%available = machine%restoring%is_linear .and. .not. machine%effects%nonlinear .and. .not. machine%drive%interval > 0 &
      .and. flow%natural > 0 .and. (flow%decay <= largest_damping_ratio*flow%natural .or. flow%overdamped) &
      .and. max(flow%natural, flow%decay, size(machine%drive%cosine)*machine%drive_frequency) < fastest
    if (flow%overdamped) flow%available = flow%available .and. flow%decay*machine%period*shortest_decay < 1
    if (.not. flow%available) return
    flow%drive_frequency = machine%drive_frequency
    flow%equilibrium = machine%restoring%free_length + machine%drive%mean &
      - [-1, 0, 1]*(machine%friction%kinetic/machine%restoring%stiffness)
    if (machine%effects%present) flow%equilibrium = flow%equilibrium + constant_force(machine%effects)/machine%restoring%stiffness
    flow%harmonics = size(machine%drive%cosine)
    allocate (flow%p_re(flow%harmonics), flow%p_im(flow%harmonics), flow%q_re(flow%harmonics), &
              flow%q_im(flow%harmonics))
    flow%f_cos = flow%natural**2*machine%drive%cosine
    flow%f_sin = flow%natural**2*machine%drive%sine
    if (flow%overdamped) then
      call prepare_overdamped(flow)
      return
    end if
    flow%damped = sqrt((flow%natural - flow%decay)*(flow%natural + flow%decay))
    flow%resonant = near_resonance(flow)
    lambda = cmplx(-flow%decay, flow%damped, wp)
    flow%jerk_free = flow%natural**3/flow%damped
    flow%snap_free = flow%natural**4/flow%damped
    do n = 1, flow%harmonics
      w = n*flow%drive_frequency
      h = cmplx(flow%f_cos(n), -flow%f_sin(n), wp)/2
      backward = conjg(h)/(cmplx(0, -w, wp) - lambda)
      if (n == flow%resonant) then
        flow%half_forcing = h
        flow%detuning = cmplx(0, w, wp) - lambda
        forward = 0
        call add_resonant_bounds(flow, abs(h), w, machine%period)
      else
        forward = h/(cmplx(0, w, wp) - lambda)
      end if
      flow%p_re(n) = real(forward + backward, wp)
      flow%p_im(n) = aimag(forward + backward)
      flow%q_re(n) = -aimag(forward - backward)
      flow%q_im(n) = real(forward - backward, wp)
      amplitude = sqrt(flow%p_im(n)**2 + flow%q_im(n)**2)/flow%damped
      flow%jerk_periodic = flow%jerk_periodic + amplitude*w**3
      flow%snap_periodic = flow%snap_periodic + amplitude*w**4
    end do
  end subroutine prepare_flow

  !> Exponents and periodic response far above critical damping.
  pure subroutine prepare_overdamped(flow)
    type(flow_t), intent(inout) :: flow
    complex(wp) :: h, u, w
    real(wp) :: frequency
    integer :: n
    flow%fast = flow%decay + sqrt((flow%decay - flow%natural)*(flow%decay + flow%natural))
    flow%slow = flow%natural*(flow%natural/flow%fast)
    do n = 1, flow%harmonics
      frequency = n*flow%drive_frequency
      h = cmplx(flow%f_cos(n), -flow%f_sin(n), wp)
      u = h/cmplx(flow%slow, frequency, wp)
      w = h/cmplx(flow%fast, frequency, wp)
      flow%p_re(n) = real(u, wp)
      flow%q_re(n) = -aimag(u)
      flow%p_im(n) = real(w, wp)
      flow%q_im(n) = -aimag(w)
      ! The amplitude of y is |u|/|fast + i frequency|.
      flow%jerk_periodic = flow%jerk_periodic + abs(u/cmplx(flow%fast, frequency, wp))*frequency**3
      flow%snap_periodic = flow%snap_periodic + abs(u/cmplx(flow%fast, frequency, wp))*frequency**4
    end do
  end subroutine prepare_overdamped

  !> The harmonic within a tenth of the natural frequency; at most one can be that near.
  pure integer function near_resonance(flow)
    type(flow_t), intent(in) :: flow
    real(wp) :: distance
    near_resonance = max(1, nint(flow%natural/flow%drive_frequency))
    distance = abs(near_resonance*flow%drive_frequency - flow%natural)
    if (near_resonance > flow%harmonics .or. distance > 0.1_wp*flow%natural) near_resonance = 0
  end function near_resonance

  !> The resonant answer grows at most like |h| s, s no longer than a period.
  pure subroutine add_resonant_bounds(flow, h, w, period)
    type(flow_t), intent(inout) :: flow
    real(wp), intent(in) :: h, w, period
    associate (u => flow%natural)
      flow%jerk_periodic = flow%jerk_periodic &
        + h*(u**3*period + u**2 + u*w + w**2)/flow%damped
      flow%snap_periodic = flow%snap_periodic &
        + h*(u**4*period + u**3 + u**2*w + u*w**2 + w**3)/flow%damped
    end associate
  end subroutine add_resonant_bounds

  !> Starts a flight at `time` [s] after the section, slipping in `direction` +1 or -1 (0: without
  !> friction).
  pure subroutine begin_segment(flow, time, x, v, direction, segment)
    type(flow_t), intent(in) :: flow
    real(wp), intent(in) :: time, x, v
    integer, intent(in) :: direction
    type(segment_t), intent(out) :: segment
    real(wp) :: y, z_re, z_im, s1, c1, s, c, next, size_z
    integer :: n
    segment%start = time
    segment%equilibrium = flow%equilibrium(direction)
    y = x - segment%equilibrium
    if (flow%overdamped) then
      z_re = v + flow%fast*y
      z_im = v + flow%slow*y
    else
      z_re = v + flow%decay*y
      z_im = flow%damped*y
    end if
    call sine_cosine(flow%drive_frequency*time, s1, c1)
    s = s1
    c = c1
    do n = 1, flow%harmonics
      z_re = z_re - (flow%p_re(n)*c + flow%q_re(n)*s)
      z_im = z_im - (flow%p_im(n)*c + flow%q_im(n)*s)
      if (n == flow%resonant) segment%resonant_start = flow%half_forcing*cmplx(c, s, wp)
      next = c*c1 - s*s1
      s = s*c1 + c*s1
      c = next
    end do
    segment%z_re = z_re
    segment%z_im = z_im
    if (flow%overdamped) then
      segment%jerk_bound = jerk_bound_at(flow, segment, 0.0_wp)
      segment%snap_bound = snap_bound_at(flow, segment, 0.0_wp)
      return
    end if
    size_z = sqrt(z_re**2 + z_im**2)
    segment%jerk_bound = flow%jerk_periodic + flow%jerk_free*size_z
    segment%snap_bound = flow%snap_periodic + flow%snap_free*size_z
  end subroutine begin_segment

  !> Bound on the third derivative of the position from `elapsed` [s] after the start of the flight on.
  pure real(wp) function jerk_bound_at(flow, segment, elapsed) result(bound)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: elapsed
    bound = segment%jerk_bound
    if (flow%overdamped) bound = flow%jerk_periodic + free_bound(flow, segment, elapsed, 3)
  end function jerk_bound_at

  !> The same of the fourth.
  pure real(wp) function snap_bound_at(flow, segment, elapsed) result(bound)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: elapsed
    bound = segment%snap_bound
    if (flow%overdamped) bound = flow%snap_periodic + free_bound(flow, segment, elapsed, 4)
  end function snap_bound_at

  !> What the two exponentials have of derivative number `order`.
  pure real(wp) function free_bound(flow, segment, elapsed, order) result(bound)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: elapsed
    integer, intent(in) :: order
    bound = flow%slow**order*abs(segment%z_re)
    if (flow%fast*elapsed < gone) bound = bound + flow%fast**order*exponential(-flow%fast*elapsed)*abs(segment%z_im)
    bound = bound/(flow%fast - flow%slow)
  end function free_bound

  !> Kinematics at `elapsed` [s] after the start of the flight.
  pure subroutine evaluate(flow, segment, elapsed, now)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: elapsed
    type(kinematics_t), intent(out) :: now
    real(wp) :: z_re, z_im, f, f_rate, s1, c1, s, c, next, y, turn_s, turn_c, shrink
    integer :: n
    complex(wp) :: z_resonant
    if (flow%overdamped) then
      call evaluate_overdamped(flow, segment, elapsed, now)
      return
    end if
    call sine_cosine(flow%damped*elapsed, turn_s, turn_c)
    if (flow%decay > 0) then
      shrink = exponential(-flow%decay*elapsed)
      turn_s = shrink*turn_s
      turn_c = shrink*turn_c
    end if
    z_re = turn_c*segment%z_re - turn_s*segment%z_im
    z_im = turn_s*segment%z_re + turn_c*segment%z_im
    f = 0
    f_rate = 0
    call sine_cosine(flow%drive_frequency*(segment%start + elapsed), s1, c1)
    s = s1
    c = c1
    do n = 1, flow%harmonics
      z_re = z_re + (flow%p_re(n)*c + flow%q_re(n)*s)
      z_im = z_im + (flow%p_im(n)*c + flow%q_im(n)*s)
      f = f + (flow%f_cos(n)*c + flow%f_sin(n)*s)
      f_rate = f_rate + n*(flow%f_sin(n)*c - flow%f_cos(n)*s)
      next = c*c1 - s*s1
      s = s*c1 + c*s1
      c = next
    end do
    if (flow%resonant > 0) then
      z_resonant = segment%resonant_start*cmplx(turn_c, turn_s, wp) &
                   *secular_factor(flow%detuning, elapsed)
      z_re = z_re + real(z_resonant, wp)
      z_im = z_im + aimag(z_resonant)
    end if
    y = z_im/flow%damped
    now%x = segment%equilibrium + y
    now%v = z_re - flow%decay*y
    now%a = f - flow%natural**2*y - 2*flow%decay*now%v
    now%j = flow%drive_frequency*f_rate - flow%natural**2*now%v - 2*flow%decay*now%a
  end subroutine evaluate

  !> The same far above critical damping: a and j are those of each part, as their sums with the forces cancel.
  pure subroutine evaluate_overdamped(flow, segment, elapsed, now)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: elapsed
    type(kinematics_t), intent(out) :: now
    real(wp) :: u, w, s1, c1, s, c, next, positions, speeds, apart
    integer :: n
    associate (slow => flow%slow, fast => flow%fast)
      apart = fast - slow
      u = exponential(-slow*elapsed)*segment%z_re/apart
      w = 0
      if (fast*elapsed < gone) w = exponential(-fast*elapsed)*segment%z_im/apart
      now%x = segment%equilibrium + (u - w)
      now%v = fast*w - slow*u
      now%a = slow**2*u - fast**2*w
      now%j = fast**3*w - slow**3*u
      call sine_cosine(flow%drive_frequency*(segment%start + elapsed), s1, c1)
      s = s1
      c = c1
      do n = 1, flow%harmonics
        u = (flow%p_re(n)*c + flow%q_re(n)*s)/apart
        w = (flow%p_im(n)*c + flow%q_im(n)*s)/apart
        positions = u - w
        speeds = fast*w - slow*u
        now%x = now%x + positions
        now%v = now%v + speeds
        now%a = now%a - (n*flow%drive_frequency)**2*positions
        now%j = now%j - (n*flow%drive_frequency)**2*speeds
        next = c*c1 - s*s1
        s = s*c1 + c*s1
        c = next
      end do
    end associate
  end subroutine evaluate_overdamped

  !> (exp(k s) - 1)/k, equal to s at k = 0 and accurate near it.
  pure function secular_factor(k, s) result(factor)
    complex(wp), intent(in) :: k
    real(wp), intent(in) :: s
    complex(wp) :: factor
    real(wp) :: growth, sine, cosine, half_sine, half_cosine
    if (abs(k) <= 0) then
      factor = s
      return
    end if
    growth = exponential_minus_one(real(k, wp)*s)
    call sine_cosine(aimag(k)*s, sine, cosine)
    call sine_cosine(aimag(k)*s/2, half_sine, half_cosine)
    factor = cmplx(growth*cosine - 2*half_sine**2, (growth + 1)*sine, wp)/k
  end function secular_factor

end module exact_flow
