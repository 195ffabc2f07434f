! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The start of an HDF5 file, without the library: the length that it states, and why the library does not open it.
module superblock
  use kinds, only: int64, int8
  use text, only: to_text
  implicit none
  private

  public :: is_hdf5, stated_bytes, why_not_opened

  !> Bytes of a superblock that are enough, and that there are in one of version 2 or 3 up to the address of the end of the file.
  integer, parameter, public :: superblock_bytes = 52, short_bytes = 36
  integer, parameter :: signature(8) = [-119, 72, 68, 70, 13, 10, 26, 10]

contains

  !> Whether the signature of HDF5 is where the format allows it: at the beginning, or behind 512, 1024, 2048 ... bytes. True for
  !> a file that cannot be read, whose reason HDF5 states.
  logical function is_hdf5(path)
    character(len=*), intent(in) :: path
    integer(int8) :: found(size(signature))
    integer(int64) :: at
    integer :: unit, status
    open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=status)
    is_hdf5 = status /= 0
    if (is_hdf5) return
    at = 0
    do while (.not. is_hdf5)
      read (unit, pos=at + 1, iostat=status) found
      if (status /= 0) exit
      is_hdf5 = all(found == signature)
      at = max(512_int64, 2*at)
    end do
    close (unit)
  end function is_hdf5

  !> The address of the end of the file (HDF5 File Format Specification 3.0, II.A) from its first bytes; -1 if these are no
  !> superblock that has it in 8 bytes.
  pure integer(int64) function stated_bytes(header)
    integer(int8), intent(in) :: header(:)
    integer :: at, size_at
    stated_bytes = -1
    if (size(header) < short_bytes) return
    if (any(header(:8) /= signature)) return
    select case (header(9))
    case (0)
      at = 41
      size_at = 14
    case (1)
      at = 45
      size_at = 14
    case (2, 3)
      at = 29
      size_at = 10
    case default
      return
    end select
    if (size(header) < at + 7 .or. header(size_at) /= 8) return
    stated_bytes = transfer(header(at:at + 7), stated_bytes)
  end function stated_bytes

  !> What hinders the library: the file cannot be read, is cut, or is damaged otherwise.
  function why_not_opened(path) result(text)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: text
    integer(int8) :: header(superblock_bytes)
    integer(int64) :: expected, found
    integer :: unit, status
    character(len=256) :: message
    open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=status, iomsg=message)
    if (status /= 0) then
      text = "'"//path//"' cannot be read: "//trim(message)
      return
    end if
    inquire (unit=unit, size=found)
    header = 0
    read (unit, iostat=status) header(:min(found, int(superblock_bytes, int64)))
    close (unit)
    expected = stated_bytes(header(:min(found, int(superblock_bytes, int64))))
    if (expected > found) then
      text = "'"//path//"' is cut: "//to_text(found)//' of '//to_text(expected)//' bytes are left'
    else if (found < short_bytes) then
      text = "'"//path//"' is cut within its first bytes: "//to_text(found)//' bytes are left'
    else if (locks_are_asked_for()) then
      text = "'"//path//"' is damaged or locked (HDF5 cannot open it)"
    else
      text = "'"//path//"' is damaged (HDF5 cannot open it)"
    end if
  end function why_not_opened

  !> The program itself turns the locks of HDF5 off.
  logical function locks_are_asked_for()
    character(len=8) :: value
    integer :: status
    call get_environment_variable('HDF5_USE_FILE_LOCKING', value, status=status)
    locks_are_asked_for = status == 0 .and. value /= 'FALSE' .and. value /= '0'
  end function locks_are_asked_for

end module superblock
