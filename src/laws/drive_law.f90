! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Drives move the foot of the spring. Every drive is held as the Fourier series of the foot
!> position x_A over the crank angle phi,
!>   x_A(phi) = mean + sum_n cosine(n) cos(n phi) + sine(n) sin(n phi),
!> which the exact flight needs; a mechanism's series is computed once to rounding.
module drive_law
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use kinds, only: real64, wp
  use law_table, only: law_choice_t, list_of, value_of
  implicit none
  private

  !> Samples of a measured force closer than this share of the largest are the same.
  real(wp), parameter :: same_force = 1e-9_wp
  !> Samples of a measured force this share of the largest from a straight line lie on it.
  real(wp), parameter :: same_line = 1e-12_wp

  public :: drive_of, add_harmonics, add_ripple, foot_motion, measured_force, ends_with_its_first, next_sample, lever_foot, &
    lever_assembles, moves_foot, is_speed, is_given

  !> A mechanism whose series needs more harmonics is too close to a dead point.
  integer, parameter :: max_harmonics = 1024

  type, public :: drive_t
    !> Drive angular frequency over the natural one; 0 without a drive.
    real(wp) :: ratio = 0
    !> Angular frequency [rad/s] where that is given, not the ratio; else 0.
    real(wp) :: frequency = 0
    real(wp) :: mean = 0
    !> Fourier coefficients [m], index = harmonic.
    real(wp), allocatable :: cosine(:), sine(:)
    !> False if the series of a mechanism did not converge.
    logical :: converged = .true.
    !> Measured force: time between samples [s], 0 = none, and the samples [N] from the section to the next, both ends counted.
    real(wp) :: interval = 0
    real(wp), allocatable :: force(:)
    !> Number of the sample, from 0, up to which the force follows the line between samples i - 1 and i.
    integer, allocatable :: line_end(:)
  end type drive_t

  !> Samples closer than this share of an interval count as reached.
  real(wp), parameter :: reached = 1e-9_wp

  !> Crank OD, slotted lever CE turning about C, rod EA to the guide of A. Lengths in m, angles in rad.
  type, public :: lever_t
    real(wp) :: crank, pivot_distance, lever, rod, pivot_angle, guide_height, side
  end type lever_t

