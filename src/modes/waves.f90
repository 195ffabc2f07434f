! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A drive as a function of time.
module waves
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use multibody, only: load_t, wave_t
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, value_of
  use tape_value, only: evaluate
  use text, only: to_text
  implicit none
  private

  public :: wave_of, wave_of_load, modulation_of

  !> Points of a period, and harmonics that a motion may have: those above are rounding.
  integer, parameter :: points = 256, most_harmonics = 96
  real(wp), parameter :: rounding = 8*epsilon(1.0_wp)

contains

  !> mean + rate t + amplitude cos(phi + angle) + sum a_n cos(n phi) + b_n sin(n phi); forces have no rate.
  pure function wave_of(choice) result(wave)
    type(law_choice_t), intent(in) :: choice
    type(wave_t) :: wave
    real(wp) :: sine, cosine
    wave%mean = value_of(choice, 'mean')
    if (choice%name /= 'drive:force') wave%rate = value_of(choice, 'rate')
    call add_series(list_of(choice, 'cosine'), list_of(choice, 'sine'), wave)
    call sine_cosine(value_of(choice, 'angle'), sine, cosine)
    wave%harmonic(1) = wave%harmonic(1) + value_of(choice, 'amplitude')*cmplx(cosine, sine, wp)
  end function wave_of

  !> Fourier series of an expression of time and phase, to rounding. `problem` states why it has none that ends.
  pure subroutine wave_of_load(load, frequency, wave, problem)
    type(load_t), intent(in) :: load
    real(wp), intent(in) :: frequency
    type(wave_t), intent(out) :: wave
    character(len=:), allocatable, intent(out) :: problem
    real(wp) :: values(0:points - 1), cosine(0:points - 1), sine(0:points - 1), now(load%tape%count), z(size(load%rates))
    integer :: fault(load%tape%count), turn(0:points - 1), i, m
    complex(wp) :: harmonic(points/2 - 1)
    z = 0
    do i = 0, points - 1
      z(2) = two_pi*i/points
      call sine_cosine(z(2), sine(i), cosine(i))
      z(1) = z(2)/frequency
      call evaluate(load%tape, z, load%parameters, now, fault)
      values(i) = now(load%node)
      if (fault(load%node) == 0) cycle
      problem = 'found a motion that is not defined at the phase '//to_text(real(z(2), kind(1d0)), 4)//' rad'
      return
    end do
    do m = 1, size(harmonic)
      turn = modulo(m*[(i, i=0, points - 1)], points)
      harmonic(m) = cmplx(sum(values*cosine(turn)), -sum(values*sine(turn)), wp)*2/points
    end do
    where (abs(harmonic) <= rounding*maxval(abs(values))) harmonic = 0
    m = findloc(abs(harmonic) > 0, .true., 1, back=.true.)
    wave%mean = sum(values)/points
    wave%harmonic = harmonic(:max(m, 1))
    if (m > most_harmonics) problem = 'found a motion that '//to_text(most_harmonics)//' harmonics do not describe, as with a '// &
                                      'jump or a corner in a period, allowed a smooth one that repeats with the drive'
  end subroutine wave_of_load

  !> modulation cos(phi) + sum a_n cos(n phi) + b_n sin(n phi) of the force of a spring.
  pure function modulation_of(choice) result(wave)
    type(law_choice_t), intent(in) :: choice
    type(wave_t) :: wave
    call add_series(list_of(choice, 'modulation_cosine'), list_of(choice, 'modulation_sine'), wave)
    wave%harmonic(1) = wave%harmonic(1) + value_of(choice, 'modulation')
  end function modulation_of

  !> Harmonics a_n cos(n phi) + b_n sin(n phi), at least one.
  pure subroutine add_series(a, b, wave)
    real(wp), intent(in) :: a(:), b(:)
    type(wave_t), intent(inout) :: wave
    integer :: n
    allocate (wave%harmonic(max(1, size(a), size(b))), source=(0.0_wp, 0.0_wp))
    do n = 1, size(a)
      wave%harmonic(n) = wave%harmonic(n) + a(n)
    end do
    do n = 1, size(b)
      wave%harmonic(n) = wave%harmonic(n) - cmplx(0.0_wp, b(n), wp)
    end do
  end subroutine add_series

end module waves
