! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a misspelt word was meant to be.
module suggest
  implicit none
  private

  public :: nearest_word

contains

  !> The word of `words` closest to `word`, '' if none is within a third of its letters (at least two).
  pure function nearest_word(word, words) result(found)
    character(len=*), intent(in) :: word, words(:)
    character(len=:), allocatable :: found
    integer :: i, distance, best
    found = ''
    best = max(2, len_trim(word)/3) + 1
    do i = 1, size(words)
      distance = edit_distance(trim(word), trim(words(i)))
      if (distance >= best) cycle
      best = distance
      found = trim(words(i))
    end do
  end function nearest_word

  !> Levenshtein distance: fewest letters to insert, delete or replace.
  pure integer function edit_distance(first, second)
    character(len=*), intent(in) :: first, second
    integer :: row(0:len(second)), i, j, diagonal, above
    row = [(j, j=0, len(second))]
    do i = 1, len(first)
      diagonal = row(0)
      row(0) = i
      do j = 1, len(second)
        above = row(j)
        row(j) = min(above + 1, row(j - 1) + 1, diagonal + merge(0, 1, first(i:i) == second(j:j)))
        diagonal = above
      end do
    end do
    edit_distance = row(len(second))
  end function edit_distance

end module suggest
