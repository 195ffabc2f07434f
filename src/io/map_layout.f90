! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Creates the objects that a schema describes.
module map_layout
  use errors, only: error_t, fail
  use h5, only: h5_close_dataset, h5_create_dataset, h5_create_group, h5_dataset_t, h5_exists, h5_file_t, &
    h5_open_dataset, h5_storage_t, h5_write
  use h5_attributes, only: h5_attach_scale, h5_make_scale, h5_put_numbers, h5_put_text
  use kinds, only: int64, int8, real64
  use map_schema, only: name_length, schema_t, type_string, variable_t
  use slabs, only: final_chunk
  use status, only: exit_internal
  use text, only: to_text
  use value_types, only: bytes_of, to_bytes, type_int8
  implicit none
  private

  public :: create_objects, write_data, path_of, is_compressed

  !> Name with which netCDF marks a dimension without coordinates.
  character(len=*), parameter :: bare_dimension = 'This is a netCDF dimension but not a netCDF variable.'

  !> Datasets up to this number of values stay contiguous in the final file.
  integer(int64), parameter :: small = 4096

contains

  !> The absolute path of an object.
  pure function path_of(group, name) result(path)
    character(len=*), intent(in) :: group, name
    character(len=:), allocatable :: path
    path = '/'//name
    if (group /= '') path = '/'//group//path
  end function path_of

  !> Creates groups, dimensions, variables and attributes of a final file, or of a working file without its tiles.
  subroutine create_objects(file, schema, working, error)
    type(h5_file_t), intent(in) :: file
    type(schema_t), intent(in) :: schema
    logical, intent(in) :: working
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(schema%variables)
      associate (variable => schema%variables(i))
        if (working .and. variable%tiled) cycle
        if (variable%group /= '') call h5_create_group(file, '/'//variable%group, error)
        if (.not. allocated(error)) call create_variable(file, schema, variable, working, error)
        if (allocated(error)) return
      end associate
    end do
    do i = 1, size(schema%dimensions)
      call create_dimension(file, schema, i, error)
      if (allocated(error)) return
    end do
    do i = 1, size(schema%variables)
      if (working .and. schema%variables(i)%tiled) cycle
      call attach_dimensions(file, schema, schema%variables(i), error)
      if (allocated(error)) return
    end do
    call write_attributes(file, schema, error)
  end subroutine create_objects

  subroutine create_variable(file, schema, variable, working, error)
    type(h5_file_t), intent(in) :: file
    type(schema_t), intent(in) :: schema
    type(variable_t), intent(in) :: variable
    logical, intent(in) :: working
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    type(h5_storage_t) :: storage
    integer(int64) :: lengths(size(variable%dimensions))
    character(len=:), allocatable :: path
    path = path_of(variable%group, variable%name)
    lengths = schema%lengths_of(variable%dimensions)
    if (any(lengths < 0)) then
      call fail(error, exit_internal, 'variable '//path//' has a dimension that the schema lacks')
      return
    end if
    if (working) then
      storage%fixed = .true.
    else if (is_compressed(lengths)) then
      storage%chunk = final_chunk(lengths)
      storage%compressed = .true.
    end if
    call h5_create_dataset(file, path, variable%type, lengths, storage, dataset, error)
    if (.not. allocated(error)) call h5_close_dataset(dataset, error)
    if (allocated(error)) return
    call describe(file, path, variable, error)
  end subroutine create_variable

  !> Whether a variable has compressed chunks in the final file.
  pure logical function is_compressed(lengths)
    integer(int64), intent(in) :: lengths(:)
    is_compressed = product(lengths) > small
  end function is_compressed

  subroutine describe(file, path, variable, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    type(variable_t), intent(in) :: variable
    type(error_t), allocatable, intent(out) :: error
    if (allocated(variable%units)) call h5_put_text(file, path, 'units', variable%units, error)
    if (allocated(error)) return
    if (allocated(variable%long_name)) call h5_put_text(file, path, 'long_name', variable%long_name, error)
    if (allocated(error)) return
    if (.not. allocated(variable%flag_values)) return
    call h5_put_numbers(file, path, 'flag_values', variable%type, real(variable%flag_values, real64), error, list=.true.)
    if (allocated(error)) return
    call h5_put_text(file, path, 'flag_meanings', variable%flag_meanings, error)
  end subroutine describe

  !> Makes the coordinate variable the dimension's scale, or an empty dataset if there is none.
  subroutine create_dimension(file, schema, number, error)
    type(h5_file_t), intent(in) :: file
    type(schema_t), intent(in) :: schema
    integer, intent(in) :: number
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    character(len=:), allocatable :: path
    character(len=10) :: digits
    associate (dimension => schema%dimensions(number))
      path = path_of(home_of(schema, dimension%name), dimension%name)
      if (h5_exists(file, path)) then
        call h5_open_dataset(file, path, dataset, error)
        if (.not. allocated(error)) call h5_make_scale(dataset, dimension%name, error)
      else
        call h5_create_dataset(file, path, type_int8, [dimension%length], h5_storage_t(), dataset, error)
        write (digits, '(i10)') dimension%length
        if (.not. allocated(error)) call h5_make_scale(dataset, bare_dimension//digits, error)
      end if
    end associate
    if (allocated(error)) return
    call h5_close_dataset(dataset, error)
  end subroutine create_dimension

  !> A dimension lives in the only group that uses it, otherwise in the root.
  pure function home_of(schema, name) result(group)
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: group
    logical :: found
    integer :: i
    found = .false.
    group = ''
    do i = 1, size(schema%variables)
      associate (variable => schema%variables(i))
        if (.not. any(variable%dimensions == name)) cycle
        if (found .and. group /= variable%group) then
          group = ''
          return
        end if
        group = variable%group
        found = .true.
      end associate
    end do
  end function home_of

  subroutine attach_dimensions(file, schema, variable, error)
    type(h5_file_t), intent(in) :: file
    type(schema_t), intent(in) :: schema
    type(variable_t), intent(in) :: variable
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset, scale
    character(len=:), allocatable :: name
    integer :: k
    if (size(variable%dimensions) == 1) then
      if (variable%dimensions(1) == variable%name) return
    end if
    call h5_open_dataset(file, path_of(variable%group, variable%name), dataset, error)
    do k = 1, size(variable%dimensions)
      if (allocated(error)) return
      name = trim(variable%dimensions(k))
      call h5_open_dataset(file, path_of(home_of(schema, name), name), scale, error)
      if (.not. allocated(error)) call h5_attach_scale(dataset, scale, k, error)
      if (.not. allocated(error)) call h5_close_dataset(scale, error)
    end do
    if (.not. allocated(error)) call h5_close_dataset(dataset, error)
  end subroutine attach_dimensions

  subroutine write_attributes(file, schema, error)
    type(h5_file_t), intent(in) :: file
    type(schema_t), intent(in) :: schema
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(schema%attributes)
      associate (attribute => schema%attributes(i))
        if (attribute%group /= '') call h5_create_group(file, '/'//attribute%group, error)
        if (allocated(error)) return
        if (attribute%type == type_string) then
          call h5_put_text(file, '/'//attribute%group, attribute%name, attribute%text, error)
        else
          call h5_put_numbers(file, '/'//attribute%group, attribute%name, attribute%type, [attribute%number], error)
        end if
        if (allocated(error)) return
      end associate
    end do
  end subroutine write_attributes

  !> Writes the values that the schema gives for a variable, zeros if it gives none.
  subroutine write_data(file, schema, variable, error)
    type(h5_file_t), intent(in) :: file
    type(schema_t), intent(in) :: schema
    type(variable_t), intent(in) :: variable
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    integer(int8), allocatable :: bytes(:)
    integer(int64) :: count, given
    count = product(schema%lengths_of(variable%dimensions))
    given = count
    if (allocated(variable%data)) given = size(variable%data, kind=int64)
    if (given /= count) then
      call fail(error, exit_internal, 'variable '//variable%name//' has '//to_text(count)//' values, given are '// &
                to_text(given))
      return
    end if
    call h5_open_dataset(file, path_of(variable%group, variable%name), dataset, error)
    if (allocated(error)) return
    allocate (bytes(count*bytes_of(variable%type)), source=0_int8)
    if (allocated(variable%data)) call to_bytes(variable%type, variable%data, bytes)
    call h5_write(dataset, bytes, error)
    if (.not. allocated(error)) call h5_close_dataset(dataset, error)
  end subroutine write_data

end module map_layout
