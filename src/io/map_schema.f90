! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The description of a file: dimensions, variables and attributes. Groups are named without slashes
!> ('catalogue'); '' is the root. Texts are attributes: many readers stop at a dataset of texts.
module map_schema
  use angle_units, only: unit_of
  use kinds, only: int64, real64
  use value_types, only: bytes_of, type_float32, type_float64, type_int16, type_int32, type_int64, type_int8, &
    type_string
  implicit none
  private

  public :: type_int8, type_int16, type_int32, type_int64, type_float32, type_float64, type_string

  !> Version of the files that are written, and the oldest that is read (docs/file-format.md).
  integer, parameter, public :: format_version = 2, oldest_version = 1

  !> Longest name of a dimension.
  integer, parameter, public :: name_length = 64

  type, public :: dimension_t
    character(len=:), allocatable :: name
    integer(int64) :: length = 0
  end type dimension_t

  !> A variable named like its only dimension is that dimension's coordinate.
  type, public :: variable_t
    character(len=:), allocatable :: group
    character(len=:), allocatable :: name
    !> One of the type codes above.
    integer :: type = type_float64
    !> Names in C order; none = a scalar.
    character(len=name_length), allocatable :: dimensions(:)
    character(len=:), allocatable :: units
    character(len=:), allocatable :: long_name
    !> The codes of a coded variable and their names, separated by blanks.
    integer, allocatable :: flag_values(:)
    character(len=:), allocatable :: flag_meanings
    !> Written tile by tile; its dimensions are those of the grid.
    logical :: tiled = .false.
    !> Values in C order, zeros if not given.
    real(real64), allocatable :: data(:)
  end type variable_t

  !> A text, or numbers (`type_int64` or `type_float64`).
  type, public :: attribute_t
    character(len=:), allocatable :: group, name
    integer :: type = type_string
    character(len=:), allocatable :: text
    real(real64) :: number = 0
  end type attribute_t

  type, public :: schema_t
    type(dimension_t), allocatable :: dimensions(:)
    type(variable_t), allocatable :: variables(:)
    type(attribute_t), allocatable :: attributes(:)
    !> Positions are angles: lengths and speeds get the units of these.
    logical :: positions_are_angles = .false.
  contains
    procedure :: add_dimension
    procedure :: add_variable
    procedure, private :: add_text_attribute
    procedure, private :: add_integer_attribute
    procedure, private :: add_long_attribute
    procedure, private :: add_real_attribute
    generic :: add_attribute => add_text_attribute, add_integer_attribute, add_long_attribute, add_real_attribute
    procedure :: append
    procedure :: length_of
    procedure :: bytes
    procedure :: bytes_of_point
    procedure :: lengths_of
    procedure :: find_text_attribute
    procedure :: find_number
  end type schema_t

