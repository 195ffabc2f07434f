! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The numbers of a choice of laws as one list, items of lists included, each under its path: 'restoring.stiffness',
!> 'drive.cosine[2]', 'effect.dahl.stiffness'.
module parameter_list
  use kinds, only: wp
  use law_table, only: change_parameter, law_choice_t, parameter_row_t, rows_of, path_of, is_hidden
  use text, only: to_text
  implicit none
  private

  public :: list_parameters, put_values

  integer, parameter, public :: path_length = 64

  type, public :: parameter_t
    character(len=path_length) :: path = ''
    character(len=16) :: unit = '1'
    real(wp) :: value = 0, lower = 0, upper = 0
    logical :: lower_open = .false.
    !> Law in the choice, row in its parameters, and item of a list (0: not a list).
    integer :: law = 0, row = 0, item = 0
  end type parameter_t

contains

  !> Every number of `laws`, in the order of the law table. A barrier that is not there (at the largest number) is none, nor
  !> are the samples of a measured force.
  pure function list_parameters(laws) result(list)
    type(law_choice_t), intent(in) :: laws(:)
    type(parameter_t), allocatable :: list(:)
    type(parameter_row_t), allocatable :: rows(:)
    type(parameter_t) :: one
    integer :: i, j, k
    allocate (list(0))
    do i = 1, size(laws)
      rows = rows_of(laws(i))
      if (laws(i)%name == 'measured_force') cycle
      do j = 1, size(rows)
        if (is_hidden(rows(j))) cycle
        one = parameter_t(unit=rows(j)%unit, lower=rows(j)%range%lower, upper=rows(j)%range%upper, &
                          lower_open=rows(j)%range%lower_open, law=i, row=j)
        one%path = path_of(laws(i))//'.'//rows(j)%name
        do k = 1, size(laws(i)%parameters(j)%values)
          one%value = laws(i)%parameters(j)%values(k)
          if (abs(one%value) >= huge(one%value)) cycle
          if (rows(j)%list) then
            one%path = path_of(laws(i))//'.'//trim(rows(j)%name)//'['//to_text(k)//']'
            one%item = k
          end if
          list = [list, one]
        end do
      end do
    end do
  end function list_parameters

  !> Puts `values` into the parameters `chosen` of `laws`. Break-away friction that equals sliding friction moves with it,
  !> unless it is chosen too.
  pure subroutine put_values(laws, chosen, values)
    type(law_choice_t), intent(inout) :: laws(:)
    type(parameter_t), intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:)
    logical :: found
    integer :: i
    do i = 1, size(chosen)
      if (chosen(i)%item == 0) call change_parameter(laws, trim(chosen(i)%path), values(i), found)
    end do
    do i = 1, size(chosen)
      associate (one => chosen(i))
        laws(one%law)%parameters(one%row)%values(max(1, one%item)) = values(i)
      end associate
    end do
  end subroutine put_values

end module parameter_list
