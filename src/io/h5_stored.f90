! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How a dataset is stored, and whether it can hold what it claims.
module h5_stored
  use errors, only: error_t, fail
  use guard, only: end_guard
  use h5, only: h5_dataset_t, h5_failed
  use h5_trap, only: trap
  use hdf5, only: h5dget_create_plist_f, h5dget_storage_size_f, h5pclose_f, h5pget_nfilters_f, hid_t, hsize_t
  use kinds, only: int64, real64
  use status, only: exit_io
  use text, only: to_text
  use value_types, only: bytes_of, type_string
  implicit none
  private

  public :: h5_check_stored, h5_count_filters

contains

  !> Code 74 if a dataset claims many more values than what is stored of it can hold: before memory is taken for them.
  subroutine h5_check_stored(dataset, error)
    type(h5_dataset_t), intent(in) :: dataset
    type(error_t), allocatable, intent(out) :: error
    !> Deflate makes no more than 1032 bytes out of one; a string is stored as a reference of 16 bytes.
    real(real64), parameter :: largest_ratio = 1100, reference = 16
    integer(hsize_t) :: stored
    real(real64) :: claimed
    integer :: status
    ! The Fortran interface reports nothing stored as an error.
    call trap(dataset%name, dataset%path, endless=.true.)
    call h5dget_storage_size_f(dataset%id, stored, status)
    call end_guard()
    if (status < 0) stored = 0
    claimed = product(real(dataset%lengths, real64))*merge(reference, real(bytes_of(dataset%type), real64), &
                                                           dataset%type == type_string)
    if (claimed > largest_ratio*stored) call fail(error, exit_io, ''''//dataset%name//''' of '''//dataset%path// &
      ''' is damaged: its values take '//to_text(claimed, 4)//' bytes, '//to_text(int(stored, int64))//' are stored')
  end subroutine h5_check_stored

  !> The number of filters of a dataset, 0 if its values lie in the file as they are. Code 74.
  subroutine h5_count_filters(dataset, count, error)
    type(h5_dataset_t), intent(in) :: dataset
    integer, intent(out) :: count
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: creation
    integer :: status, ignored
    count = 0
    call trap(dataset%name, dataset%path, endless=.true.)
    call h5dget_create_plist_f(dataset%id, creation, status)
    if (status >= 0) call h5pget_nfilters_f(creation, count, status)
    call end_guard()
    if (h5_failed(status, 'find the filters of', dataset%name, dataset%path, error)) return
    call h5pclose_f(creation, ignored)
  end subroutine h5_count_filters

end module h5_stored
