! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The two runs of a sweep in its file and in the log: holds, where they had to be given up, limits.
module sweep_report
  use attractors, only: regime_impact, regime_names
  use case_type, only: contact_position => contact_law
  use constants, only: unreachable
  use derived_report, only: add_derived_column
  use contact_law, only: add_to_contact, barrier_positions, contact_of, contact_t
  use crank_summary, only: crank_numbers, crank_outcomes, crank_table, last_crank_outcome
  use file_layout, only: add_axes, add_reason, add_regime
  use journal, only: json_number
  use kinds, only: int64, wp
  use law_table, only: effect_family
  use limit_kind, only: kind_not_known, last_limit_kind, limit_kinds
  use map_schema, only: name_length, schema_t, type_float64, type_int16, type_int8
  use motor_choices, only: has_motor
  use build_pair, only: is_pair
  use restoring_law, only: position_is_angle
  use session, only: session_t
  use settling, only: marks_of_outcome
  use status, only: reason_names, reason_time_over
  use sweep_chain, only: chains_t, hold_crank, hold_cycle_time, hold_derived, hold_impacts, hold_outcome, hold_reason, limit_t
  use sweep_limits, only: limit_beyond_range, limit_bracketed, limit_outcomes
  use text, only: interval_text, join, replace_all, to_text
  implicit none
  private

  public :: describe_chains, report_given_up, report_limits

