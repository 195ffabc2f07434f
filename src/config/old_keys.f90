! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Keys of case files that once had another name: older case files, and the cases in older results, can still be read.
module old_keys
  implicit none
  private

  public :: current_key

  type :: renamed_t
    character(len=44) :: old, current
    !> The name of a table: keys below it have it, too. Of a key, only the elements of its list have it.
    logical :: is_table = .false.
  end type renamed_t

  !> A table comes before its keys.
  type(renamed_t), parameter :: renamed(*) = [ &
    renamed_t('body.blow', 'body.impulse'), &
    renamed_t('body.blow_time', 'body.impulse_time'), &
    renamed_t('effect.friction_place_curve', 'effect.friction_position_curve', is_table=.true.), &
    renamed_t('effect.friction_position_curve.place', 'effect.friction_position_curve.position'), &
    renamed_t('effect.force_curve.place', 'effect.force_curve.position'), &
    renamed_t('effect.spring_curve.stretch', 'effect.spring_curve.extension')]

contains

  !> The current name of a key, or of one below it. `of_table`: it is the key of a table; a body may have the name of a key.
  pure function current_key(key, of_table) result(current)
    character(len=*), intent(in) :: key
    logical, intent(in), optional :: of_table
    character(len=:), allocatable :: current
    logical :: tables
    integer :: i, last
    tables = .false.
    if (present(of_table)) tables = of_table
    current = key
    do i = 1, size(renamed)
      last = len_trim(renamed(i)%old)
      if (index(current, renamed(i)%old(:last)) /= 1) cycle
      if (len(current) > last) then
        if (current(last + 1:last + 1) /= '[' .and. .not. (renamed(i)%is_table .and. current(last + 1:last + 1) == '.')) cycle
      else if (tables .and. .not. renamed(i)%is_table) then
        cycle
      end if
      current = trim(renamed(i)%current)//current(last + 1:)
    end do
  end function current_key

end module old_keys
