! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The equilibria of `separatrix branches`: what is reported of them, and what the file has.
module branch_equilibria
  use branch_point, only: label_closed, label_names, last_label, no_label
  use search_state, only: search_t
  use equilibrium, only: count_unstable, equilibrium_t
  use eigenvalue_text, only: values_json, values_text
  use errors, only: error_t
  use multibody, only: is_stop
  use journal, only: json_number, json_text
  use kinds, only: int64, wp
  use machine_family, only: machine_of_family
  use map_schema, only: name_length, schema_t, type_float64, type_int16, type_int32, type_int8
  use hybrid_body, only: rests_on_barrier
  use hybrid_machine, only: hybrid_t
  use own_body, only: own_body_t
  use session, only: session_t
  use structure, only: structure_t
  use structure_modes, only: phases_in
  use text, only: join, replace_all, to_text
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: count_equilibria, report_equilibria, describe_equilibria

contains

  !> Branches of equilibria.
  pure integer function count_equilibria(search)
    type(search_t), intent(in) :: search
    count_equilibria = 0
    if (allocated(search%equilibria)) count_equilibria = size(search%equilibria)
  end function count_equilibria

  !> Every branch, and its labelled points.
  subroutine report_equilibria(session, search, unit)
    type(session_t), intent(inout) :: session
    type(search_t), intent(in) :: search
    character(len=*), intent(in) :: unit
    character(len=:), allocatable :: shown
    real(wp) :: at(2)
    integer :: b, i, pressed
    do b = 1, count_equilibria(search)
      associate (line => search%equilibria(b))
        pressed = count_pressed(search, line%points(1))
        call session%journal%line('equilibria_branch', 'equilibria '//to_text(b)//': '//to_text(pressed)//' stops pressed, '// &
          to_text(size(line%points))//' points, ends: '//name_of(line%ending(1))//' and '//name_of(line%ending(2)), &
          '"branch": '//to_text(b)//', "pressed": '//to_text(pressed)//', "ends": ['// &
          json_text(trim(label_names(line%ending(1))))//', '//json_text(trim(label_names(line%ending(2))))//']')
        do i = 1, size(line%points)
          associate (point => line%points(i))
            if (point%label == no_label .or. point%label == label_closed) cycle
            at = matmul(search%watch, point%y)
            shown = to_text(point%parameter, 13)
            if (unit /= '1') shown = shown//' '//unit
            call session%journal%line('equilibrium', '  '//name_of(point%label)//' at '//search%family%path//' = '//shown// &
              ', x = '//to_text(at(1), 9)//', eigenvalues '//values_text(point%values), '"branch": '//to_text(b)//', "label": '// &
              json_text(trim(label_names(point%label)))//', "parameter": '//json_number(point%parameter)//', "x": '// &
              json_number(at(1))//', "eigenvalues": '//values_json(point%values))
          end associate
        end do
      end associate
    end do
  end subroutine report_equilibria

  pure function name_of(label) result(text)
    integer, intent(in) :: label
    character(len=:), allocatable :: text
    text = replace_all(trim(label_names(label)), '_', ' ')
  end function name_of

  !> Stops that are pressed.
  integer function count_pressed(search, point) result(pressed)
    type(search_t), intent(in) :: search
    type(equilibrium_t), intent(in) :: point
    class(hybrid_t), allocatable :: machine
    type(error_t), allocatable :: error
    pressed = 0
    call machine_of_family(search%family, point%parameter, machine, error)
    if (allocated(error)) return
    select type (machine)
    type is (own_body_t)
      pressed = merge(1, 0, rests_on_barrier(point%mode))
    type is (structure_t)
      associate (joints => machine%frame%moving%machine%joints)
        pressed = count(is_stop(joints%kind) .and. phase_of(phases_in(machine%frame%moving%machine, point%mode), size(joints)) /= 0)
      end associate
    end select
  end function count_pressed

  pure function phase_of(phases, n) result(first)
    integer, intent(in) :: phases(:), n
    integer :: first(n)
    first = phases(:n)
  end function phase_of

  !> The points of all branches of equilibria, one after the other.
  subroutine describe_equilibria(search, unit, schema)
    type(search_t), intent(in) :: search
    character(len=*), intent(in) :: unit
    type(schema_t), intent(inout) :: schema
    type(equilibrium_t), allocatable :: points(:)
    real(wp), allocatable :: number(:), pressed(:), at(:, :), values(:, :, :)
    character(len=name_length) :: along(1), both(2)
    integer :: b, i, most
    if (count_equilibria(search) == 0) return
    allocate (points(0), number(0), pressed(0))
    do b = 1, size(search%equilibria)
      associate (line => search%equilibria(b)%points)
        points = [points, line]
        number = [number, [(real(b, wp), i=1, size(line))]]
        pressed = [pressed, [(real(count_pressed(search, line(1)), wp), i=1, size(line))]]
      end associate
    end do
    at = reshape([(matmul(search%watch, points(i)%y), i=1, size(points))], [2, size(points)])
    most = maxval([(size(points(i)%values), i=1, size(points))])
    allocate (values(max(1, most), size(points), 2), source=ieee_value(1.0_wp, ieee_quiet_nan))
    do i = 1, size(points)
      values(:size(points(i)%values), i, 1) = real(points(i)%values)
      values(:size(points(i)%values), i, 2) = aimag(points(i)%values)
    end do
    along = 'equilibrium'
    both = [character(len=name_length) :: 'equilibrium', 'eigenvalue']
    call schema%add_dimension('equilibrium', size(points, kind=int64))
    call schema%add_dimension('eigenvalue', size(values, 1, int64))
    call schema%add_variable('equilibrium_branch', type_int32, along, units='1', long_name='number of the branch of equilibria', &
                             data=number)
    call schema%add_variable('equilibrium_parameter', type_float64, along, units=unit, long_name=search%family%path, &
                             data=[(points(i)%parameter, i=1, size(points))])
    call schema%add_variable('equilibrium_x', type_float64, along, units='m', long_name='position at rest', data=at(1, :))
    call schema%add_variable('equilibrium_pressed', type_int16, along, units='1', long_name='stops that are pressed', data=pressed)
    call schema%add_variable('equilibrium_stable', type_int8, along, units='1', long_name='all eigenvalues have negative real '// &
                             'parts', flag_values=[0, 1], flag_meanings='unstable stable', &
                             data=[(merge(1.0_wp, 0.0_wp, count_unstable(points(i)) == 0), i=1, size(points))])
    call schema%add_variable('equilibrium_label', type_int8, along, units='1', long_name='what the point is', &
                             flag_values=[(i, i=0, last_label)], flag_meanings=join(label_names, ' '), &
                             data=[(real(points(i)%label, wp), i=1, size(points))])
    call schema%add_variable('eigenvalue_real', type_float64, both, units='1/s', long_name='eigenvalues, real part', &
                             data=[values(:, :, 1)])
    call schema%add_variable('eigenvalue_imag', type_float64, both, units='1/s', long_name='eigenvalues, imaginary part', &
                             data=[values(:, :, 2)])
  end subroutine describe_equilibria

end module branch_equilibria
