! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The names in the text of an expression.
module expression_names
  implicit none
  private

  public :: has_name

  !> The characters of a name; `letters` begin one.
  character(len=*), parameter, public :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ', &
    name_letters = letters//'0123456789_.'

contains

  !> Whether a text has a name, not as a part of another one.
  pure logical function has_name(text, name)
    character(len=*), intent(in) :: text, name
    integer :: at, length
    has_name = .false.
    at = 1
    do while (at <= len(text))
      length = scan(text(at:), name_letters) - 1
      if (length < 0) return
      at = at + length
      length = verify(text(at:), name_letters) - 1
      if (length < 0) length = len(text) - at + 1
      has_name = text(at:at + length - 1) == name
      if (has_name) return
      at = at + length
    end do
  end function has_name

end module expression_names
