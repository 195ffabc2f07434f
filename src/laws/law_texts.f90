! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What choices of laws hold beside numbers, as one text, for a library of another precision.
module law_texts
  use law_row, only: any_value
  use law_table, only: law_choice_t, law_text_t, own_law, parameter_row_t, parameter_value_t
  implicit none
  private

  public :: is_own, pack_texts, unpack_texts

  !> Ends of a field and of a law: no text of a case has them.
  character(len=1), parameter :: field = achar(1), law_end = achar(2)

contains

  !> Whether a law has expressions: one by expressions, or of the catalogue with a part by expressions.
  pure elemental logical function is_own(choice)
    type(law_choice_t), intent(in) :: choice
    is_own = choice%name == own_law .or. allocated(choice%texts)
  end function is_own

  !> Labels, expressions, and names of the parameters of expressions.
  pure function pack_texts(choices) result(text)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=:), allocatable :: text
    integer :: i, k
    text = ''
    do i = 1, size(choices)
      if (allocated(choices(i)%texts)) then
        text = text//trim(choices(i)%label)//field
        do k = 1, size(choices(i)%texts)
          text = text//trim(choices(i)%texts(k)%key)//field//choices(i)%texts(k)%text//field
        end do
        text = text//field
        do k = 1, size(choices(i)%own)
          text = text//trim(choices(i)%own(k)%name)//field
        end do
      else if (len_trim(choices(i)%label) > 0) then
        text = text//trim(choices(i)%label)//field
      end if
      text = text//law_end
    end do
  end function pack_texts

  !> Puts them into choices whose families and names are there; parameters of expressions are then zero.
  pure subroutine unpack_texts(text, choices)
    character(len=*), intent(in) :: text
    type(law_choice_t), intent(inout) :: choices(:)
    type(law_text_t) :: new
    type(parameter_row_t) :: row
    type(parameter_value_t) :: zero
    character(len=:), allocatable :: word
    integer :: i, at
    at = 1
    zero%values = [0]
    do i = 1, size(choices)
      if (at > len(text)) return
      if (text(at:at) /= law_end) then
        call take(text, at, word)
        choices(i)%label = word
      end if
      if (text(at:at) /= law_end) then
        allocate (choices(i)%texts(0), choices(i)%own(0))
        do
          call take(text, at, word)
          if (len(word) == 0) exit
          new%key = word
          call take(text, at, new%text)
          choices(i)%texts = [choices(i)%texts, new]
        end do
        do while (text(at:at) /= law_end)
          call take(text, at, word)
          row = parameter_row_t(choices(i)%family, choices(i)%name, word, '1', any_value, '')
          choices(i)%own = [choices(i)%own, row]
          choices(i)%parameters = [choices(i)%parameters, zero]
        end do
      end if
      at = at + 1
    end do
  end subroutine unpack_texts

  !> The next field.
  pure subroutine take(text, at, word)
    character(len=*), intent(in) :: text
    integer, intent(inout) :: at
    character(len=:), allocatable, intent(out) :: word
    integer :: length
    length = index(text(at:), field) - 1
    word = text(at:at + length - 1)
    at = at + length + 1
  end subroutine take

end module law_texts
