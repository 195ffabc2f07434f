! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> An HDF5 file that is open for reading: what is in its groups, and its attributes.
module open_file
  use errors, only: error_t, fail
  use guard, only: end_guard
  use h5, only: h5_close, h5_exists, h5_file_t
  use h5_attributes, only: h5_get_numbers, h5_get_text, h5_has_attribute
  use h5_list, only: h5_children
  use h5_trap, only: trap
  use kinds, only: real64
  use status, only: exit_io
  implicit none
  private

  type, public :: open_file_t
    character(len=:), allocatable :: path
    type(h5_file_t) :: file
  contains
    procedure :: children
    procedure :: has
    procedure :: has_attribute
    procedure :: text_attribute
    procedure :: number_attribute
    procedure :: close => close_file
  end type open_file_t

contains

  !> The names in a group, and which are groups.
  subroutine children(self, group, names, are_groups, error)
    class(open_file_t), intent(in) :: self
    character(len=*), intent(in) :: group
    character(len=:), allocatable, intent(out) :: names(:)
    logical, allocatable, intent(out) :: are_groups(:)
    type(error_t), allocatable, intent(out) :: error
    call h5_children(self%file, group, names, are_groups, error)
  end subroutine children

  !> Whether there is an object of this path ('/regime', '/catalogue/x').
  logical function has(self, path)
    class(open_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    has = h5_exists(self%file, path)
  end function has

  !> Whether an object ('/', '/provenance', '/regime') has an attribute.
  logical function has_attribute(self, object, name)
    class(open_file_t), intent(in) :: self
    character(len=*), intent(in) :: object, name
    has_attribute = h5_has_attribute(self%file, object, name)
  end function has_attribute

  !> The value of a text attribute.
  subroutine text_attribute(self, object, name, text, error)
    class(open_file_t), intent(in) :: self
    character(len=*), intent(in) :: object, name
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    call h5_get_text(self%file, object, name, text, error)
  end subroutine text_attribute

  !> The first value of a numeric attribute.
  subroutine number_attribute(self, object, name, value, error)
    class(open_file_t), intent(in) :: self
    character(len=*), intent(in) :: object, name
    real(real64), intent(out) :: value
    type(error_t), allocatable, intent(out) :: error
    real(real64), allocatable :: values(:)
    value = 0
    call h5_get_numbers(self%file, object, name, values, error)
    if (allocated(error)) return
    if (size(values) /= 1) then
      call fail(error, exit_io, 'attribute '''//name//''' of '''//object//''' in '''//self%path//''' is not one number')
      return
    end if
    value = values(1)
  end subroutine number_attribute

  !> Closes the file.
  subroutine close_file(self, error)
    class(open_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    call trap('its end', self%path, endless=.true.)
    call h5_close(self%file, error)
    call end_guard()
  end subroutine close_file

end module open_file
