! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix branches`: stable and unstable periodic orbits over a parameter.
module branches_driver
  use branch_contacts, only: contacts_t, look_for_contacts, report_contacts
  use branch_equilibria, only: count_equilibria, describe_equilibria, report_equilibria
  use branch_curves, only: curves_t, describe_curves, follow_labels, report_curves, set_free
  use branch_point, only: branch_t, is_stable, label_closed, label_crisis, label_homoclinic, label_names, label_range, last_label, &
                          no_label, point_t
  use branch_rest, only: describe_rest, find_rest, report_rest, rest_at_t
  use branch_watch, only: branch_watch_t
  use branch_search, only: follow_seeds, prepare_search
  use search_jobs, only: dismiss, search_values, serve
  use search_state, only: search_t
  use search_team, only: search_team_t
  use branches_setup, only: set_range, set_starts
  use case_setup, only: output_path
  use case_values, only: bounds_t
  use command_line, only: command_t
  use constants, only: unreachable
  use errors, only: error_t, fail
  use event_words, only: word_text
  use journal, only: json_number, json_text
  use kinds, only: int64, wp
  use map_final, only: write_whole
  use map_schema, only: name_length, schema_t, type_float64, type_int16, type_int32, type_int8
  use motion_state, only: event_touch_lower, event_touch_upper
  use orbit_margins, only: is_impact
  use orbit_words, only: symmetry_text, word_of
  use periodic_orbit, only: orbit_t
  use session, only: describe_file, open_session, session_t
  use status, only: exit_bad_case, exit_done, exit_given_up
  use text, only: join, replace_all, to_text
  use written_check, only: check_written
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_value
  implicit none
  private

  public :: run_branches

  !> At an impact without speed the derivative is not finite: a located graze leaves a speed of rounding, and what is larger than
  !> this comes from that.
  real(wp), parameter :: endless = 1e7_wp

contains

  !> Runs the command; ends the program with the exit code on errors.
  subroutine run_branches(command)
    type(command_t), intent(in) :: command
    type(session_t), target :: session
    type(search_t), target :: search
    type(branch_watch_t), target :: watch
    type(search_team_t), target :: workers
    type(curves_t) :: curves
    type(rest_at_t), allocatable :: rest(:)
    type(schema_t) :: schema
    type(bounds_t) :: bounds
    type(error_t), allocatable :: error
    character(len=:), allocatable :: path
    call open_session(command, session)
    path = output_path(command%output, command%path, command%name)
    call set_range(command, session%the_case, search, bounds, error)
    if (.not. allocated(error)) call set_free(command, session%the_case, search, curves, error)
    if (.not. allocated(error)) then
      call prepare_search(search, command%searches, error)
      if (allocated(error)) error%message = command%path//': '//error%message
    end if
    call session%stop_if(error)
    call set_starts(session%the_case, search, error)
    call session%stop_if(error)
    if (command%validate .or. command%dry_run) then
      call session%journal%line('valid', command%path//' is a valid case for branches over '//search%family%path//' from '// &
                                to_text(search%plan%lowest)//' to '//to_text(search%plan%highest))
      call session%end_with(exit_done)
    end if
    call session%begin(path, tiled=.false.)
    workers%team => session%team
    search%workers => workers
    if (session%team%is_root()) then
      call watch%begin(session%journal, search)
      call search_and_report(session, search, trim(bounds%unit), curves, rest)
    else
      call serve(search)
    end if
    if (session%team%is_root()) call refuse_nothing(search, rest, command%partial, error)
    call session%stop_if(error)
    call describe_file(session, 'branches', schema)
    if (session%team%is_root()) then
      call describe_branches(search, trim(bounds%unit), schema)
      call describe_equilibria(search, trim(bounds%unit), schema)
      call describe_rest(rest, search%family%path, trim(bounds%unit), schema)
      call describe_curves(curves, search%family%path, trim(bounds%unit), schema)
    end if
    call session%provenance%finish(schema)
    if (session%team%is_root()) call write_whole(path, schema, command%force, error)
    call session%stop_if(error)
    call check_written(session, path)
    call session%journal%line('written', 'wrote '//path)
    call session%end_with(exit_done)
  end subroutine run_branches

  !> Branches, equilibria, positions of rest and, where they are wanted, contacts and curves; in the log as they are found.
  subroutine search_and_report(session, search, unit, curves, rest)
    type(session_t), intent(inout) :: session
    type(search_t), intent(inout) :: search
    character(len=*), intent(in) :: unit
    type(curves_t), intent(inout) :: curves
    type(rest_at_t), allocatable, intent(out) :: rest(:)
    type(contacts_t) :: contacts
    call search_values(search)
    call follow_seeds(search)
    call dismiss(search)
    if (session%command%contacts) call look_for_contacts(session, search, contacts)
    if (curves%wanted) call follow_labels(search, curves)
    call report(session, search, contacts, unit)
    call report_equilibria(session, search, unit)
    call find_rest(search, rest)
    call report_rest(session, rest, search%family%path, unit)
    call report_curves(session, search, curves)
  end subroutine search_and_report

  !> An error where nothing was found: of another code if every motion was given up, unless `partial` results will do.
  subroutine refuse_nothing(search, rest, partial, error)
    type(search_t), intent(in) :: search
    type(rest_at_t), intent(in) :: rest(:)
    logical, intent(in) :: partial
    type(error_t), allocatable, intent(inout) :: error
    logical :: given_up
    if (size(search%branches) + count_equilibria(search) + size(rest) > 0) return
    given_up = all(search%found%lost == search%found%starts) .and. .not. partial
    call fail(error, merge(exit_given_up, exit_bad_case, given_up), 'no isolated periodic orbit was found over '// &
              search%family%path//' from '//to_text(search%plan%lowest)//' to '//to_text(search%plan%highest)// &
              lost_text(search)//'; nothing is written')
  end subroutine refuse_nothing

  !> How many starts led nowhere; '' if none was lost.
  pure function lost_text(search) result(text)
    type(search_t), intent(in) :: search
    character(len=:), allocatable :: text
    text = ''
    if (sum(search%found%lost) > 0) text = '; the motions of '//to_text(sum(search%found%lost))//' of '// &
                                           to_text(sum(search%found%starts))//' starts were given up, left the domain or '// &
                                           'came to rest'
  end function lost_text

  !> Every labelled point, and what was found from how many seeds.
  subroutine report(session, search, contacts, unit)
    type(session_t), intent(inout) :: session
    type(search_t), intent(in) :: search
    type(contacts_t), intent(in) :: contacts
    character(len=*), intent(in) :: unit
    integer :: b, i, families
    do b = 1, size(search%branches)
      associate (line => search%branches(b))
        call session%journal%line('branch', 'branch '//to_text(b)//': period '//to_text(line%points(1)%orbit%periods)//', '// &
          to_text(size(line%points))//' points, '//ends_text(line%ending)//symmetry_text(search, b), &
          '"branch": '//to_text(b)//', "ends": ['//json_text(trim(label_names(line%ending(1))))//', '// &
          json_text(trim(label_names(line%ending(2))))//']')
        do i = 1, size(line%points)
          if (line%points(i)%label /= no_label) call report_point(session, search, line%points(i), b, unit)
          if (allocated(contacts%list)) call report_contacts(session, search, contacts, b, i, unit)
        end do
        if (allocated(contacts%list)) call report_contacts(session, search, contacts, b, 0, unit)
      end associate
    end do
    call session%journal%line('found', to_text(size(search%branches))//' branches from '//to_text(search%seeds)// &
      ' seeds at '//to_text(size(search%values))//' values of '//search%family%path//'; there may be others'//lost_text(search))
    if (search%seeds > 0 .and. .not. search%depends) call session%journal%line('no_effect', search%family%path// &
      ' has no effect on any orbit that was found: each is the same at every value')
    families = sum(search%found%equilibria)
    if (families > 0 .and. count_equilibria(search) == 0) then
      call session%journal%line('equilibria', 'equilibria were met '//to_text(families)//' times; they are not followed')
    end if
    families = sum(search%found%families)
    if (maxval(search%found%families) > 1) then
      call session%journal%line('family', 'orbits that are not isolated (a multiplier within 1e-6 of 1: a family) were met '// &
                                to_text(families)//' times; they are not followed')
    else if (families > 0) then
      call session%journal%line('neutral', 'an orbit with a multiplier 1 was met that does not go on: one of a family, or '// &
                                'beside a fold; it is not followed')
    end if
  end subroutine report

  !> Where a branch ends, in words.
  pure function ends_text(ending) result(text)
    integer, intent(in) :: ending(2)
    character(len=:), allocatable :: text
    text = 'ends: '//trim(label_names(ending(1)))//' and '//trim(label_names(ending(2)))
    if (ending(1) == ending(2)) text = 'ends: '//trim(label_names(ending(1)))
    if (ending(1) == label_closed) text = 'closed'
    text = replace_all(text, '_', ' ')
  end function ends_text

  subroutine report_point(session, search, point, number, unit)
    type(session_t), intent(inout) :: session
    type(search_t), intent(in) :: search
    type(point_t), intent(in) :: point
    integer, intent(in) :: number
    character(len=*), intent(in) :: unit
    character(len=:), allocatable :: shown
    real(wp) :: at(2)
    at = matmul(search%watch, point%orbit%y)
    associate (orbit => point%orbit)
      ! A contact is known to its bracket, which stands below it.
      shown = to_text(orbit%parameter, merge(6, 13, any(point%label == [label_crisis, label_homoclinic])))
      if (unit /= '1') shown = shown//' '//unit
      call session%journal%line('point', '  '//replace_all(trim(label_names(point%label)), '_', ' ')//' at '//search%family%path// &
        ' = '//shown//', '//word_text(word_of(orbit, search))//multipliers_text(orbit, search%has_clock), &
        '"branch": '//to_text(number)//', "label": '//json_text(trim(label_names(point%label)))//', "parameter": '// &
        json_number(orbit%parameter)//', "x": '//json_number(at(1))//', "v": '//json_number(at(2))//', "word": '// &
        json_text(word_text(word_of(orbit, search)))//', "multipliers": '//multipliers_json(orbit, search%has_clock))
    end associate
  end subroutine report_point

  !> Number of multipliers that are shown: without a clock all but the trivial one along the motion.
  pure integer function count_multipliers(orbit, has_clock)
    type(orbit_t), intent(in) :: orbit
    logical, intent(in) :: has_clock
    count_multipliers = size(orbit%multipliers) - merge(0, 1, has_clock)
  end function count_multipliers

  pure function multipliers_text(orbit, has_clock) result(text)
    type(orbit_t), intent(in) :: orbit
    logical, intent(in) :: has_clock
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    if (.not. has_clock) text = ', cycle of '//to_text(orbit%events(size(orbit%events))%time, 13)//' s'
    text = text//', multipliers'
    do i = 1, count_multipliers(orbit, has_clock)
      text = text//merge(', ', '  ', i > 1)//complex_text(orbit%multipliers(i))
    end do
    if (.not. has_clock) text = text//' and the trivial 1'
    text = replace_all(text, 'multipliers  ', 'multipliers ')
    if (index(text, 'not known') > 0) text = text//' (hidden by rounding beside what grows without bound where events graze)'
  end function multipliers_text

  pure function multipliers_json(orbit, has_clock) result(text)
    type(orbit_t), intent(in) :: orbit
    logical, intent(in) :: has_clock
    character(len=:), allocatable :: text
    integer :: i
    text = '['
    do i = 1, count_multipliers(orbit, has_clock)
      if (i > 1) text = text//', '
      text = text//json_number(real(orbit%multipliers(i), wp))//', '//json_number(aimag(orbit%multipliers(i)))
    end do
    text = text//']'
  end function multipliers_json

  pure function complex_text(z) result(text)
    complex(wp), intent(in) :: z
    character(len=:), allocatable :: text
    text = to_text(real(z, wp), 9)
    if (abs(z) > endless) text = 'infinite'
    if (.not. abs(z) <= huge(1.0_wp) .and. .not. abs(z) > endless) text = 'not known'
    if (.not. abs(z) <= endless) return
    if (abs(aimag(z)) > 0) text = text//merge('+', '-', aimag(z) > 0)//to_text(abs(aimag(z)), 9)//'i'
  end function complex_text

  !> The points of all branches, one after the other.
  subroutine describe_branches(search, unit, schema)
    type(search_t), intent(in) :: search
    character(len=*), intent(in) :: unit
    type(schema_t), intent(inout) :: schema
    type(point_t), allocatable :: points(:)
    integer, allocatable :: number(:)
    character(len=name_length) :: along(1)
    real(wp), allocatable :: watched(:, :)
    integer :: b, i, shown
    call schema%add_attribute('', 'parameter', search%family%path)
    call schema%add_attribute('', 'seeds', search%seeds)
    if (size(search%branches) == 0) return
    allocate (points(0), number(0))
    do b = 1, size(search%branches)
      points = [points, search%branches(b)%points]
      number = [number, [(b, i=1, size(search%branches(b)%points))]]
    end do
    watched = reshape([(matmul(search%watch, points(i)%orbit%y), i=1, size(points))], [2, size(points)])
    shown = count_multipliers(points(1)%orbit, search%has_clock)
    along = 'point'
    call schema%add_dimension('point', size(points, kind=int64))
    call schema%add_dimension('multiplier', int(shown, int64))
    call schema%add_variable('branch', type_int32, along, units='1', long_name='number of the branch', data=real(number, wp))
    call add('parameter', unit, search%family%path, [(points(i)%orbit%parameter, i=1, size(points))])
    call add('x', 'm', 'position '//section_text(search%has_clock), watched(1, :))
    call add('v', 'm/s', 'velocity '//section_text(search%has_clock), watched(2, :))
    if (.not. search%has_clock) call add('cycle_time', 's', 'time in which the orbit closes', &
                                         [(points(i)%orbit%events(size(points(i)%orbit%events))%time, i=1, size(points))])
    call add('x_max', 'm', 'largest position', points%x_max)
    call add('x_min', 'm', 'smallest position', points%x_min)
    call schema%add_variable('period', type_int16, along, units='1', long_name='period in '// &
                             trim(merge('drive periods', 'returns      ', search%has_clock)), &
                             data=[(real(points(i)%orbit%periods, wp), i=1, size(points))])
    call schema%add_variable('impacts', type_int16, along, units='1', long_name='impacts, or touches of a soft contact, '// &
                             'in a period of the orbit', &
                             data=[(real(count_contacts(points(i)%orbit), wp), i=1, size(points))])
    call schema%add_variable('event_word', type_float64, along, units='1', &
                             long_name='events of one period of the orbit, three bits each', &
                             data=[(real(word_of(points(i)%orbit, search), wp), i=1, size(points))])
    call schema%add_variable('stable', type_int8, along, units='1', long_name='all multipliers within the unit circle', &
                             flag_values=[0, 1], flag_meanings='unstable stable', &
                             data=[(merge(1.0_wp, 0.0_wp, is_stable(points(i)%orbit)), i=1, size(points))])
    call schema%add_variable('symmetric', type_int8, along, units='1', long_name='half a period later the orbit is its mirror '// &
                             'image', flag_values=[0, 1], flag_meanings='asymmetric symmetric', &
                             data=[(merge(1.0_wp, 0.0_wp, points(i)%symmetric), i=1, size(points))])
    call schema%add_variable('label', type_int8, along, units='1', long_name='what the point is', &
                             flag_values=[(i, i=0, last_label)], flag_meanings=join(label_names, ' '), &
                             data=real(points%label, wp))
    call describe_multipliers(points, shown, schema)

  contains

    subroutine add(name, units, long_name, values)
      character(len=*), intent(in) :: name, units, long_name
      real(wp), intent(in) :: values(:)
      call schema%add_variable(name, type_float64, along, units=units, long_name=long_name, data=values)
    end subroutine add

  end subroutine describe_branches

  !> Impacts and touches of soft contacts; a completed chatter is neither.
  pure integer function count_contacts(orbit)
    type(orbit_t), intent(in) :: orbit
    count_contacts = count(is_impact(orbit%events%kind) .or. orbit%events%kind == event_touch_upper .or. &
                           orbit%events%kind == event_touch_lower)
  end function count_contacts

  !> The first so many multipliers of the points.
  subroutine describe_multipliers(points, shown, schema)
    type(point_t), intent(in) :: points(:)
    integer, intent(in) :: shown
    type(schema_t), intent(inout) :: schema
    character(len=name_length), parameter :: over(2) = [character(len=name_length) :: 'point', 'multiplier']
    integer :: i, k
    call schema%add_variable('multiplier_real', type_float64, over, units='1', &
      long_name='multipliers over the period, real part', data=[((written_part(real(points(i)%orbit%multipliers(k), wp)), &
                                                                  k=1, shown), i=1, size(points))])
    call schema%add_variable('multiplier_imag', type_float64, over, units='1', &
      long_name='multipliers over the period, imaginary part', data=[((aimag(points(i)%orbit%multipliers(k)), k=1, shown), &
                                                                      i=1, size(points))])
  end subroutine describe_multipliers

  !> The real part of a multiplier as a file has it: infinite where the derivative grows without bound.
  elemental real(wp) function written_part(part)
    real(wp), intent(in) :: part
    written_part = part
    if (abs(part) >= unreachable) written_part = sign(ieee_value(1.0_wp, ieee_positive_inf), part)
  end function written_part

  !> Where the section points of orbits are.
  pure function section_text(has_clock) result(text)
    logical, intent(in) :: has_clock
    character(len=:), allocatable :: text
    text = 'where the watched coordinate turns round'
    if (has_clock) text = 'at crank angle 0'
  end function section_text

end module branches_driver
