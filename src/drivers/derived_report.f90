! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Derived quantities in files and in the log: of the attractors of a map, of one motion.
module derived_report
  use attractors, only: attractor_t
  use basin, only: catalogue_t
  use derived_quantities, only: derived_t
  use derived_values, only: derive_attractor, derive_over
  use entry_walk, only: begin_walk, entry_walk_t
  use grid, only: grid_t, slice_laws
  use journal, only: json_number, journal_t
  use kinds, only: int64, wp
  use machine_type, only: machine_t, section_state_t
  use map_schema, only: schema_t, type_float64
  use motion_state, only: tally_t
  use single_trajectory, only: span_t
  use status, only: reason_time_over
  use team, only: team_t
  use text, only: to_text
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: add_derived_catalogue, add_derived_column, describe_derived, report_derived

contains

  !> Adds a column of the catalogue for each quantity. The ranks share the slices.
  subroutine add_derived_catalogue(team, grid, catalogues, span, schema)
    class(team_t), intent(in) :: team
    type(grid_t), intent(in) :: grid
    type(catalogue_t), intent(in) :: catalogues(:)
    type(span_t), intent(in) :: span
    type(schema_t), intent(inout) :: schema
    real(wp), allocatable :: values(:, :)
    integer :: i
    if (size(grid%derived) == 0) return
    call derive_entries(team, grid, catalogues, span, values)
    if (size(values, 2) == 0) return
    do i = 1, size(grid%derived)
      call add_derived_column(grid%derived(i), ['entry'], values(i, :), schema, 'catalogue')
    end do
  end subroutine add_derived_catalogue

  !> Adds the values of one quantity over some dimensions.
  subroutine add_derived_column(one, dimensions, values, schema, group)
    type(derived_t), intent(in) :: one
    character(len=*), intent(in) :: dimensions(:)
    real(wp), intent(in) :: values(:)
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in), optional :: group
    call schema%add_variable('derived_'//trim(one%name), type_float64, dimensions, units=one%unit, own_units=.true., &
                             long_name=derived_meaning(one)//' over the cycle or window', data=values, group=group)
  end subroutine add_derived_column

  !> Quantities (rows) of every entry (columns), slice after slice.
  subroutine derive_entries(team, grid, catalogues, span, values)
    class(team_t), intent(in) :: team
    type(grid_t), intent(in) :: grid
    type(catalogue_t), intent(in) :: catalogues(:)
    type(span_t), intent(in) :: span
    real(wp), allocatable, intent(out) :: values(:, :)
    type(entry_walk_t) :: walk
    real(wp), dimension(size(grid%derived)) :: numbers, not_known
    logical :: found
    walk = begin_walk(team, catalogues)
    do
      call walk%next(grid, found)
      if (.not. found) exit
      call derive_attractor(walk%machine, slice_laws(grid, int(walk%catalogue - 1, int64)), grid%derived, &
                            catalogues(walk%catalogue)%attractors, walk%attractor, span, numbers)
      call walk%note(numbers)
    end do
    not_known = ieee_value(1.0_wp, ieee_quiet_nan)
    call walk%gather(team, not_known, values)
  end subroutine derive_entries

  !> Quantities of one motion from the start of a grid: over the `cycle` on which it has settled; what that does not determine over
  !> the window at its end.
  pure subroutine derive_motion(moving, grid, span, cycle, values)
    class(machine_t), intent(in) :: moving
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    type(attractor_t), intent(in) :: cycle
    real(wp), allocatable, intent(out) :: values(:)
    type(section_state_t) :: section
    type(tally_t) :: tally
    real(wp) :: origin, until, at_end(size(grid%derived))
    integer :: reason
    allocate (values(size(grid%derived)), source=ieee_value(1.0_wp, ieee_quiet_nan))
    if (size(values) == 0) return
    if (cycle%period > 0) then
      call derive_attractor(moving, grid%laws, grid%derived, [cycle], 1, span, values)
      if (.not. any(ieee_is_nan(values))) return
    end if
    call moving%start(grid%start, section)
    call moving%begin_tally(section, tally)
    origin = -section%state%time
    until = span%duration - span%window
    reason = 0
    do while (reason == 0 .and. until - origin > section%state%time)
      if (moving%timed .and. until - origin >= moving%period) then
        call moving%advance_to_section(section, tally, reason)
        origin = origin + moving%period
      else
        call moving%advance(section, until - origin, tally, reason)
        if (moving%timed .or. .not. section%passed) exit
        origin = origin + section%lasted
      end if
      tally%events = 0
      tally%steps = 0
    end do
    if (reason /= 0) return
    call derive_over(moving, grid%laws, grid%derived, section, span%window, span%window/moving%period, at_end)
    where (ieee_is_nan(values)) values = at_end
  end subroutine derive_motion

  !> Quantities of a motion that ended for a `reason`, as attributes; not numbers unless its time was over.
  subroutine describe_derived(moving, grid, span, cycle, reason, values, schema)
    class(machine_t), intent(in) :: moving
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    type(attractor_t), intent(in) :: cycle
    integer, intent(in) :: reason
    real(wp), allocatable, intent(out) :: values(:)
    type(schema_t), intent(inout) :: schema
    integer :: i
    if (reason == reason_time_over) then
      call derive_motion(moving, grid, span, cycle, values)
    else
      allocate (values(size(grid%derived)), source=ieee_value(1.0_wp, ieee_quiet_nan))
    end if
    do i = 1, size(values)
      call schema%add_attribute('', 'derived_'//trim(grid%derived(i)%name), values(i))
      call schema%add_attribute('', 'derived_'//trim(grid%derived(i)%name)//'_units', grid%derived(i)%unit)
    end do
  end subroutine describe_derived

  !> A line each.
  subroutine report_derived(journal, derived, values)
    type(journal_t), intent(inout) :: journal
    type(derived_t), intent(in) :: derived(:)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: value
    integer :: i
    do i = 1, size(derived)
      value = to_text(values(i), 8)//' '//derived(i)%unit
      if (derived(i)%unit == '1') value = to_text(values(i), 8)
      if (ieee_is_nan(values(i))) value = 'not known'
      call journal%line('derived', '  '//trim(derived(i)%name)//': '//value//' ('//derived_meaning(derived(i))//')', &
                        '"name": "'//trim(derived(i)%name)//'", "value": '//json_number(values(i)))
    end do
  end subroutine report_derived

  !> What a quantity is.
  pure function derived_meaning(one) result(text)
    type(derived_t), intent(in) :: one
    character(len=:), allocatable :: text
    select case (one%quantity)
    case ('power')
      text = 'mean power lost to '//one%expression
      if (one%expression == 'drive') text = 'mean power put in by the drive'
    case ('drift')
      text = 'change per period of '//one%expression
    case default
      text = trim(one%quantity)//' of '//one%expression
    end select
  end function derived_meaning

end module derived_report
