! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Reference points of a machine between which joints act: bodies, then named points of structures. Each has a row: its
!> displacement for one of each coordinate.
module reference_points
  use errors, only: error_t, fail
  use multibody, only: multibody_t, most_degrees
  use kinds, only: real64, wp
  use law_table, only: law_choice_t, list_of, part_kind, part_law, path_of, value_of
  use status, only: exit_bad_case
  use structure_block, only: add_structure, is_symmetric, make_coordinate, modal_damping, smallest_share, start_shapes
  use text, only: to_text
  implicit none
  private

  public :: add_structures, body_name, is_reference_point, name_coordinates, number, reference_point_of, row_of, watched_body

  !> A mass matrix with a smaller share of the smallest eigenvalue in the largest is singular.
  real(wp), parameter :: singular_share = 1e-14_wp

contains

  !> Name of the body or point that the start and the results refer to; '' if there is none.
  pure function watched_body(choices) result(name)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=:), allocatable :: name
    integer :: i
    name = ''
    do i = 1, size(choices)
      if (choices(i)%name == 'body:watched' .or. choices(i)%name == 'point:watched') name = trim(choices(i)%label)
    end do
  end function watched_body

  !> Reference points that are coordinates of their own: bodies, the watched one, and those whose motion is given; 0 for others. A
  !> reference point has one given motion at most, and not the watched one.
  pure subroutine name_coordinates(choices, machine, rows, coordinate, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(inout) :: machine
    real(wp), intent(inout) :: rows(:, :)
    integer, allocatable, intent(out) :: coordinate(:)
    type(error_t), allocatable, intent(out) :: error
    logical :: taken(machine%n)
    integer :: i, k, watched
    allocate (coordinate(size(rows, 2)), source=0)
    taken = .false.
    k = 0
    watched = 0
    do i = 1, size(choices)
      if (.not. is_reference_point(choices(i))) cycle
      k = k + 1
      if (part_kind(choices(i)%name) == 'body') coordinate(k) = k
      if (part_kind(choices(i)%name) == 'body') taken(k) = .true.
      if (part_law(choices(i)%name) == 'watched') watched = k
    end do
    if (watched > 0) then
      if (coordinate(watched) == 0) call make_coordinate(machine, rows, watched, watched_body(choices), taken, &
                                                         coordinate(watched))
      if (coordinate(watched) > 0) machine%watched = coordinate(watched)
    end if
    do i = 1, size(choices)
      if (choices(i)%name /= 'drive:motion') cycle
      call check_given(choices, i, watched, error)
      if (allocated(error)) return
      k = reference_point_of(choices(i))
      if (coordinate(k) == 0) call make_coordinate(machine, rows, k, reference_point_name(choices, k), taken, coordinate(k))
      if (coordinate(k) > 0) cycle
      call fail(error, exit_bad_case, path_of(choices(i))//'.body: found a point that moves with the watched one, or with '// &
                'others whose motion is given, allowed one that is free of them')
      return
    end do
  end subroutine name_coordinates

  pure logical function is_reference_point(choice)
    type(law_choice_t), intent(in) :: choice
    is_reference_point = index(choice%name, 'body:') == 1 .or. index(choice%name, 'point:') == 1
  end function is_reference_point

  !> Label of a reference point, for messages and results.
  pure function reference_point_name(choices, reference_point) result(name)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: reference_point
    character(len=:), allocatable :: name
    integer :: i, k
    k = 0
    name = ''
    do i = 1, size(choices)
      if (.not. is_reference_point(choices(i))) cycle
      k = k + 1
      if (k == reference_point) name = body_name(choices(i), k)
    end do
  end function reference_point_name

  !> A reference point whose motion is given is not the watched one, and has one motion.
  pure subroutine check_given(choices, i, watched, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i, watched
    type(error_t), allocatable, intent(out) :: error
    integer :: k
    if (reference_point_of(choices(i)) == watched) then
      call fail(error, exit_bad_case, path_of(choices(i))//'.body: found the watched body, allowed one that is not: name '// &
                'another in watch.body')
      return
    end if
    do k = 1, i - 1
      if (choices(k)%name /= 'drive:motion') cycle
      if (reference_point_of(choices(k)) /= reference_point_of(choices(i))) cycle
      call fail(error, exit_bad_case, path_of(choices(i))//'.body: found a body whose motion '//path_of(choices(k))// &
                ' gives, allowed one motion each')
      return
    end do
  end subroutine check_given

  !> The structures, and the rows (columns here) of all reference points: bodies, then points.
  pure subroutine add_structures(choices, machine, rows, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(inout) :: machine
    real(wp), allocatable, intent(out) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: first(:), last(:)
    real(wp), allocatable :: row(:)
    integer :: i, k, n, bodies
    bodies = machine%n
    allocate (first(0), last(0))
    do i = 1, size(choices)
      if (index(choices(i)%name, 'structure:') /= 1) cycle
      first = [first, machine%n + 1]
      call read_structure(choices(i), body_name(choices(i), size(first)), machine, error)
      if (allocated(error)) return
      last = [last, machine%n]
    end do
    if (machine%n > most_degrees) then
      call fail(error, exit_bad_case, 'body: found '//to_text(machine%n)//' coordinates, allowed at most '// &
                to_text(most_degrees)//'; fewer modes of a structure')
      return
    end if
    allocate (rows(machine%n, count([(is_reference_point(choices(i)), i=1, size(choices))])), source=0.0_wp)
    do k = 1, bodies
      rows(k, k) = 1
    end do
    do i = 1, size(choices)
      if (index(choices(i)%name, 'point:') /= 1) cycle
      n = nint(value_of(choices(i), 'structure'))
      row = list_of(choices(i), 'row')
      if (size(row) /= last(n) - first(n) + 1) then
        call fail(error, exit_bad_case, path_of(choices(i))//': found '//to_text(size(row))//' numbers, allowed one for each '// &
                  'of the '//to_text(last(n) - first(n) + 1)//' coordinates of the structure')
      else if (.not. any(abs(row) > 0)) then
        call fail(error, exit_bad_case, path_of(choices(i))//': found a point that no coordinate moves, allowed one that moves')
      end if
      if (allocated(error)) return
      rows(first(n):last(n), k) = row
      if (choices(i)%name == 'point:watched') then
        allocate (machine%start_shape(machine%n, 2), source=0.0_wp)
        associate (block => machine%mass(first(n):last(n), first(n):last(n)))
          call start_shapes(block, machine%stiffness(first(n):last(n), first(n):last(n)), row, &
                            machine%start_shape(first(n):last(n), 1), machine%start_shape(first(n):last(n), 2))
        end associate
      end if
      k = k + 1
    end do
  end subroutine add_structures

  !> Adds the coordinates of one structure.
  pure subroutine read_structure(choice, name, machine, error)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: name
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: mass(:, :), damping(:, :), stiffness(:, :), start(:, :), frequency(:), ratios(:)
    integer :: k, n
    if (choice%name == 'structure:modes') then
      frequency = list_of(choice, 'frequency')
      n = size(frequency)
      ratios = list_of(choice, 'damping_ratios')
      if (size(ratios) == 0) ratios = 0*frequency
      call check_size(choice, 'damping_ratios', ratios, n, error)
      if (allocated(error)) return
      allocate (mass(n, n), damping(n, n), stiffness(n, n), source=0.0_wp)
      do k = 1, n
        mass(k, k) = 1
        stiffness(k, k) = frequency(k)**2
        damping(k, k) = 2*ratios(k)*frequency(k)
      end do
    else
      n = nint(sqrt(real(size(list_of(choice, 'mass')), wp)))
      call square(choice, 'mass', n, mass, error)
      if (.not. allocated(error)) call square(choice, 'stiffness', n, stiffness, error)
      if (allocated(error)) return
      call check_matrices(path_of(choice), mass, stiffness, error)
      if (allocated(error)) return
      allocate (damping(n, n), source=0.0_wp)
    end if
    if (size(list_of(choice, 'damping')) > 0) call square(choice, 'damping', n, damping, error)
    if (.not. allocated(error)) call check_size(choice, 'x0', list_of(choice, 'x0'), n, error)
    if (.not. allocated(error)) call check_size(choice, 'v0', list_of(choice, 'v0'), n, error)
    if (allocated(error)) return
    if (value_of(choice, 'damping_ratio') >= 0) damping = modal_damping(mass, stiffness, value_of(choice, 'damping_ratio'))
    start = transpose(reshape([list_of(choice, 'x0'), list_of(choice, 'v0')], [n, 2]))
    call add_structure(machine, name, mass, damping, stiffness, start)
  end subroutine read_structure

  pure subroutine check_size(choice, key, values, expected, error)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: key
    real(wp), intent(in) :: values(:)
    integer, intent(in) :: expected
    type(error_t), allocatable, intent(out) :: error
    if (size(values) /= expected) call fail(error, exit_bad_case, path_of(choice)//'.'//key//': found '// &
                                            to_text(size(values))//' numbers, allowed '//to_text(expected))
  end subroutine check_size

  !> A list row by row as a matrix.
  pure subroutine square(choice, key, n, matrix, error)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: key
    integer, intent(in) :: n
    real(wp), allocatable, intent(inout) :: matrix(:, :)
    type(error_t), allocatable, intent(out) :: error
    call check_size(choice, key, list_of(choice, key), n*n, error)
    if (.not. allocated(error)) matrix = transpose(reshape(list_of(choice, key), [n, n]))
  end subroutine square

  !> A mass matrix that is symmetric and positive definite, and a symmetric stiffness matrix.
  pure subroutine check_matrices(path, mass, stiffness, error)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: mass(:, :), stiffness(:, :)
    type(error_t), allocatable, intent(out) :: error
    if (.not. is_symmetric(mass)) then
      call fail(error, exit_bad_case, path//'.mass: found a matrix that is not symmetric, allowed M = M''')
    else if (.not. is_symmetric(stiffness)) then
      call fail(error, exit_bad_case, path//'.stiffness: found a matrix that is not symmetric, allowed K = K''')
    else if (.not. smallest_share(mass) > singular_share) then
      call fail(error, exit_bad_case, path//'.mass: found a singular or indefinite matrix (smallest over largest eigenvalue '// &
                number(smallest_share(mass))//'), allowed one that is positive definite: coordinates without mass are to be '// &
                'condensed (separatrix-structure)')
    end if
  end subroutine check_matrices

  !> Its label, or its number where the labels are not known.
  pure function body_name(choice, number) result(name)
    type(law_choice_t), intent(in) :: choice
    integer, intent(in) :: number
    character(len=:), allocatable :: name
    name = trim(choice%label)
    if (len(name) == 0) name = 'body '//to_text(number)
  end function body_name

  !> The row of second minus first.
  pure function row_of(rows, choice) result(row)
    real(wp), intent(in) :: rows(:, :)
    type(law_choice_t), intent(in) :: choice
    real(wp) :: row(size(rows, 1))
    integer :: first, second
    row = 0
    first = nint(value_of(choice, 'first_end'))
    second = nint(value_of(choice, 'second_end'))
    if (first > 0) row = row - rows(:, first)
    if (second > 0) row = row + rows(:, second)
  end function row_of

  !> Number of the reference point that a drive acts on.
  pure integer function reference_point_of(choice)
    type(law_choice_t), intent(in) :: choice
    reference_point_of = nint(value_of(choice, 'body'))
  end function reference_point_of

  pure function number(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(real(value, real64))
  end function number

end module reference_points
