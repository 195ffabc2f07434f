! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The tables [structure.NAME]: matrices or modes, written down or out of files, and the named points of the structure.
module structure_reader
  use case_source, only: case_source_t, description, enter_table, find, know, know_all_below, list_size, report
  use case_values, only: any_number, at_least, take_integer, take_real, take_reals, take_text
  use multibody, only: most_degrees
  use kinds, only: real64, wp
  use law_table, only: label_length, law_choice, law_choice_t, part_family, set_value
  use matrix_market, only: read_matrix_market
  use structure_block, only: is_symmetric, smallest_share
  use structure_data, only: joined, most_file_coordinates, point_name_length, structure_data_t
  use structure_reduction, only: coordinates_of, keep_modes
  use suggest, only: nearest_word
  use text, only: join, number_in, starts_with, to_text
  use toml_bindings, only: toml_array, toml_integer, toml_string
  implicit none
  private

  public :: read_structure

  character(len=*), parameter :: keys(12) = [character(len=14) :: 'law', 'file', 'mass', 'stiffness', 'damping', 'frequency', &
    'damping_ratios', 'damping_ratio', 'modes', 'x0', 'v0', 'point']

contains

  !> Appends the structure and its points, whose labels are 'NAME.POINT', to `choices`. `left_out` is the flexibility of its points
  !> by the modes that are not kept [m/N].
  subroutine read_structure(source, name, number, choices, left_out)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: name
    integer, intent(in) :: number
    type(law_choice_t), allocatable, intent(inout) :: choices(:)
    real(wp), allocatable, intent(out) :: left_out(:, :)
    type(structure_data_t) :: content
    character(len=:), allocatable :: path, law, problem
    integer :: problems, modes, i
    logical :: found
    allocate (left_out(0, 0))
    path = 'structure.'//name
    problems = size(source%problems)
    call enter_table(source, path, found)
    do i = 1, size(keys) - 1
      call know(source, path//'.'//trim(keys(i)))
    end do
    law = ''
    call take_text(source, path//'.law', law)
    if (law /= '' .and. law /= 'matrices' .and. law /= 'modes') call report(source, path//'.law', 'found "'//law// &
                                                                            '", allowed matrices, modes')
    if (find(source, path//'.file') > 0) then
      call read_file(source, path, content)
    else
      call read_numbers(source, path, content)
    end if
    if (size(source%problems) == problems) call check_content(source, path, law, content)
    if (size(source%problems) == problems) call read_points(source, path, content)
    modes = 0
    call take_integer(source, path//'.modes', 1, modes, highest=most_file_coordinates)
    if (size(source%problems) > problems) then
      call know_all_below(source, path)
      return
    end if
    if (modes > 0) then
      call keep_modes(modes, content, problem)
      if (allocated(problem)) call report(source, path//'.modes', problem)
    end if
    if (coordinates_of(content) > most_degrees) call report(source, path, 'found '//to_text(coordinates_of(content))// &
      ' coordinates, allowed at most '//to_text(most_degrees)//': modes = '//to_text(most_degrees)//' or fewer keeps the lowest')
    if (size(source%problems) > problems) return
    call add_choices(source, path, name, number, content, choices)
    deallocate (left_out)
    allocate (left_out(size(content%point_names), size(content%point_names)), source=0.0_wp)
    if (allocated(content%left_out)) left_out = real(content%left_out, wp)
  end subroutine read_structure

  !> A file relative to the folder of the case.
  pure function beside(source, file) result(path)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: file
    character(len=:), allocatable :: path
    path = file
    if (index(path, '/') /= 1) path = source%name(:index(source%name, '/', back=.true.))//path
  end function beside

  !> file = "NAME.h5"
  subroutine read_file(source, path, content)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(structure_data_t), intent(out) :: content
    character(len=:), allocatable :: file, problem
    character(len=14), parameter :: others(5) = [character(len=14) :: 'mass', 'stiffness', 'damping', 'frequency', &
      'damping_ratios']
    logical :: missing
    integer :: i
    file = ''
    call take_text(source, path//'.file', file)
    if (len(file) == 0) return
    do i = 1, size(others)
      if (find(source, path//'.'//trim(others(i))) > 0) call report(source, path//'.'//trim(others(i)), &
        'found beside a file, allowed one or the other')
    end do
    if (.not. associated(source%structure_file)) then
      call report(source, path//'.file', 'found an HDF5 file, which the library does not read: allowed Matrix Market files in '// &
                  'mass, stiffness and damping, or the resolved case that the program writes')
      return
    end if
    call source%structure_file(beside(source, file), content, problem, missing)
    if (allocated(problem)) call report(source, path//'.file', problem, file_missing=missing)
  end subroutine read_file

  !> Lists, nested lists, or names of Matrix Market files.
  subroutine read_numbers(source, path, content)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(structure_data_t), intent(out) :: content
    real(wp), allocatable :: values(:)
    integer :: i
    allocate (content%point_names(0))
    if (find(source, path//'.frequency') > 0) then
      call take_reals(source, path//'.frequency', at_least(0.0_wp, 'rad/s'), values)
      content%frequency = real(values, real64)
      if (find(source, path//'.damping_ratios') > 0) then
        values = [real(wp) ::]
        call take_reals(source, path//'.damping_ratios', at_least(0.0_wp, '1'), values)
        content%damping_ratio = real(values, real64)
      end if
      do i = 3, 4
        if (find(source, path//'.'//trim(keys(i))) > 0) call report(source, path//'.'//trim(keys(i)), &
          'found beside frequency, allowed matrices or modes')
      end do
    else
      if (find(source, path//'.mass') == 0) call report(source, path//'.mass', 'missing, allowed with stiffness, or file, or '// &
                                                        'frequency')
      if (find(source, path//'.stiffness') == 0) call report(source, path//'.stiffness', 'missing, allowed with mass, or '// &
                                                             'file, or frequency')
      call take_matrix(source, path//'.mass', content%mass)
      call take_matrix(source, path//'.stiffness', content%stiffness)
    end if
    call take_matrix(source, path//'.damping', content%damping)
    allocate (content%rows(0, coordinates_of(content)))
  end subroutine read_numbers

  subroutine take_matrix(source, key, matrix)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: key
    real(real64), allocatable, intent(inout) :: matrix(:, :)
    character(len=:), allocatable :: problem
    real(wp), allocatable :: values(:), row(:)
    integer :: at, n, i, problems
    logical :: missing
    at = find(source, key)
    if (at == 0) return
    problems = size(source%problems)
    if (source%entries(at)%entry%kind == toml_string) then
      call read_matrix_market(beside(source, source%entries(at)%entry%string), matrix, problem, missing)
      if (allocated(problem)) call report(source, key, problem, file_missing=missing)
      return
    end if
    n = list_size(source, key)
    allocate (values(0), row(0))
    if (n > 0) at = find(source, key//'[1]')
    if (n > 0 .and. source%entries(at)%entry%kind == toml_array) then
      do i = 1, n
        call take_reals(source, key//'['//to_text(i)//']', any_number('1'), row)
        if (size(row) /= n) call report(source, key//'['//to_text(i)//']', 'found '//to_text(size(row))// &
          ' numbers, allowed '//to_text(n)//': as many rows as columns')
        values = [values, row]
      end do
    else
      call take_reals(source, key, any_number('1'), values)
      n = nint(sqrt(real(size(values), wp)))
    end if
    if (size(source%problems) > problems) return
    if (size(values) /= n*n) then
      call report(source, key, 'found '//to_text(size(values))//' numbers, allowed as many rows as columns, row by row')
    else
      matrix = real(transpose(reshape(values, [n, n])), real64)
    end if
  end subroutine take_matrix

  !> Matrices of one size, symmetric, with a mass matrix that can be inverted.
  subroutine check_content(source, path, law, content)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path, law
    type(structure_data_t), intent(in) :: content
    character(len=:), allocatable :: at
    integer :: n
    n = coordinates_of(content)
    at = path
    if (find(source, path//'.file') > 0) at = path//'.file'
    if (law == 'modes' .neqv. (allocated(content%frequency) .and. law /= '')) call report(source, path//'.law', 'found "'// &
      law//'", allowed what the numbers are: '//trim(merge('modes   ', 'matrices', allocated(content%frequency))))
    if (allocated(content%damping_ratio)) then
      if (size(content%damping_ratio) /= n) call report(source, path//'.damping_ratios', 'found '// &
        to_text(size(content%damping_ratio))//' numbers, allowed one for each of the '//to_text(n)//' frequencies')
      if (any(content%damping_ratio < 0)) call report(source, at, 'found a damping ratio below zero, allowed at least 0')
    end if
    if (allocated(content%damping)) call check_size(content%damping, 'damping')
    if (allocated(content%frequency)) then
      if (any(content%frequency < 0)) call report(source, at, 'found a frequency below zero, allowed at least 0')
      return
    end if
    call check_size(content%stiffness, 'stiffness')
    if (.not. is_symmetric(real(content%mass, wp))) then
      call report(source, key_of('mass'), 'found a mass matrix that is not symmetric, allowed M = M''')
    else if (.not. smallest_share(real(content%mass, wp)) > 1e-14_wp) then
      call report(source, key_of('mass'), 'found a singular or indefinite mass matrix, allowed a positive definite one: '// &
                  'coordinates without mass are to be condensed (separatrix-structure --reduce)')
    end if
    if (.not. is_symmetric(real(content%stiffness, wp))) call report(source, key_of('stiffness'), &
      'found a stiffness matrix that is not symmetric, allowed K = K''')

  contains

    function key_of(key)
      character(len=*), intent(in) :: key
      character(len=:), allocatable :: key_of
      key_of = path//'.'//key
      if (at /= path) key_of = at
    end function key_of

    subroutine check_size(matrix, key)
      real(real64), intent(in) :: matrix(:, :)
      character(len=*), intent(in) :: key
      if (size(matrix, 1) /= n) call report(source, key_of(key), 'found a '//key//' matrix of '//to_text(size(matrix, 1))// &
        ' rows, allowed '//to_text(n)//' like the others')
    end subroutine check_size

  end subroutine check_content

  !> point.NAME = [row], the number of a coordinate, or the name of a point of the file.
  subroutine read_points(source, path, content)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(structure_data_t), intent(inout) :: content
    character(len=:), allocatable :: prefix, name, key
    real(wp), allocatable :: row(:)
    logical :: found
    integer :: i, n, named
    prefix = path//'.point.'
    n = coordinates_of(content)
    call enter_table(source, path//'.point', found)
    do i = 1, size(source%entries)
      key = source%entries(i)%entry%path
      if (.not. starts_with(key, prefix)) cycle
      name = key(len(prefix) + 1:)
      if (scan(name, '.[') > 0) cycle
      call know(source, key)
      associate (entry => source%entries(i)%entry)
        row = [real(wp) ::]
        select case (entry%kind)
        case (toml_integer)
          if (entry%integer < 1 .or. entry%integer > n) then
            call report(source, key, 'found '//to_text(entry%integer)//', allowed a coordinate from 1 to '//to_text(n))
            cycle
          end if
          row = [(0.0_wp, named=1, n)]
          row(entry%integer) = 1
        case (toml_string)
          named = number_in(content%point_names, entry%string)
          if (named == 0) then
            call report(source, key, 'found "'//entry%string//'"'//hint(entry%string, content%point_names)// &
                        ', allowed a point of the file: '//join(content%point_names, ', '))
            cycle
          end if
          row = real(content%rows(named, :), wp)
        case (toml_array)
          call take_reals(source, key, any_number('1'), row)
          if (size(row) /= n) then
            call report(source, key, 'found '//to_text(size(row))//' numbers, allowed one for each of the '//to_text(n)// &
                        ' coordinates')
            cycle
          end if
        case default
          call report(source, key, 'found '//description(entry)//', allowed the displacement of the point for one of each '// &
                      'coordinate, the number of a coordinate, or the name of a point of the file')
          cycle
        end select
      end associate
      if (.not. allocated(content%rows)) allocate (content%rows(0, n))
      content%rows = transpose(reshape([transpose(content%rows), real(row, real64)], &
                                       [n, size(content%point_names) + 1]))
      content%point_names = [character(len=point_name_length) :: content%point_names, name]
    end do
    call check_points(source, path, content)
  end subroutine read_points

  !> Points need distinct names, and a coordinate that moves them.
  subroutine check_points(source, path, content)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(structure_data_t), intent(in) :: content
    integer :: i
    do i = 1, size(content%point_names)
      associate (name => content%point_names(i))
        if (verify(trim(name), 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-') > 0 .or. &
            verify(trim(name), '0123456789') == 0) then
          call report(source, path//'.point', 'found the name "'//trim(name)//'", allowed letters, digits, _ and -, with a letter')
        else if (any(content%point_names(:i - 1) == name)) then
          call report(source, path//'.point.'//trim(name), 'found a point of the file again, allowed another name')
        else if (.not. any(abs(content%rows(i, :)) > 0)) then
          call report(source, path//'.point.'//trim(name), 'found a point that no coordinate moves, allowed one that moves')
        end if
      end associate
    end do
  end subroutine check_points

  pure function hint(word, names) result(text)
    character(len=*), intent(in) :: word
    character(len=*), intent(in) :: names(:)
    character(len=:), allocatable :: text, meant
    meant = nearest_word(word, names)
    text = ''
    if (len(meant) > 0) text = ' (did you mean "'//meant//'"?)'
  end function hint

  subroutine add_choices(source, path, name, number, content, choices)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path, name
    integer, intent(in) :: number
    type(structure_data_t), intent(in) :: content
    type(law_choice_t), allocatable, intent(inout) :: choices(:)
    type(law_choice_t) :: choice
    real(wp) :: ratio
    integer :: i
    if (allocated(content%frequency)) then
      choice = law_choice(part_family, 'structure:modes')
      call set_value(choice, 'frequency', real(content%frequency, wp))
      if (allocated(content%damping_ratio)) call set_value(choice, 'damping_ratios', real(content%damping_ratio, wp))
    else
      choice = law_choice(part_family, 'structure:matrices')
      call set_value(choice, 'mass', real(joined(content%mass), wp))
      call set_value(choice, 'stiffness', real(joined(content%stiffness), wp))
    end if
    choice%label = name
    if (allocated(content%damping)) call set_value(choice, 'damping', real(joined(content%damping), wp))
    ratio = -1
    call take_real(source, path//'.damping_ratio', at_least(-1.0_wp, '1'), ratio)
    call set_value(choice, 'damping_ratio', [ratio])
    call take_start('x0')
    call take_start('v0')
    choices = [choices, choice]
    do i = 1, size(content%point_names)
      choice = law_choice(part_family, 'point:row')
      choice%label = name//'.'//content%point_names(i)
      call set_value(choice, 'structure', [real(number, wp)])
      call set_value(choice, 'row', real(content%rows(i, :), wp))
      choices = [choices, choice]
    end do
    if (len(name) + 1 + maxval([0, len_trim(content%point_names)]) > label_length) call report(source, path, &
      'found a name that is too long with that of its points, allowed up to '//to_text(label_length)//' letters')

  contains

    subroutine take_start(key)
      character(len=*), intent(in) :: key
      real(wp), allocatable :: values(:)
      integer :: k
      values = [(0.0_wp, k=1, coordinates_of(content))]
      call take_reals(source, path//'.'//key, any_number('1'), values)
      if (size(values) /= coordinates_of(content)) call report(source, path//'.'//key, 'found '//to_text(size(values))// &
        ' numbers, allowed one for each of the '//to_text(coordinates_of(content))//' coordinates')
      call set_value(choice, key, values)
    end subroutine take_start

  end subroutine add_choices

end module structure_reader
