! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a group of an HDF5 file contains.
module h5_list
  use errors, only: error_t
  use guard, only: end_guard
  use h5, only: h5_failed, h5_file_t
  use h5_trap, only: trap
  use hdf5, only: &
    H5_INDEX_CRT_ORDER_F, H5_INDEX_NAME_F, H5_ITER_INC_F, h5gclose_f, h5gget_create_plist_f, h5gget_info_f, &
    h5gopen_f, H5I_GROUP_F, h5iget_type_f, h5lget_name_by_idx_f, h5oclose_f, h5oopen_f, H5P_CRT_ORDER_TRACKED_F, &
    h5pclose_f, h5pget_link_creation_order_f, hid_t, hsize_t, size_t
  implicit none
  private

  public :: h5_children

contains

  !> The names of the objects in a group, in the order of their creation, and which are groups.
  subroutine h5_children(file, group, names, are_groups, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: group
    character(len=:), allocatable, intent(out) :: names(:)
    logical, allocatable, intent(out) :: are_groups(:)
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: parent, child, creation
    integer :: status, storage, count, order, i, kind, index_type, flags
    integer(size_t) :: length
    call trap(group, file%path, endless=.true.)
    call h5gopen_f(file%id, group, parent, status)
    if (status >= 0) call h5gget_info_f(parent, storage, count, order, status)
    if (status >= 0) call h5gget_create_plist_f(parent, creation, status)
    if (status >= 0) call h5pget_link_creation_order_f(creation, flags, status)
    if (status >= 0) call h5pclose_f(creation, status)
    call end_guard()
    if (h5_failed(status, 'list', group, file%path, error)) return
    allocate (character(len=128) :: names(count))
    allocate (are_groups(count))
    ! Asked for an order that a group does not keep, HDF5 1.10 frees memory that it never took.
    index_type = H5_INDEX_NAME_F
    if (iand(flags, H5P_CRT_ORDER_TRACKED_F) /= 0) index_type = H5_INDEX_CRT_ORDER_F
    do i = 1, count
      names(i) = ''
      call trap(group, file%path, endless=.true.)
      call h5lget_name_by_idx_f(parent, '.', index_type, H5_ITER_INC_F, int(i - 1, hsize_t), names(i), status, length)
      if (status >= 0) call h5oopen_f(parent, trim(names(i)), child, status)
      if (status >= 0) call h5iget_type_f(child, kind, status)
      call end_guard()
      if (h5_failed(status, 'list', group, file%path, error)) return
      are_groups(i) = kind == H5I_GROUP_F
      call h5oclose_f(child, status)
    end do
    call h5gclose_f(parent, status)
  end subroutine h5_children

end module h5_list