contains

  !> Whether a drive of one body moves the foot of its spring.
  pure logical function moves_foot(name)
    character(len=*), intent(in) :: name
    moves_foot = name == 'harmonic' .or. name == 'fourier' .or. name == 'crank_lever_rod'
  end function moves_foot

  !> Whether a parameter of such a drive is its speed, as a ratio or a frequency.
  pure logical function is_speed(name)
    character(len=*), intent(in) :: name
    is_speed = name == 'ratio' .or. name == 'frequency'
  end function is_speed

  !> Whether such a drive has the one or the other. None is the largest double, which other kinds exceed.
  pure logical function is_given(choice, speed)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: speed
    is_given = value_of(choice, speed) < huge(1.0_real64)
  end function is_given

  !> The law that a choice of the family `drive` names.
  pure function drive_of(choice) result(law)
    type(law_choice_t), intent(in) :: choice
    type(drive_t) :: law
    select case (choice%name)
    case ('harmonic')
      law%cosine = [value_of(choice, 'amplitude')]
      law%sine = [0.0_wp]
    case ('fourier')
      law%cosine = list_of(choice, 'cosine')
      law%sine = list_of(choice, 'sine')
    case ('crank_lever_rod')
      call expand_lever(lever_of(choice), law)
      law%mean = law%mean + value_of(choice, 'shift')
    case ('measured_force')
      law%interval = value_of(choice, 'interval')
      law%force = list_of(choice, 'force')
      ! One period has its first sample once more at its end.
      if (value_of(choice, 'periodic') > 0.5_wp) law%force = [law%force, law%force(:1)]
      law%line_end = line_ends(law%force)
      allocate (law%cosine(0), law%sine(0))
      return
    case default
      allocate (law%cosine(0), law%sine(0))
      return
    end select
    if (choice%name /= 'crank_lever_rod') law%mean = value_of(choice, 'mean')
    if (is_given(choice, 'ratio')) law%ratio = value_of(choice, 'ratio')
    if (is_given(choice, 'frequency')) law%frequency = value_of(choice, 'frequency')
    call advance_angle(law, value_of(choice, 'angle'))
  end function drive_of

  !> Rewrites a series in phi + angle as a series in phi.
  pure subroutine advance_angle(law, angle)
    type(drive_t), intent(inout) :: law
    real(wp), intent(in) :: angle
    real(wp) :: s, c, a, b
    integer :: n
    do n = 1, size(law%cosine)
      call sine_cosine(n*angle, s, c)
      a = law%cosine(n)
      b = law%sine(n)
      law%cosine(n) = a*c + b*s
      law%sine(n) = b*c - a*s
    end do
  end subroutine advance_angle

  !> Foot position x_A [m] and its derivative with respect to the crank angle `phi` [rad].
  pure subroutine foot_motion(law, phi, position, first)
    type(drive_t), intent(in) :: law
    real(wp), intent(in) :: phi
    real(wp), intent(out) :: position
    real(wp), intent(out), optional :: first
    real(wp) :: s1, c1, s, c, next, d1
    integer :: n
    position = law%mean
    d1 = 0
    if (present(first)) first = 0
    if (size(law%cosine) == 0) return
    call sine_cosine(phi, s1, c1)
    s = s1
    c = c1
    do n = 1, size(law%cosine)
      position = position + law%cosine(n)*c + law%sine(n)*s
      d1 = d1 + n*(law%sine(n)*c - law%cosine(n)*s)
      next = c*c1 - s*s1
      s = s*c1 + c*s1
      c = next
    end do
    if (present(first)) first = d1
  end subroutine foot_motion

  !> Measured force [N] at `time` [s since its first sample] and its rate [N/s] from there on.
  pure subroutine measured_force(law, time, force, rate)
    type(drive_t), intent(in) :: law
    real(wp), intent(in) :: time
    real(wp), intent(out) :: force, rate
    integer :: i
    i = min(max(int(time/law%interval + reached), 0), size(law%force) - 2)
    rate = (law%force(i + 2) - law%force(i + 1))/law%interval
    force = law%force(i + 1) + rate*(time - i*law%interval)
  end subroutine measured_force

  !> Whether equidistant samples have the first once more at their end, where the next period begins.
  pure logical function ends_with_its_first(samples)
    real(wp), intent(in) :: samples(:)
    ends_with_its_first = size(samples) > 1
    if (ends_with_its_first) ends_with_its_first = abs(samples(size(samples)) - samples(1)) <= same_force*maxval(abs(samples))
  end function ends_with_its_first

  !> Where the straight line ends that the samples follow from each of them to the next, as numbers of samples from 0.
  pure function line_ends(force) result(ends)
    real(wp), intent(in) :: force(0:)
    integer :: ends(size(force) - 1)
    real(wp) :: allowed
    integer :: first, last
    allowed = same_line*maxval(abs(force))
    first = 0
    do while (first < size(ends))
      last = first + 1
      do while (last < size(ends))
        if (abs(force(last + 1) - force(first) - (last + 1 - first)*(force(first + 1) - force(first))) > allowed) exit
        last = last + 1
      end do
      ends(first + 1:last) = last
      first = last
    end do
  end function line_ends

  !> The first sample of a measured force after `time` [s] where its rate changes, or `time_end` if that comes first.
  pure real(wp) function next_sample(law, time, time_end) result(next)
    type(drive_t), intent(in) :: law
    real(wp), intent(in) :: time, time_end
    integer :: i
    next = time_end
    if (.not. law%interval > 0) return
    i = max(int(time/law%interval + reached), 0) + 1
    if (i <= size(law%line_end)) i = law%line_end(i)
    next = i*law%interval
    if (next > time_end - reached*law%interval) next = time_end
  end function next_sample

  pure function lever_of(choice) result(lever)
    type(law_choice_t), intent(in) :: choice
    type(lever_t) :: lever
    lever = lever_t(value_of(choice, 'crank'), value_of(choice, 'pivot_distance'), &
                    value_of(choice, 'lever'), value_of(choice, 'rod'), &
                    value_of(choice, 'pivot_angle'), value_of(choice, 'guide_height'), &
                    value_of(choice, 'side'))
  end function lever_of

  !> Foot position [m] of the mechanism at crank angle `phi`, C at the origin:
  !> D = O + r (cos phi, sin phi), E = l2 D/|D|, x_A = E_x + sigma sqrt(l3^2 - (E_y - h)^2).
  !> Not a number where the mechanism cannot be assembled.
  pure elemental real(wp) function lever_foot(lever, phi)
    type(lever_t), intent(in) :: lever
    real(wp), intent(in) :: phi
    real(wp) :: e(2)
    e = lever_end(lever, phi)
    lever_foot = e(1) + lever%side*sqrt(lever%rod**2 - (e(2) - lever%guide_height)**2)
  end function lever_foot

  !> Whether the rod reaches the guide at crank angle `phi`.
  pure elemental logical function lever_assembles(lever, phi)
    type(lever_t), intent(in) :: lever
    real(wp), intent(in) :: phi
    real(wp) :: e(2)
    e = lever_end(lever, phi)
    lever_assembles = abs(e(2) - lever%guide_height) <= lever%rod
  end function lever_assembles

  pure function lever_end(lever, phi) result(e)
    type(lever_t), intent(in) :: lever
    real(wp), intent(in) :: phi
    real(wp) :: e(2), d(2), s, c, sb, cb
    call sine_cosine(phi, s, c)
    call sine_cosine(lever%pivot_angle, sb, cb)
    d = lever%pivot_distance*[cb, sb] + lever%crank*[c, s]
    e = lever%lever*d/sqrt(d(1)**2 + d(2)**2)
  end function lever_end

  !> Replaces the crank angle phi by phi + sine sin(n phi) + cosine cos(n phi), by the effect `choice`.
  pure subroutine add_ripple(law, choice)
    type(drive_t), intent(inout) :: law
    type(law_choice_t), intent(in) :: choice
    type(drive_t) :: even
    real(wp), allocatable :: samples(:)
    real(wp) :: ripple(2), phi, s, c
    integer :: count, i, n
    ripple = [value_of(choice, 'sine'), value_of(choice, 'cosine')]
    if (all(abs(ripple) <= 0) .or. size(law%cosine) == 0) return
    n = nint(value_of(choice, 'harmonic'))
    even = law
    law%converged = .false.
    count = 64
    do while (count <= 4*max_harmonics .and. .not. law%converged)
      allocate (samples(0:count - 1))
      do i = 0, count - 1
        phi = i*two_pi/count
        call sine_cosine(n*phi, s, c)
        call foot_motion(even, phi + ripple(1)*s + ripple(2)*c, samples(i))
      end do
      call expand(samples, law)
      deallocate (samples)
      count = 2*count
    end do
  end subroutine add_ripple

  !> Adds the harmonics of the effect `choice` to the motion of the foot, over the crank angle phi.
  pure subroutine add_harmonics(law, choice)
    type(drive_t), intent(inout) :: law
    type(law_choice_t), intent(in) :: choice
    real(wp), allocatable :: cosine(:), sine(:)
    integer :: missing
    cosine = list_of(choice, 'cosine')
    sine = list_of(choice, 'sine')
    missing = max(0, size(cosine) - size(law%cosine))
    law%cosine = [law%cosine, spread(0.0_wp, 1, missing)]
    law%sine = [law%sine, spread(0.0_wp, 1, missing)]
    law%cosine(:size(cosine)) = law%cosine(:size(cosine)) + cosine
    law%sine(:size(sine)) = law%sine(:size(sine)) + sine
  end subroutine add_harmonics

  !> The series of a mechanism, with as many samples as it needs.
  pure subroutine expand_lever(lever, law)
    type(lever_t), intent(in) :: lever
    type(drive_t), intent(inout) :: law
    integer :: count, i
    law%converged = .false.
    allocate (law%cosine(0), law%sine(0))
    count = 64
    do while (count <= 4*max_harmonics .and. .not. law%converged)
      if (.not. all([(lever_assembles(lever, i*two_pi/count), i=0, count - 1)])) return
      call expand([(lever_foot(lever, i*two_pi/count), i=0, count - 1)], law)
      count = 2*count
    end do
  end subroutine expand_lever

  !> Discrete Fourier transform of equidistant samples of the foot position over a turn, if the upper half of the spectrum is
  !> rounding; else nothing.
  pure subroutine expand(samples, law)
    real(wp), intent(in) :: samples(:)
    type(drive_t), intent(inout) :: law
    real(wp), allocatable :: cosine(:), sine(:)
    real(wp) :: size_of_motion, tail
    integer :: count, kept
    count = size(samples)
    call transform(samples, cosine, sine)
    size_of_motion = maxval(abs(samples))
    tail = maxval(abs(cosine(count/4:))) + maxval(abs(sine(count/4:)))
    if (.not. tail <= 8*epsilon(1.0_wp)*size_of_motion) return
    law%mean = sum(samples)/count
    kept = count/4
    do while (kept > 1)
      if (abs(cosine(kept)) + abs(sine(kept)) > epsilon(1.0_wp)*size_of_motion) exit
      kept = kept - 1
    end do
    law%cosine = cosine(:kept)
    law%sine = sine(:kept)
    law%converged = .true.
  end subroutine expand

  !> Real Fourier coefficients of harmonics 1 .. n/2 - 1 of n equidistant samples.
  pure subroutine transform(samples, cosine, sine)
    real(wp), intent(in) :: samples(0:)
    real(wp), allocatable, intent(out) :: cosine(:), sine(:)
    real(wp), allocatable :: table_sine(:), table_cosine(:)
    integer :: n, i, k, position
    n = size(samples)
    allocate (cosine(n/2 - 1), sine(n/2 - 1), table_sine(0:n - 1), table_cosine(0:n - 1))
    do i = 0, n - 1
      call sine_cosine(i*two_pi/n, table_sine(i), table_cosine(i))
    end do
    cosine = 0
    sine = 0
    do k = 1, n/2 - 1
      do i = 0, n - 1
        position = modulo(k*i, n)
        cosine(k) = cosine(k) + samples(i)*table_cosine(position)
        sine(k) = sine(k) + samples(i)*table_sine(position)
      end do
    end do
    cosine = 2*cosine/n
    sine = 2*sine/n
  end subroutine transform

end module drive_law
