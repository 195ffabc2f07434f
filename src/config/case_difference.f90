! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> In which keys two resolved cases differ.
module case_difference
  implicit none
  private

  public :: case_differences

  character(len=1), parameter :: newline = new_line('a')
  !> Longest value that is shown.
  integer, parameter :: longest = 40

contains

  !> 'contact.restitution: 0.5, now 0.6; title: absent, now "New"' for the texts of `echo_case`; '' if they agree.
  pure function case_differences(before, now) result(words)
    character(len=*), intent(in) :: before, now
    character(len=:), allocatable :: words
    words = ''
    call compare(before, now, .false., words)
    call compare(now, before, .true., words)
  end function case_differences

  !> Adds the keys of `text` whose values differ in `other`. `reverse`: `other` is the older; only what it lacks is added.
  pure subroutine compare(text, other, reverse, words)
    character(len=*), intent(in) :: text, other
    logical, intent(in) :: reverse
    character(len=:), allocatable, intent(inout) :: words
    character(len=:), allocatable :: key, value, found
    integer :: position, axis
    position = 1
    axis = 0
    key = ''
    block
      character(len=:), allocatable :: section
      section = ''
      do
        call next_entry(text, position, section, axis, key, value)
        if (key == '') exit
        found = value_of(other, key)
        if (found == value .or. (reverse .and. found /= 'absent')) cycle
        if (words /= '') words = words//'; '
        if (reverse) then
          words = words//key//': absent, now '//short(value)
        else
          words = words//key//': '//short(value)//', now '//short(found)
        end if
      end do
    end block
  end subroutine compare

  pure function value_of(text, key) result(value)
    character(len=*), intent(in) :: text, key
    character(len=:), allocatable :: value, name, section
    integer :: position, axis
    position = 1
    axis = 0
    section = ''
    do
      call next_entry(text, position, section, axis, name, value)
      if (name == key) return
      if (name == '') exit
    end do
    value = 'absent'
  end function value_of

  !> The next `key = value` from `position` on; '' at the end. Axes count from 1: axis[1].count.
  pure subroutine next_entry(text, position, section, axis, key, value)
    character(len=*), intent(in) :: text
    integer, intent(inout) :: position, axis
    character(len=:), allocatable, intent(inout) :: section
    character(len=:), allocatable, intent(out) :: key, value
    character(len=12) :: number
    integer :: length, equals
    key = ''
    value = ''
    do while (position <= len(text))
      length = index(text(position:)//newline, newline) - 1
      associate (line => text(position:position + length - 1))
        position = position + length + 1
        equals = index(line, ' = ')
        if (index(line, '[[axis]]') == 1) then
          axis = axis + 1
          write (number, '(i0)') axis
          section = 'axis['//trim(number)//'].'
        else if (index(line, '[') == 1) then
          section = line(2:length - 1)//'.'
        else if (index(line, '#') /= 1 .and. equals > 1) then
          key = section//line(:equals - 1)
          value = line(equals + 3:)
          return
        end if
      end associate
    end do
  end subroutine next_entry

  pure function short(value) result(words)
    character(len=*), intent(in) :: value
    character(len=:), allocatable :: words
    words = value
    if (len(value) > longest) words = value(:longest - 3)//'...'
  end function short

end module case_difference