contains

  !> Run up and run down as variables, and the limits as a table.
  subroutine describe_chains(session, chains, schema)
    type(session_t), intent(in) :: session
    type(chains_t), intent(in) :: chains
    type(schema_t), intent(inout) :: schema
    character(len=name_length), allocatable :: swept(:)
    character(len=name_length) :: dimensions(2)
    call add_axes(schema, [session%the_case%sweep%swept], swept)
    call schema%add_dimension('direction', 2_int64)
    call schema%add_dimension('sample', int(session%the_case%sweep%samples, int64))
    dimensions = [character(len=name_length) :: 'direction', swept(1)]
    call add_regime(schema, 'regime', dimensions, .false.)
    call fill(1)
    call add_reason(schema, 'reason', dimensions, .false.)
    call fill(2)
    call add('period', type_int16, '1', 'period in drive periods of the cycle on which the motion settles, 0 = not known', 3)
    call add('event_word', type_float64, '1', 'events of one period of the motion, three bits each', 4)
    call add('impacts_per_period', type_float64, '1', 'impacts per drive period', 6)
    call add('mean_impact_speed', type_float64, 'm/s', 'mean speed just before impact', 7)
    call add('amplitude', type_float64, 'm', 'half the range of the position', 8)
    call add('x_max', type_float64, 'm', 'largest position', 9)
    call add('x_min', type_float64, 'm', 'smallest position', 10)
    call add('v_max', type_float64, 'm/s', 'largest velocity towards the upper barrier', 11)
    if (position_is_angle(session%the_case%laws)) then
      call add('rotation_number', type_float64, '1', 'turns of the angle per drive period, upwards', 12)
    end if
    if (has_motor(session%the_case%laws)) call add_crank()
    call add_derived(session, chains, dimensions, schema)
    call add_sections(chains, [dimensions, [character(len=name_length) :: 'sample']], schema)
    if (size(chains%limits) > 0) call add_limits(session, schema, chains%limits)
    call add_barriers(session, schema)

  contains

    subroutine add(name, type, units, long_name, row)
      character(len=*), intent(in) :: name, units, long_name
      integer, intent(in) :: type, row
      call schema%add_variable(name, type, dimensions, units=units, long_name=long_name)
      call fill(row)
    end subroutine add

    subroutine add_crank()
      integer :: i
      call schema%add_variable('crank_outcome', type_int8, dimensions, units='1', long_name='outcome of a run-up of the crank', &
                               flag_values=[(i, i=0, last_crank_outcome)], flag_meanings=join(crank_outcomes, ' '))
      call fill(hold_outcome)
      call add('cycle_time', type_float64, 's', 'time that one cycle takes, 0 = not known', hold_cycle_time)
      do i = 1, crank_numbers
        call add(trim(crank_table(i)%name), type_float64, trim(crank_table(i)%unit), trim(crank_table(i)%meaning), &
                 hold_crank + i - 1)
      end do
    end subroutine add_crank

    subroutine fill(row)
      integer, intent(in) :: row
      schema%variables(size(schema%variables))%data = reshape(chains%holds(row, :, :), [2*size(chains%holds, 2)])
    end subroutine fill

  end subroutine describe_chains

  !> The derived quantities of the holds.
  subroutine add_derived(session, chains, dimensions, schema)
    type(session_t), intent(in) :: session
    type(chains_t), intent(in) :: chains
    character(len=name_length), intent(in) :: dimensions(:)
    type(schema_t), intent(inout) :: schema
    integer :: i
    do i = 1, size(session%the_case%derived)
      call add_derived_column(session%the_case%derived(i), dimensions, &
                              reshape(chains%holds(hold_derived + i - 1, :, :), [2*size(chains%holds, 2)]), schema)
    end do
  end subroutine add_derived

  !> The last positions and velocities on the section.
  subroutine add_sections(chains, dimensions, schema)
    type(chains_t), intent(in) :: chains
    character(len=name_length), intent(in) :: dimensions(:)
    type(schema_t), intent(inout) :: schema
    call schema%add_variable('section_x', type_float64, dimensions, units='m', long_name='position at crank angle 0', &
                             data=reshape(chains%samples(1, :, :, :), [size(chains%samples)/2]))
    call schema%add_variable('section_v', type_float64, dimensions, units='m/s', long_name='velocity at crank angle 0', &
                             data=reshape(chains%samples(2, :, :, :), [size(chains%samples)/2]))
  end subroutine add_sections

  !> Positions of the barriers; one that is swept has none.
  subroutine add_barriers(session, schema)
    type(session_t), intent(in) :: session
    type(schema_t), intent(inout) :: schema
    real(wp), allocatable :: barriers(:)
    barriers = barriers_of(session)
    if (session%the_case%sweep%swept%name == 'contact.upper') barriers(1) = huge(1.0_wp)
    if (session%the_case%sweep%swept%name == 'contact.lower') barriers(2) = -huge(1.0_wp)
    if (barriers(1) < unreachable) call schema%add_attribute('', 'barrier_upper', barriers(1))
    if (barriers(2) > -unreachable) call schema%add_attribute('', 'barrier_lower', barriers(2))
  end subroutine add_barriers

  function barriers_of(session) result(barriers)
    type(session_t), intent(in) :: session
    real(wp) :: barriers(2)
    type(contact_t) :: contact
    integer :: i
    associate (laws => session%the_case%laws)
      contact = contact_of(laws(contact_position), mass=1.0_wp)
      do i = 1, size(laws)
        if (laws(i)%family == effect_family) call add_to_contact(contact, laws(i))
      end do
    end associate
    barriers = barrier_positions(contact)
  end function barriers_of

  subroutine add_limits(session, schema, limits)
    type(session_t), intent(in) :: session
    type(schema_t), intent(inout) :: schema
    type(limit_t), intent(in) :: limits(:)
    character(len=40) :: names(size(limits))
    character(len=:), allocatable :: unit, meanings
    real(wp) :: codes(size(limits))
    integer :: i, kinds, earlier
    unit = trim(session%the_case%sweep%swept%unit)
    do i = 1, size(limits)
      names(i) = limit_name(session, limits(i))
    end do
    kinds = 0
    meanings = ''
    do i = 1, size(limits)
      earlier = findloc(names(:i - 1), names(i), 1)
      if (earlier > 0) then
        codes(i) = codes(earlier)
        cycle
      end if
      codes(i) = kinds
      kinds = kinds + 1
      meanings = trim(meanings//' '//names(i))
    end do
    call schema%add_dimension('limit', size(limits, kind=int64))
    call schema%add_variable('name', type_int8, ['limit'], units='1', group='limits', data=codes, &
                             long_name='where impacts start or stop, or a regime of two bodies gives way', &
                             flag_values=[(i, i=0, kinds - 1)], flag_meanings=trim(adjustl(meanings)))
    call schema%add_variable('settled', type_int8, ['limit'], units='1', group='limits', data=real(limits%outcome, wp), &
                             long_name='what is known of the end of the settled motion', &
                             flag_values=[(i, i=0, ubound(limit_outcomes, 1))], flag_meanings=join(limit_outcomes, ' '))
    call add('lower', 'lower end of the bracket in which the settled motion ends', limits%bracket(1))
    call add('upper', 'upper end of the bracket in which the settled motion ends', limits%bracket(2))
    call add('observed_lower', 'lower end of the bracket in which the change is seen in steps', limits%observed(1))
    call add('observed_upper', 'upper end of the bracket in which the change is seen in steps', limits%observed(2))
    if (.not. has_motor(session%the_case%laws)) return
    call schema%add_variable('kind', type_int8, ['limit'], units='1', group='limits', data=real(limits%kind, wp), &
                             long_name='bifurcation that ends the settled cycle', flag_values=[(i, i=0, last_limit_kind)], &
                             flag_meanings=join(limit_kinds, ' '))
    call add('value', 'value of that bifurcation', limits%at)
    unit = 'rad/s'
    call add('crank_speed_before', 'mean speed of the crank before the change in steps', limits%speed(1))
    call add('crank_speed_after', 'mean speed of the crank after the change in steps', limits%speed(2))

  contains

    subroutine add(name, long_name, values)
      character(len=*), intent(in) :: name, long_name
      real(wp), intent(in) :: values(:)
      call schema%add_variable(name, type_float64, ['limit'], units=unit, long_name=long_name, data=values, group='limits')
    end subroutine add

  end subroutine add_limits

  !> What happens at a limit: impacts start or stop, or one regime of two bodies or outcome of a motor gives way to another; else
  !> the bifurcation.
  pure function limit_name(session, limit) result(name)
    type(session_t), intent(in) :: session
    type(limit_t), intent(in) :: limit
    character(len=:), allocatable :: name
    if (is_pair(session%the_case%laws)) then
      name = trim(regime_names(limit%from))//'_to_'//trim(regime_names(limit%to))
    else
      associate (from => modulo(limit%from, marks_of_outcome), to => modulo(limit%to, marks_of_outcome))
        if (from /= to) then
          name = 'impacts_'//trim(merge('start', 'stop ', to == regime_impact))
        else if (limit%from == limit%to) then
          name = trim(limit_kinds(limit%kind))
        else
          name = trim(crank_outcomes(limit%from/marks_of_outcome))//'_to_'//trim(crank_outcomes(limit%to/marks_of_outcome))
        end if
      end associate
    end if
    name = name//'_'//trim(merge('up  ', 'down', limit%up))
  end function limit_name

  !> Where holds had to be given up, and why: ranges of the parameter.
  subroutine report_given_up(session, chains)
    type(session_t), intent(inout) :: session
    type(chains_t), intent(in) :: chains
    integer :: direction, i, first, reason
    associate (reasons => nint(chains%holds(hold_reason, :, :)), values => session%the_case%sweep%swept%values)
      do direction = 1, 2
        first = 1
        do i = 1, size(values)
          reason = reasons(i, direction)
          if (i < size(values)) then
            if (reasons(i + 1, direction) == reason) cycle
          end if
          if (chains%ran(direction) .and. reason /= reason_time_over) then
            call session%journal%line('given_up', '  run '//trim(merge('up  ', 'down', direction == 1))//': given up from '// &
              to_text(values(first), 6)//' to '//to_text(values(i), 6)//' as '//trim(reason_names(reason)), &
              '"reason": "'//trim(reason_names(reason))//'", "from": '//to_text(values(first))//', "to": '//to_text(values(i)))
          end if
          first = i + 1
        end do
      end do
    end associate
  end subroutine report_given_up

  subroutine report_limits(session, chains)
    type(session_t), intent(inout) :: session
    type(chains_t), intent(in) :: chains
    character(len=:), allocatable :: name
    integer :: i
    associate (limits => chains%limits)
      do i = 1, size(limits)
        name = limit_name(session, limits(i))
        call session%journal%line('limit', '  run '//trim(merge('up  ', 'down', limits(i)%up))//': '// &
          replace_all(name(:index(name, '_', back=.true.) - 1), '_', ' ')//' '//limit_text(limits(i))//crank_text(limits(i)), &
          '"name": "'//name//'", "settled": "'//trim(limit_outcomes(limits(i)%outcome))//'", "lower": '// &
          json_number(limits(i)%bracket(1))//', "upper": '//json_number(limits(i)%bracket(2))//', "observed_lower": '// &
          json_number(limits(i)%observed(1))//', "observed_upper": '//json_number(limits(i)%observed(2))//crank_json(limits(i)))
      end do
    end associate
    if (size(chains%limits) > 0) return
    if (any(count(nint(chains%holds(hold_reason, :, :)) == reason_time_over, dim=1) < size(chains%holds, 2) .and. &
            chains%ran)) then
      call session%journal%line('limit', '  no limit seen between the values that were not given up')
    else if (is_pair(session%the_case%laws)) then
      call session%journal%line('limit', '  one regime throughout')
    else if (.not. any(chains%holds(hold_impacts, :, :) > 0)) then
      call session%journal%line('limit', '  no impacts throughout')
    else
      call session%journal%line('limit', '  impacts neither start nor stop')
    end if

  contains

    !> What ends the cycle of a motor, and the jump of its speed.
    function crank_text(limit) result(text)
      type(limit_t), intent(in) :: limit
      character(len=:), allocatable :: text
      text = ''
      if (.not. has_motor(session%the_case%laws)) return
      text = '; the crank goes from '//to_text(limit%speed(1), 6)//' to '//to_text(limit%speed(2), 6)//' rad/s'
      if (limit%kind == kind_not_known) return
      text = '; '//replace_all(trim(limit_kinds(limit%kind)), '_', '-')//' at '//to_text(limit%at, 12)//text
    end function crank_text

    function crank_json(limit) result(text)
      type(limit_t), intent(in) :: limit
      character(len=:), allocatable :: text
      text = ''
      if (.not. has_motor(session%the_case%laws)) return
      text = ', "kind": "'//trim(limit_kinds(limit%kind))//'", "value": '//json_number(limit%at)//', "crank_speed_before": '// &
        json_number(limit%speed(1))//', "crank_speed_after": '//json_number(limit%speed(2))
    end function crank_json

  end subroutine report_limits

  !> Where a limit is, with as many digits as its brackets are worth.
  pure function limit_text(limit) result(text)
    type(limit_t), intent(in) :: limit
    character(len=:), allocatable :: text
    text = 'between '//interval_text(limit%observed, ' and ')//' in steps'
    select case (limit%outcome)
    case (limit_bracketed)
      text = 'between '//interval_text(limit%bracket, ' and ')//'; in steps between '//interval_text(limit%observed, ' and ')
    case (limit_beyond_range)
      text = text//'; settled, the motion goes on to the end of the range'
    case default
      if (limit%kind == kind_not_known) text = text//'; where the settled motion ends is not known'
    end select
  end function limit_text

end module sweep_report
