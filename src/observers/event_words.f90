! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Event words: as letters, and of a cycle in the one form that does not depend on where it was begun.
module event_words
  use kinds, only: int64
  use motion_state, only: append_word, tally_t
  implicit none
  private

  public :: canonical_word, word_text

  !> Letter of each symbol of module `motion_state`: impact at the upper and lower barrier, stick, chatter at the
  !> upper and lower barrier, word cut off, end of a drive period.
  character(len=*), parameter :: letters = 'RLSCD+.'

contains

  !> The word of a cycle from those of its drive periods: begun with the drive period from which the numbers of `periods` read
  !> as the largest, that is with the eventful one.
  pure integer(int64) function canonical_word(periods) result(word)
    integer(int64), intent(in) :: periods(:)
    type(tally_t) :: tally
    integer(int64) :: rest
    integer :: first, i, k, n
    n = size(periods)
    first = 0
    do i = 1, n - 1
      do k = 0, n - 1
        if (periods(1 + modulo(i + k, n)) /= periods(1 + modulo(first + k, n))) exit
      end do
      if (k == n) exit
      if (periods(1 + modulo(i + k, n)) > periods(1 + modulo(first + k, n))) first = i
    end do
    do k = 0, n - 1
      rest = periods(1 + modulo(first + k, n))
      do while (rest > 0)
        call append_word(tally, int(iand(rest, 7_int64)))
        rest = ishft(rest, -3)
      end do
    end do
    word = tally%word
  end function canonical_word

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
