! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Eigenvalues of an equilibrium in messages and in lines of JSON.
module eigenvalue_text
  use journal, only: json_number
  use kinds, only: wp
  use text, only: to_text
  implicit none
  private

  public :: values_json, values_text

contains

  pure function values_text(values) result(text)
    complex(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(values)
      associate (value => values(k))
        if (k > 1) text = text//', '
        text = text//to_text(real(value), 6)
        if (abs(aimag(value)) > 0) text = text//merge('+', '-', aimag(value) > 0)//to_text(abs(aimag(value)), 9)//'i'
      end associate
    end do
    text = text//' 1/s'
    if (size(values) == 0) text = 'none: everything is held'
  end function values_text

  pure function values_json(values) result(text)
    complex(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    integer :: k
    text = '['
    do k = 1, size(values)
      if (k > 1) text = text//', '
      text = text//json_number(real(values(k)))//', '//json_number(aimag(values(k)))
    end do
    text = text//']'
  end function values_json

end module eigenvalue_text