contains

  !> Adds a dimension.
  subroutine add_dimension(self, name, length)
    class(schema_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(in) :: length
    type(dimension_t) :: dimension
    call complete(self)
    dimension%name = name
    dimension%length = length
    call push_dimension(self%dimensions, dimension)
  end subroutine add_dimension

  !> Adds a variable. `dimensions`: names in C order. What is not given is absent from the file. `own_units`: the units are known,
  !> whatever positions are.
  subroutine add_variable(self, name, type, dimensions, units, long_name, flag_values, flag_meanings, &
                          tiled, data, group, own_units)
    class(schema_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: type
    character(len=*), intent(in) :: dimensions(:)
    character(len=*), intent(in), optional :: units, long_name, flag_meanings, group
    integer, intent(in), optional :: flag_values(:)
    logical, intent(in), optional :: tiled, own_units
    real(real64), intent(in), optional :: data(:)
    type(variable_t) :: variable
    call complete(self)
    variable%group = ''
    variable%name = name
    variable%type = type
    allocate (variable%dimensions(size(dimensions)))
    variable%dimensions = dimensions
    if (present(group)) variable%group = group
    if (present(units)) then
      variable%units = unit_of(units, self%positions_are_angles .and. .not. present(own_units))
    end if
    if (present(long_name)) variable%long_name = long_name
    if (present(flag_values)) variable%flag_values = flag_values
    if (present(flag_meanings)) variable%flag_meanings = flag_meanings
    if (present(tiled)) variable%tiled = tiled
    if (present(data)) variable%data = data
    call push_variable(self%variables, variable)
  end subroutine add_variable

  !> Adds an attribute of a group. A later one of the same name replaces an earlier one.
  subroutine add_text_attribute(self, group, name, text)
    class(schema_t), intent(inout) :: self
    character(len=*), intent(in) :: group, name, text
    type(attribute_t) :: attribute
    attribute%group = group
    attribute%name = name
    attribute%text = text
    call complete(self)
    call push_attribute(self%attributes, attribute)
  end subroutine add_text_attribute

  !> As `add_text_attribute`.
  subroutine add_integer_attribute(self, group, name, value)
    class(schema_t), intent(inout) :: self
    character(len=*), intent(in) :: group, name
    integer, intent(in) :: value
    call self%add_long_attribute(group, name, int(value, int64))
  end subroutine add_integer_attribute

  !> As `add_text_attribute`.
  subroutine add_long_attribute(self, group, name, value)
    class(schema_t), intent(inout) :: self
    character(len=*), intent(in) :: group, name
    integer(int64), intent(in) :: value
    type(attribute_t) :: attribute
    attribute%group = group
    attribute%name = name
    attribute%type = type_int64
    attribute%number = real(value, real64)
    call complete(self)
    call push_attribute(self%attributes, attribute)
  end subroutine add_long_attribute

  !> As `add_text_attribute`.
  subroutine add_real_attribute(self, group, name, value)
    class(schema_t), intent(inout) :: self
    character(len=*), intent(in) :: group, name
    real(real64), intent(in) :: value
    type(attribute_t) :: attribute
    attribute%group = group
    attribute%name = name
    attribute%type = type_float64
    attribute%number = value
    call complete(self)
    call push_attribute(self%attributes, attribute)
  end subroutine add_real_attribute

  !> Adds everything of another schema behind what is here.
  subroutine append(self, other)
    class(schema_t), intent(inout) :: self
    type(schema_t), intent(in) :: other
    integer :: i
    call complete(self)
    if (.not. allocated(other%dimensions)) return
    do i = 1, size(other%dimensions)
      call push_dimension(self%dimensions, other%dimensions(i))
    end do
    do i = 1, size(other%variables)
      call push_variable(self%variables, other%variables(i))
    end do
    do i = 1, size(other%attributes)
      call push_attribute(self%attributes, other%attributes(i))
    end do
  end subroutine append

  !> Bytes of the numbers that the variables hold; of tiled ones those of no tile.
  pure integer(int64) function bytes(self)
    class(schema_t), intent(in) :: self
    integer :: i
    bytes = 0
    do i = 1, size(self%variables)
      associate (variable => self%variables(i))
        if (allocated(variable%data)) bytes = bytes + size(variable%data, kind=int64)*bytes_of(variable%type)
      end associate
    end do
  end function bytes

  !> Bytes of one point of the variables that are written tile by tile.
  pure integer(int64) function bytes_of_point(self) result(bytes)
    class(schema_t), intent(in) :: self
    integer :: i
    bytes = 0
    do i = 1, size(self%variables)
      if (self%variables(i)%tiled) bytes = bytes + bytes_of(self%variables(i)%type)
    end do
  end function bytes_of_point

  !> The length of a dimension; -1 if there is none of this name.
  pure integer(int64) function length_of(self, name)
    class(schema_t), intent(in) :: self
    character(len=*), intent(in) :: name
    integer :: i
    length_of = -1
    do i = 1, size(self%dimensions)
      if (self%dimensions(i)%name == name) length_of = self%dimensions(i)%length
    end do
  end function length_of

  !> The lengths of several dimensions.
  pure function lengths_of(self, names) result(lengths)
    class(schema_t), intent(in) :: self
    character(len=*), intent(in) :: names(:)
    integer(int64) :: lengths(size(names))
    integer :: i
    do i = 1, size(names)
      lengths(i) = self%length_of(trim(names(i)))
    end do
  end function lengths_of

  !> The value of a text attribute; '' if there is none.
  pure function find_text_attribute(self, group, name) result(text)
    class(schema_t), intent(in) :: self
    character(len=*), intent(in) :: group, name
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    if (.not. allocated(self%attributes)) return
    do i = 1, size(self%attributes)
      associate (attribute => self%attributes(i))
        if (attribute%group == group .and. attribute%name == name .and. allocated(attribute%text)) text = attribute%text
      end associate
    end do
  end function find_text_attribute

  !> The value of a numeric attribute; 0 if there is none.
  pure real(real64) function find_number(self, group, name)
    class(schema_t), intent(in) :: self
    character(len=*), intent(in) :: group, name
    integer :: i
    find_number = 0
    if (.not. allocated(self%attributes)) return
    do i = 1, size(self%attributes)
      associate (attribute => self%attributes(i))
        if (attribute%group /= group .or. attribute%name /= name) cycle
        if (attribute%type /= type_string) find_number = attribute%number
      end associate
    end do
  end function find_number

  !> Gives the lists that are not there yet their length 0.
  subroutine complete(self)
    class(schema_t), intent(inout) :: self
    if (.not. allocated(self%dimensions)) allocate (self%dimensions(0))
    if (.not. allocated(self%variables)) allocate (self%variables(0))
    if (.not. allocated(self%attributes)) allocate (self%attributes(0))
  end subroutine complete

  ! gfortran 12 leaks array constructors of types with allocatable components; hence these three.

  subroutine push_dimension(list, item)
    type(dimension_t), allocatable, intent(inout) :: list(:)
    type(dimension_t), intent(in) :: item
    type(dimension_t), allocatable :: longer(:)
    allocate (longer(size(list) + 1))
    longer(:size(list)) = list
    longer(size(longer)) = item
    call move_alloc(longer, list)
  end subroutine push_dimension

  subroutine push_variable(list, item)
    type(variable_t), allocatable, intent(inout) :: list(:)
    type(variable_t), intent(in) :: item
    type(variable_t), allocatable :: longer(:)
    allocate (longer(size(list) + 1))
    longer(:size(list)) = list
    longer(size(longer)) = item
    call move_alloc(longer, list)
  end subroutine push_variable

  subroutine push_attribute(list, item)
    type(attribute_t), allocatable, intent(inout) :: list(:)
    type(attribute_t), intent(in) :: item
    type(attribute_t), allocatable :: longer(:)
    allocate (longer(size(list) + 1))
    longer(:size(list)) = list
    longer(size(longer)) = item
    call move_alloc(longer, list)
  end subroutine push_attribute

end module map_schema
