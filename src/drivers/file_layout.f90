! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The variables of each kind of file, as docs/file-format.md lists them.
module file_layout
  use attractors, only: attractor_t, kind_chaotic, kind_cycle, kind_names, kind_not_known, last_kind, last_regime, regime_names
  use axis, only: axis_t
  use basin, only: catalogue_t
  use crank_summary, only: crank_outcomes, last_crank_outcome
  use kinds, only: int64, wp
  use law_table, only: law_choice_t
  use map_schema, only: name_length, schema_t, type_float64, type_int16, type_int32, type_int64, type_int8
  use motion_state, only: event_names
  use point_columns, only: map_values, margin_or_infinite, marks_of_attractor, point_table
  use status, only: last_reason, reason_names
  use refinement, only: last_origin, origin_names
  use text, only: join, replace_all
  use value_types, only: type_named
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: axis_dimension, add_axes, add_map_variables, add_refined_variables, add_catalogue, add_regime, add_reason, add_events

  character(len=*), parameter :: coded_unit = '1'

contains

  !> Name of a parameter or start in a file: drive_sine_2 for drive.sine[2].
  pure function axis_dimension(name) result(dimension)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: dimension
    dimension = replace_all(replace_all(replace_all(trim(name), '.', '_'), '[', '_'), ']', '')
  end function axis_dimension

  !> Dimensions and coordinate variables of the axes; returns the dimension names.
  subroutine add_axes(schema, axes, dimensions)
    type(schema_t), intent(inout) :: schema
    type(axis_t), intent(in) :: axes(:)
    character(len=name_length), allocatable, intent(out) :: dimensions(:)
    integer :: i
    allocate (dimensions(size(axes)))
    do i = 1, size(axes)
      dimensions(i) = axis_dimension(axes(i)%name)
      call schema%add_dimension(trim(dimensions(i)), size(axes(i)%values, kind=int64))
      call schema%add_variable(trim(dimensions(i)), type_float64, [dimensions(i)], units=axes(i)%unit, &
                               long_name=axis_meaning(axes(i)%name), data=axes(i)%values)
    end do
  end subroutine add_axes

  pure function axis_meaning(name) result(meaning)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: meaning
    select case (name)
    case ('x0')
      meaning = 'initial position'
    case ('v0')
      meaning = 'initial velocity'
    case ('crank_angle')
      meaning = 'initial crank angle'
    case ('drive.ratio')
      meaning = 'drive angular frequency over natural angular frequency'
    case default
      meaning = replace_all(replace_all(trim(name), '.', ' '), '_', ' ')
    end select
  end function axis_meaning

  !> Regime with its codes.
  subroutine add_regime(schema, name, dimensions, tiled, group, data)
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: name, dimensions(:)
    logical, intent(in) :: tiled
    character(len=*), intent(in), optional :: group
    real(wp), intent(in), optional :: data(:)
    integer :: i
    call schema%add_variable(name, type_int8, dimensions, units=coded_unit, &
      long_name='regime of the motion', flag_values=[(i, i=0, last_regime)], &
      flag_meanings=join(regime_names, ' '), tiled=tiled, data=data, group=group)
  end subroutine add_regime

  !> Why trajectories ended, with codes.
  subroutine add_reason(schema, name, dimensions, tiled)
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: name, dimensions(:)
    logical, intent(in) :: tiled
    integer :: i
    call schema%add_variable(name, type_int8, dimensions, units=coded_unit, &
      long_name='why the trajectory ended', flag_values=[(i, i=0, last_reason)], &
      flag_meanings=join(reason_names, ' '), tiled=tiled)
  end subroutine add_reason

  !> The variables of a map's points; names get `prefix`.
  subroutine add_map_variables(schema, prefix, dimensions, choices)
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: prefix, dimensions(:)
    type(law_choice_t), intent(in) :: choices(:)
    call add_columns(schema, prefix, dimensions, map_values(choices))
  end subroutine add_map_variables

  !> The first `count` columns of points.
  subroutine add_columns(schema, prefix, dimensions, count)
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: prefix, dimensions(:)
    integer, intent(in) :: count
    integer :: i, k
    do k = 1, count
      associate (column => point_table(k))
        select case (column%name)
        case ('regime')
          call add_regime(schema, prefix//'regime', dimensions, .true.)
        case ('reason')
          call add_reason(schema, prefix//'reason', dimensions, .true.)
        case ('crank_outcome')
          call schema%add_variable(prefix//'crank_outcome', type_int8, dimensions, units=coded_unit, &
            long_name=trim(column%meaning), flag_values=[(i, i=0, last_crank_outcome)], &
            flag_meanings=join(crank_outcomes, ' '), tiled=.true.)
        case default
          call schema%add_variable(prefix//trim(column%name), type_named(column%type), dimensions, units=trim(column%unit), &
                                   long_name=trim(column%meaning), tiled=.true.)
        end select
      end associate
    end do
  end subroutine add_columns

  !> The variables of a refined map's points: those that all points of a cell share, and where they come from.
  subroutine add_refined_variables(schema, dimensions)
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: dimensions(:)
    integer :: i
    call add_columns(schema, '', dimensions, marks_of_attractor)
    call schema%add_variable('origin', type_int8, dimensions, units=coded_unit, &
      long_name='whether the point was computed, or inferred from the corners of a cell of at most so many points', &
      flag_values=[(i, i=0, last_origin)], flag_meanings=join(origin_names, ' '), tiled=.true.)
  end subroutine add_refined_variables

  !> The catalogue as a table; `counts(entry)` = points captured.
  subroutine add_catalogue(schema, catalogues, counts, two_bodies)
    type(schema_t), intent(inout) :: schema
    logical, intent(in) :: two_bodies
    type(catalogue_t), intent(in) :: catalogues(:)
    integer(int64), intent(in) :: counts(:)
    type(attractor_t), allocatable :: all_of_them(:)
    integer, allocatable :: slice(:)
    integer :: i
    call put_together(catalogues, all_of_them, slice)
    if (size(all_of_them) == 0) return
    call schema%add_dimension('entry', size(all_of_them, kind=int64))
    call add('slice', type_int32, '1', 'slice of the parameter axes, C order from 0', real(slice, wp))
    call add('attractor', type_int32, '1', 'label', real(all_of_them%id, wp))
    call add_regime(schema, 'regime', ['entry'], .false., group='catalogue', data=real(all_of_them%features%regime, wp))
    call add('period', type_int16, '1', 'period in drive periods', real(all_of_them%period, wp))
    call add('cycle_time', type_float64, 's', 'time that one cycle takes; 0 of what is none', all_of_them%duration)
    call add('event_word', type_float64, '1', 'events of one period', real(all_of_them%features%word, wp))
    call add('x', type_float64, 'm', 'position at the section, crank angle 0', all_of_them%section(1))
    call add('v', type_float64, 'm/s', 'velocity at the section, crank angle 0', all_of_them%section(2))
    if (two_bodies) call add('driver_x', type_float64, 'm', 'position of the driving body there', all_of_them%section(3))
    if (two_bodies) call add('driver_v', type_float64, 'm/s', 'velocity of the driving body there', all_of_them%section(4))
    call add('multiplier', type_float64, '1', 'largest modulus of the multipliers', all_of_them%multiplier)
    call add('capture_radius', type_float64, '1', 'radius of the neighbourhood found to contract', &
             all_of_them%capture_radius)
    call add('amplitude', type_float64, 'm', 'half the range of the position', all_of_them%features%amplitude)
    call add('x_max', type_float64, 'm', 'largest position', all_of_them%features%x_max)
    call add('x_min', type_float64, 'm', 'smallest position', all_of_them%features%x_min)
    call add('v_max', type_float64, 'm/s', 'largest velocity', all_of_them%features%v_max)
    call add('impacts_per_period', type_float64, '1', 'impacts per drive period', &
             all_of_them%features%impacts_per_period)
    call add('mean_impact_speed', type_float64, 'm/s', 'mean speed before impact', &
             all_of_them%features%mean_impact_speed)
    call add('grazing_margin', type_float64, 'm', 'smallest distance to a barrier missed', &
             margin_or_infinite(all_of_them%features%grazing_margin))
    if (any(all_of_them%turn > 0 .or. abs(all_of_them%features%rotation) > 0)) then
      call add('rotation_number', type_float64, '1', 'turns of the angle per drive period, upwards; without a drive, per cycle', &
      merge(all_of_them%features%rotation, ieee_value(1.0_wp, ieee_quiet_nan), all_of_them%kind /= kind_chaotic .and. &
            all_of_them%kind /= kind_not_known))
    end if
    call add('count', type_int64, '1', 'points of the map captured', real(counts, wp))
    call schema%add_variable('kind', type_int8, ['entry'], units=coded_unit, group='catalogue', &
      long_name='whether it is a cycle, rest, chaotic, a family of cycles, or nothing of them is known', &
      flag_values=[(i, i=1, last_kind)], flag_meanings=join(kind_names, ' '), data=real(all_of_them%kind, wp))
    call add_cycles(schema, all_of_them)

  contains

    subroutine add(name, type, units, long_name, data)
      character(len=*), intent(in) :: name, units, long_name
      integer, intent(in) :: type
      real(wp), intent(in) :: data(:)
      call schema%add_variable(name, type, ['entry'], units=units, long_name=long_name, data=data, &
                               group='catalogue')
    end subroutine add

  end subroutine add_catalogue

  !> The attractors of all slices in one list, and the slice of each, from 0.
  subroutine put_together(catalogues, attractors, slice)
    type(catalogue_t), intent(in) :: catalogues(:)
    type(attractor_t), allocatable, intent(out) :: attractors(:)
    integer, allocatable, intent(out) :: slice(:)
    integer :: i, k, position
    position = sum([(size(catalogues(i)%attractors), i=1, size(catalogues))])
    allocate (attractors(position), slice(position))
    position = 0
    do i = 1, size(catalogues)
      do k = 1, size(catalogues(i)%attractors)
        position = position + 1
        attractors(position) = catalogues(i)%attractors(k)
        slice(position) = i - 1
      end do
    end do
  end subroutine put_together

  !> All multipliers and all section points of the cycles of a catalogue.
  subroutine add_cycles(schema, entries)
    type(schema_t), intent(inout) :: schema
    type(attractor_t), intent(in) :: entries(:)
    real(wp), allocatable :: point(:), entry(:), multiplier(:, :, :)
    real(wp) :: none
    integer :: i, k, n, coordinates
    none = ieee_value(1.0_wp, ieee_quiet_nan)
    coordinates = maxval(entries%coordinates)
    allocate (multiplier(2, coordinates, size(entries)), source=none)
    allocate (point(0), entry(0))
    do i = 1, size(entries)
      if (entries(i)%kind /= kind_cycle) cycle
      n = entries(i)%coordinates
      multiplier(1, :n, i) = real(entries(i)%multipliers(:n))
      multiplier(2, :n, i) = aimag(entries(i)%multipliers(:n))
      entry = [entry, [(real(i - 1, wp), k=1, entries(i)%period)]]
      do k = 1, entries(i)%period
        point = [point, entries(i)%points(:n, k), spread(none, 1, coordinates - n)]
      end do
    end do
    call schema%add_dimension('coordinate', int(coordinates, int64))
    call add('multiplier_real', ['entry     ', 'coordinate'], '1', 'real parts of the multipliers', &
             reshape(multiplier(1, :, :), [size(multiplier)/2]))
    call add('multiplier_imaginary', ['entry     ', 'coordinate'], '1', 'imaginary parts of the multipliers', &
             reshape(multiplier(2, :, :), [size(multiplier)/2]))
    if (size(entry) == 0) return
    call schema%add_dimension('cycle_point', size(entry, kind=int64))
    call schema%add_variable('point_entry', type_int32, ['cycle_point'], units='1', group='catalogue', data=entry, &
                             long_name='entry that has the section point, from 0; its points are in order of time')
    call add('point', ['cycle_point', 'coordinate '], 'SI', 'section points of the cycles: of one body x and v', point)

  contains

    subroutine add(name, dimensions, units, long_name, data)
      character(len=*), intent(in) :: name, dimensions(:), units, long_name
      real(wp), intent(in) :: data(:)
      call schema%add_variable(name, type_float64, dimensions, units=units, long_name=long_name, data=data, group='catalogue')
    end subroutine add

  end subroutine add_cycles

  !> The events of a trajectory: rows of `data` are time, x, v before, v after.
  subroutine add_events(schema, kinds_of_event, data)
    type(schema_t), intent(inout) :: schema
    integer, intent(in) :: kinds_of_event(:)
    real(wp), intent(in) :: data(:, :)
    integer :: i
    call schema%add_dimension('event', size(kinds_of_event, kind=int64))
    call schema%add_variable('event_kind', type_int8, ['event'], units=coded_unit, long_name='kind of event', &
      flag_values=[(i, i=1, size(event_names))], flag_meanings=join(event_names, ' '), &
      data=real(kinds_of_event, wp))
    call schema%add_variable('event_time', type_float64, ['event'], units='s', long_name='time of the event', &
                             data=data(1, :))
    call schema%add_variable('event_x', type_float64, ['event'], units='m', long_name='position', data=data(2, :))
    call schema%add_variable('event_v_before', type_float64, ['event'], units='m/s', &
                             long_name='velocity just before', data=data(3, :))
    call schema%add_variable('event_v_after', type_float64, ['event'], units='m/s', &
                             long_name='velocity just after', data=data(4, :))
  end subroutine add_events

end module file_layout
