! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix branches --free`: the labels of branches as curves over a second parameter.
module branch_curves
  use bifurcation_curve, only: can_be_followed, curve_t, passes, trace_curve
  use branch_point, only: label_names, last_label, no_label, point_t
  use search_state, only: search_t
  use branches_setup, only: read_end
  use case_parameters, only: canonical_name, is_start, parameter_bounds, parameter_names, parameter_value
  use case_type, only: case_t
  use case_values, only: allowed_range, bounds_t
  use command_line, only: command_t
  use curve_equations, only: curve_plan_t
  use errors, only: error_t, fail
  use journal, only: json_number, json_text
  use kinds, only: int64, wp
  use map_schema, only: name_length, schema_t, type_float64, type_int32, type_int8
  use session, only: session_t
  use status, only: exit_bad_case
  use text, only: join, replace_all, to_text
  implicit none
  private

  public :: set_free, follow_labels, report_curves, describe_curves

  !> The second parameter with its value in the case, and the curves.
  type, public :: curves_t
    type(curve_plan_t) :: plan
    character(len=:), allocatable :: unit
    real(wp) :: value = 0
    logical :: wanted = .false.
    type(curve_t), allocatable :: list(:)
  end type curves_t

contains

  !> The second parameter and its range, as asked, else that of the axis; the value of the case lies in it. Code 65 otherwise.
  subroutine set_free(command, the_case, search, curves, error)
    type(command_t), intent(in) :: command
    type(case_t), intent(in) :: the_case
    type(search_t), intent(in) :: search
    type(curves_t), intent(inout) :: curves
    type(error_t), allocatable, intent(out) :: error
    type(bounds_t) :: bounds
    character(len=:), allocatable :: name, problem
    real(wp) :: range(2)
    logical :: found, given(2)
    integer :: i
    allocate (curves%list(0))
    curves%wanted = len(command%free) > 0
    if (.not. curves%wanted) return
    name = canonical_name(command%free)
    call parameter_bounds(the_case%laws, name, bounds, found)
    if (.not. found .or. is_start(name) .or. name == search%family%path) then
      call fail(error, exit_bad_case, "--free: found '"//name//"', allowed another one of "//parameter_names(the_case%laws))
      return
    end if
    given = .false.
    range = 0
    call read_end('--free-from', command%free_from, bounds, range(1), given(1), error)
    if (.not. allocated(error)) call read_end('--free-to', command%free_to, bounds, range(2), given(2), error)
    if (allocated(error)) return
    do i = 1, size(the_case%axes)
      if (the_case%axes(i)%name /= name) cycle
      if (.not. given(1)) range(1) = minval(the_case%axes(i)%values)
      if (.not. given(2)) range(2) = maxval(the_case%axes(i)%values)
      given = .true.
    end do
    if (.not. all(given)) call fail(error, exit_bad_case, '--free-from and --free-to are needed: the case has no axis of '//name)
    do i = 1, 2
      if (allocated(error)) return
      problem = allowed_range(range(i), bounds)
      if (len(problem) > 0) call fail(error, exit_bad_case, trim(merge('--free-from', '--free-to  ', i == 1))//': '//problem)
    end do
    if (allocated(error)) return
    curves%value = parameter_value(the_case%laws, name, 0.0_wp)
    if (.not. (range(1) < range(2) .and. range(1) <= curves%value .and. curves%value <= range(2))) then
      call fail(error, exit_bad_case, '--free-from, --free-to: found '//to_text(range(1))//' and '//to_text(range(2))// &
                ', allowed a range that rises and holds '//name//' = '//to_text(curves%value)//' of the case')
      return
    end if
    curves%plan = curve_plan_t(name, [search%plan%lowest, range(1)], [search%plan%highest, range(2)])
    curves%unit = trim(bounds%unit)
  end subroutine set_free

  !> Follows every labelled point that is on no curve yet.
  subroutine follow_labels(search, curves)
    type(search_t), intent(in) :: search
    type(curves_t), intent(inout) :: curves
    type(curve_t) :: curve
    integer :: b, i
    do b = 1, size(search%branches)
      do i = 1, size(search%branches(b)%points)
        associate (point => search%branches(b)%points(i))
          if (.not. can_be_followed(point%label)) cycle
          if (is_known(search, curves, point)) cycle
          call trace_curve(search%family, curves%plan, point, curves%value, curve)
          if (size(curve%points) > 1) curves%list = [curves%list, curve]
        end associate
      end do
    end do
  end subroutine follow_labels

  !> Whether one of the curves passes a labelled point.
  logical function is_known(search, curves, point)
    type(search_t), intent(in) :: search
    type(curves_t), intent(in) :: curves
    type(point_t), intent(in) :: point
    integer :: c
    is_known = .false.
    do c = 1, size(curves%list)
      is_known = passes(search%family, curves%plan, curves%list(c), point, curves%value)
      if (is_known) return
    end do
  end function is_known

  pure function shown_label(label) result(shown)
    integer, intent(in) :: label
    character(len=:), allocatable :: shown
    shown = replace_all(trim(label_names(label)), '_', ' ')
  end function shown_label

  !> Every curve, and its points of codimension two.
  subroutine report_curves(session, search, curves)
    type(session_t), intent(inout) :: session
    type(search_t), intent(in) :: search
    type(curves_t), intent(in) :: curves
    integer :: c, i
    do c = 1, size(curves%list)
      associate (curve => curves%list(c))
        call session%journal%line('curve', 'curve '//to_text(c)//': '//shown_label(curve%label)//', '// &
          to_text(size(curve%points))//' points, '//curves%plan%free//' from '//to_text(minval(curve%points%free), 12)//' to '// &
          to_text(maxval(curve%points%free), 12))
        do i = 1, size(curve%points)
          associate (point => curve%points(i))
            if (point%second == no_label) cycle
            call session%journal%line('codimension_two', '  with '//shown_label(point%second)//' at '//search%family%path//' = '// &
              to_text(point%orbit%parameter, 13)//', '//curves%plan%free//' = '//to_text(point%free, 13), &
              '"curve": '//to_text(c)//', "label": '//json_text(trim(label_names(curve%label)))//', "second": '// &
              json_text(trim(label_names(point%second)))//', "parameter": '//json_number(point%orbit%parameter)//', "free": '// &
              json_number(point%free))
          end associate
        end do
      end associate
    end do
  end subroutine report_curves

  !> The points of all curves, one after the other.
  subroutine describe_curves(curves, path, unit, schema)
    type(curves_t), intent(in) :: curves
    character(len=*), intent(in) :: path, unit
    type(schema_t), intent(inout) :: schema
    real(wp), allocatable :: number(:), parameter(:), free(:), x(:), v(:), label(:), second(:), period(:)
    character(len=name_length) :: along(1)
    integer :: c, i
    if (.not. curves%wanted) return
    allocate (number(0), parameter(0), free(0), x(0), v(0), label(0), second(0), period(0))
    do c = 1, size(curves%list)
      associate (points => curves%list(c)%points)
        number = [number, [(real(c, wp), i=1, size(points))]]
        parameter = [parameter, [(points(i)%orbit%parameter, i=1, size(points))]]
        free = [free, points%free]
        x = [x, [(points(i)%orbit%y(1), i=1, size(points))]]
        v = [v, [(points(i)%orbit%y(2), i=1, size(points))]]
        period = [period, [(real(points(i)%orbit%periods, wp), i=1, size(points))]]
        label = [label, [(real(curves%list(c)%label, wp), i=1, size(points))]]
        second = [second, real(points%second, wp)]
      end associate
    end do
    along = 'curve_point'
    call schema%add_attribute('', 'free', curves%plan%free)
    if (size(number) == 0) return
    call schema%add_dimension('curve_point', size(number, kind=int64))
    call schema%add_variable('curve', type_int32, along, units='1', long_name='number of the curve', data=number)
    call add('curve_parameter', unit, path, parameter)
    call add('curve_free', curves%unit, curves%plan%free, free)
    call add('curve_x', 'm', 'position at crank angle 0', x)
    call add('curve_v', 'm/s', 'velocity at crank angle 0', v)
    call schema%add_variable('curve_period', type_int32, along, units='1', long_name='period in drive periods', data=period)
    call add_label('curve_label', 'what the curve is of', label)
    call add_label('curve_second', 'what else is zero at a point of codimension two', second)

  contains

    subroutine add(name, units, long_name, values)
      character(len=*), intent(in) :: name, units, long_name
      real(wp), intent(in) :: values(:)
      call schema%add_variable(name, type_float64, along, units=units, long_name=long_name, data=values)
    end subroutine add

    subroutine add_label(name, long_name, values)
      character(len=*), intent(in) :: name, long_name
      real(wp), intent(in) :: values(:)
      call schema%add_variable(name, type_int8, along, units='1', long_name=long_name, flag_values=[(i, i=0, last_label)], &
                               flag_meanings=join(label_names, ' '), data=values)
    end subroutine add_label

  end subroutine describe_curves

end module branch_curves
