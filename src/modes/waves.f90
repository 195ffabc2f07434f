! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The course of a drive in time.
module waves
  use elementary, only: sine_cosine
  use jointed, only: wave_t
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, value_of
  implicit none
  private

  public :: wave_of

contains

  !> mean + amplitude cos(phi + angle) + sum a_n cos(n phi) + b_n sin(n phi).
  pure function wave_of(choice) result(wave)
    type(law_choice_t), intent(in) :: choice
    type(wave_t) :: wave
    real(wp) :: sine, cosine
    integer :: n
    wave%mean = value_of(choice, 'mean')
    associate (a => list_of(choice, 'cosine'), b => list_of(choice, 'sine'))
      allocate (wave%harmonic(max(1, size(a), size(b))), source=(0.0_wp, 0.0_wp))
      do n = 1, size(a)
        wave%harmonic(n) = wave%harmonic(n) + a(n)
      end do
      do n = 1, size(b)
        wave%harmonic(n) = wave%harmonic(n) - cmplx(0.0_wp, b(n), wp)
      end do
    end associate
    call sine_cosine(value_of(choice, 'angle'), sine, cosine)
    wave%harmonic(1) = wave%harmonic(1) + value_of(choice, 'amplitude')*cmplx(cosine, sine, wp)
  end function wave_of

end module waves
