! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Event words as letters.
module event_words
  use kinds, only: int64
  implicit none
  private

  public :: word_text

  !> Letter of each symbol of module `motion_state`: impact at the upper and lower barrier, stick, chatter at the
  !> upper and lower barrier, word cut off, end of a drive period.
  character(len=*), parameter :: letters = 'RLSCD+.'

contains

  !> A packed word as letters, first event first.
  pure function word_text(word) result(text)
    integer(int64), intent(in) :: word
    character(len=:), allocatable :: text
    integer(int64) :: rest
    integer :: symbol
    text = ''
    rest = word
    do while (rest > 0)
      symbol = int(iand(rest, 7_int64))
      if (symbol == 0) exit
      text = text//letters(symbol:symbol)
      rest = ishft(rest, -3)
    end do
  end function word_text

end module event_words
