! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A drive as a function of time.
module waves
  use elementary, only: sine_cosine
  use multibody, only: wave_t
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, value_of
  implicit none
  private

  public :: wave_of, modulation_of

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
