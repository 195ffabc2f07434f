! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a working file belongs to a case.
module map_compare
  use errors, only: error_t, fail
  use h5, only: h5_close, h5_close_dataset, h5_dataset_t, h5_exists, h5_file_t, h5_open, h5_open_dataset, h5_read
  use h5_attributes, only: h5_get_text, h5_has_attribute
  use kinds, only: int64, int8, real64
  use map_layout, only: path_of
  use map_schema, only: schema_t, variable_t
  use status, only: exit_other_case
  use value_types, only: from_bytes
  implicit none
  private

  public :: check_layout

contains

  !> Code 76 if the working file `path` has not the variables of the schema (the tiled ones are compared when it is opened), another
  !> tile shape, or another attribute `case_identity` in the group `provenance`.
  subroutine check_layout(path, schema, tile_shape, error)
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    integer(int64), intent(in) :: tile_shape(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(h5_file_t) :: file
    character(len=:), allocatable :: identity
    logical :: equal
    integer :: i
    call h5_open(path, file, error)
    if (allocated(error)) return
    identity = ''
    if (h5_exists(file, '/provenance')) then
      if (h5_has_attribute(file, '/provenance', 'case_identity')) then
        call h5_get_text(file, '/provenance', 'case_identity', identity, error)
      end if
    end if
    if (.not. allocated(error)) then
      if (identity /= schema%find_text_attribute('provenance', 'case_identity')) then
        call fail(error, exit_other_case, ''''//path//''' belongs to another case')
      end if
    end if
    do i = 1, size(schema%variables)
      if (allocated(error)) exit
      if (schema%variables(i)%tiled) cycle
      call compare(file, schema, schema%variables(i), tile_shape, equal, error)
      if (.not. equal .and. .not. allocated(error)) then
        call fail(error, exit_other_case, ''''//path//''' has another layout ('//schema%variables(i)%name//')')
      end if
    end do
    call h5_close(file, ignored)
  end subroutine check_layout

  !> Whether the file has the variable with its type and lengths; of `/tiles/tile_shape` also its values.
  subroutine compare(file, schema, variable, tile_shape, equal, error)
    type(h5_file_t), intent(in) :: file
    type(schema_t), intent(in) :: schema
    type(variable_t), intent(in) :: variable
    integer(int64), intent(in) :: tile_shape(:)
    logical, intent(out) :: equal
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    integer(int8) :: bytes(8*size(tile_shape))
    real(real64) :: found(size(tile_shape))
    equal = h5_exists(file, path_of(variable%group, variable%name))
    if (.not. equal) return
    call h5_open_dataset(file, path_of(variable%group, variable%name), dataset, error)
    if (allocated(error)) return
    equal = dataset%type == variable%type
    equal = equal .and. size(dataset%lengths) == size(variable%dimensions)
    if (equal) equal = all(dataset%lengths == schema%lengths_of(variable%dimensions))
    if (equal .and. variable%group == 'tiles' .and. variable%name == 'tile_shape') then
      call h5_read(dataset, bytes, error)
      if (allocated(error)) return
      call from_bytes(dataset%type, bytes, found)
      equal = all(nint(found, int64) == tile_shape)
    end if
    call h5_close_dataset(dataset, error)
  end subroutine compare

end module map_compare
