! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The tables [[axis]], [grid] and [sweep].
module axis_reader
  use angle_units, only: unit_of
  use axis, only: axis_t, linear_values
  use case_parameters, only: canonical_name, is_start, parameter_bounds, parameter_names
  use case_source, only: case_source_t, description, enter_table, find, forgive_missing, has_problems, know, &
    know_all_below, list_size, report
  use case_type, only: case_t
  use case_values, only: any_number, bounds_t, more_than, take_choice, take_integer, take_integers, &
    take_range, take_real, take_reals, take_text
  use kinds, only: wp
  use law_table, only: is_start_parameter, law_choice_t
  use motor_choices, only: has_motor, supply_of
  use restoring_law, only: position_is_angle
  use text, only: to_text
  use toml_bindings, only: toml_array
  implicit none
  private

  public :: read_axes, read_sweep

  !> Most values along one axis.
  integer, parameter :: most_values = 10000000

contains

  !> The axes in the order of the text, and the tile shape. The laws must have been read.
  subroutine read_axes(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    integer :: i, at
    logical :: found
    ! Known even where the case has no axis.
    call know(source, 'axis[].name')
    at = find(source, 'axis')
    if (at > 0) then
      if (source%entries(at)%entry%kind /= toml_array) then
        call report(source, 'axis', 'found '//description(source%entries(at)%entry)//', allowed tables [[axis]]')
        call know_all_below(source, 'axis')
      end if
    end if
    allocate (the_case%axes(list_size(source, 'axis')))
    do i = 1, size(the_case%axes)
      call read_axis(source, the_case, i)
    end do
    allocate (the_case%tile(size(the_case%axes)), source=0)
    call enter_table(source, 'grid', found)
    call take_integers(source, 'grid.tile', 0, the_case%tile)
  end subroutine read_axes

  subroutine read_axis(source, the_case, number)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    integer, intent(in) :: number
    character(len=:), allocatable :: path
    type(bounds_t) :: bounds
    integer :: i
    logical :: found
    path = 'axis['//to_text(number)//']'
    associate (new => the_case%axes(number))
      allocate (new%values(0))
      new%unit = '1'
      call enter_table(source, path, found)
      call take_name(source, the_case%laws, path//'.name', .true., new, bounds, found)
      if (.not. found) then
        ! Without its unit nothing else of the axis can be checked.
        call know_all_below(source, path)
        return
      end if
      do i = 1, number - 1
        if (the_case%axes(i)%name == new%name) then
          call report(source, path//'.name', 'found '''//trim(new%name)//''' again, allowed one axis each')
        end if
      end do
      call know(source, path//'.values')
      if (find(source, path//'.values') > 0) then
        call take_list(source, path, bounds, new%values)
        call refuse_span(source, path)
      else
        call take_span(source, path, bounds, new%values)
      end if
    end associate
  end subroutine read_axis

  !> Name, unit and bounds of the parameter that an axis or a sweep varies; `found` is false if it
  !> is missing or unknown.
  subroutine take_name(source, laws, key, starts_too, new, bounds, found)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: key
    logical, intent(in) :: starts_too
    type(axis_t), intent(inout) :: new
    type(bounds_t), intent(out) :: bounds
    logical, intent(out) :: found
    character(len=:), allocatable :: name, allowed
    integer :: problems
    problems = size(source%problems)
    name = trim(new%name)
    call take_text(source, key, name, required=len(name) == 0)
    call parameter_bounds(laws, canonical_name(name), bounds, found)
    if (is_start(name) .or. is_start_parameter(name)) found = found .and. starts_too
    if (found) then
      new%name = canonical_name(name)
      new%unit = trim(bounds%unit)
    else if (size(source%problems) == problems .and. .not. has_problems(source, name(:index(name//'.', '.') - 1)//'.law')) then
      ! Of a family whose law is wrong nobody knows the parameters.
      allowed = parameter_names(laws)
      if (starts_too) allowed = 'x0, v0, crank_angle, '//allowed
      if (name == 'drive.ratio' .and. has_motor(laws)) allowed = &
        allowed//'; the motor sets the speed of the crank (did you mean "'//supply_of(laws)//'"?)'
      call report(source, key, 'found "'//name//'", allowed '//allowed)
    end if
  end subroutine take_name

  !> values = [...]
  subroutine take_list(source, path, bounds, values)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(bounds_t), intent(in) :: bounds
    real(wp), allocatable, intent(inout) :: values(:)
    integer :: i, problems
    problems = size(source%problems)
    call take_reals(source, path//'.values', bounds, values)
    if (size(source%problems) > problems) return
    do i = 2, size(values)
      if (values(i) > values(i - 1)) cycle
      call report(source, path//'.values['//to_text(i)//']', 'found '//to_text(values(i))//' after '// &
                  to_text(values(i - 1))//', allowed ascending values')
      return
    end do
  end subroutine take_list

  !> An axis has either values or from and to.
  subroutine refuse_span(source, path)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    character(len=5), parameter :: keys(4) = ['from ', 'to   ', 'count', 'step ']
    character(len=:), allocatable :: key
    integer :: i
    do i = 1, size(keys)
      key = path//'.'//trim(keys(i))
      call know(source, key)
      if (find(source, key) > 0) call report(source, key, 'found beside values, allowed one or the other')
    end do
  end subroutine refuse_span

  !> from, to and either count or step
  subroutine take_span(source, path, bounds, values)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(bounds_t), intent(in) :: bounds
    real(wp), allocatable, intent(inout) :: values(:)
    real(wp) :: from, to, step
    integer :: count, problems
    problems = size(source%problems)
    from = 0
    to = 0
    step = 0
    count = 0
    call take_real(source, path//'.from', bounds, from, required=.true.)
    call take_real(source, path//'.to', bounds, to, required=.true.)
    call take_real(source, path//'.step', more_than(0.0_wp, bounds%unit), step)
    call take_integer(source, path//'.count', 1, count, highest=most_values)
    if (size(source%problems) > problems) return
    if (step > 0 .and. count > 0) then
      call report(source, path//'.count', 'found both count and step, allowed one of them')
    else if (.not. step > 0 .and. count == 0) then
      call report(source, path//'.count', 'found no count or step, allowed one of them', missing=.true.)
    else if (step > 0) then
      call count_steps(source, path, from, to, step, count)
    else if ((count == 1 .and. from /= to) .or. (count > 1 .and. from >= to)) then
      call report(source, path//'.to', 'found '//to_text(to)//' with from = '//to_text(from)//' and count = '// &
                  to_text(count)//', allowed from < to, or from = to with count = 1')
    end if
    if (size(source%problems) == problems) values = linear_values(from, to, count)
  end subroutine take_span

  !> Number of values from `from` to `to`, which must be a whole number of steps apart.
  subroutine count_steps(source, path, from, to, step, count)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: from, to, step
    integer, intent(out) :: count
    count = 0
    if (from >= to) then
      call report(source, path//'.to', 'found '//to_text(to)//', allowed more than from = '//to_text(from))
    else if ((to - from)/step > most_values) then
      call report(source, path//'.step', 'found '//to_text(step)//', allowed at most '//to_text(most_values)//' values')
    else
      count = nint((to - from)/step) + 1
      ! Decimal steps are not exact in binary.
      if (abs((to - from)/step - (count - 1)) > 1e-6_wp) then
        call report(source, path//'.step', 'found '//to_text(step)//', allowed a whole number of steps from '// &
                    to_text(from)//' to '//to_text(to))
      end if
    end if
  end subroutine count_steps

  !> The sweep; the axes must have been read.
  subroutine read_sweep(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    type(bounds_t) :: bounds
    logical :: found, lacks
    associate (sweep => the_case%sweep)
      sweep%swept%name = 'drive.ratio'
      sweep%swept%unit = '1'
      allocate (sweep%swept%values(0))
      call enter_table(source, 'sweep', sweep%present)
      ! Known even where the case has no sweep.
      call know(source, 'sweep.parameter')
      if (.not. sweep%present) return
      call take_name(source, the_case%laws, 'sweep.parameter', .false., sweep%swept, bounds, found)
      if (.not. found) then
        call know_all_below(source, 'sweep')
        return
      end if
      call take_span(source, 'sweep', bounds, sweep%swept%values)
      call take_choice(source, 'sweep.directions', ['both', 'up  ', 'down'], sweep%directions)
      call take_integers(source, 'sweep.starts', 0, sweep%starts)
      if (any(sweep%starts == 0) .and. any(sweep%starts > 0)) then
        call report(source, 'sweep.starts', 'found one zero, allowed [0, 0] or two positive numbers')
      end if
      associate (is_angle => position_is_angle(the_case%laws))
        call take_start_range(source, the_case%axes, 'x0', unit_of('m', is_angle), sweep%starts(1), sweep%x0)
        call take_start_range(source, the_case%axes, 'v0', unit_of('m/s', is_angle), sweep%starts(2), sweep%v0)
      end associate
      call take_integer(source, 'sweep.samples', 1, sweep%samples)
      call take_real(source, 'sweep.limit_tolerance', more_than(0.0_wp, bounds%unit), sweep%limit_tolerance)
      if (sweep%wanted) return
      call forgive_missing(source, 'sweep', lacks)
      sweep%present = .not. lacks
    end associate
  end subroutine read_sweep

  !> Range of the brute-force starts; the ends of the axis of that name unless it is given.
  subroutine take_start_range(source, axes, name, unit, count, range)
    type(case_source_t), intent(inout) :: source
    type(axis_t), intent(in) :: axes(:)
    character(len=*), intent(in) :: name, unit
    integer, intent(in) :: count
    real(wp), intent(inout) :: range(2)
    integer :: i
    logical :: required
    required = count > 0
    do i = 1, size(axes)
      if (axes(i)%name /= name .or. size(axes(i)%values) == 0) cycle
      range = [axes(i)%values(1), axes(i)%values(size(axes(i)%values))]
      required = .false.
    end do
    call take_range(source, 'sweep.'//name, any_number(unit), range, required)
    if (count == 1 .and. range(1) /= range(2)) then
      call report(source, 'sweep.'//name, 'found two ends for one start, allowed equal ends')
    end if
  end subroutine take_start_range

end module axis_reader
