! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Machines over a parameter of their laws, whatever they are made of: one body or a structure.
module machine_family
  use body_events, only: events_of_body
  use body_family, only: body_neighbourhood, body_of_family, family_t, fly_periods, map_of_body => map_with_variation
  use build_motion, only: has_several
  use circle, only: point_near
  use errors, only: error_t
  use hybrid_machine, only: event_t, hybrid_t
  use multibody_log, only: watched_state
  use multibody_motion, only: start_multibody
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use motion, only: advance_period, start_state
  use motion_state, only: log_t, open_log, state_t, tally_t
  use one_body, only: one_body_t
  use structure, only: coordinates_of, structure_t
  use machine_type, only: machine_t, section_state_t
  use structure_family, only: map_of_structure, state_at_start, structure_neighbourhood, structure_of_family
  use structure_walk, only: advance_section, advance_to_section, fly_structure, start_of_structure
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: machine_of_family, machine_neighbourhood, fly_to_section, fly_sections, map_with_variation, &
    section_sizes, nearest_copy, within_stops, watched_rows, starts_of_section, section_of_section, begin_walk, walk_on

  !> A motion that goes from section to section.
  type, public :: walk_t
    type(state_t) :: body
    type(multibody_state_t) :: multibody
  end type walk_t

contains

  !> The machine with the parameter at `value`. Code 65 if it cannot be built or its variations are not known.
  subroutine machine_of_family(family, value, machine, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    class(hybrid_t), allocatable, intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(one_body_t) :: body
    type(structure_t) :: structure
    if (has_several(family%laws)) then
      call structure_of_family(family, value, structure, error)
      if (.not. allocated(error)) allocate (machine, source=structure)
    else
      call body_of_family(family, value, body, error)
      if (.not. allocated(error)) allocate (machine, source=body)
    end if
  end subroutine machine_of_family

  !> The machine and its neighbours in the parameter.
  pure subroutine machine_neighbourhood(family, value, machines, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(neighbourhood_t), intent(out) :: machines
    type(error_t), allocatable, intent(out) :: error
    if (has_several(family%laws)) then
      call structure_neighbourhood(family, value, machines, error)
    else
      call body_neighbourhood(family, value, machines, error)
    end if
  end subroutine machine_neighbourhood

  !> Flies a machine from a start as `start_section` has it to its first section: where it then is, and the events on the way.
  !> `ok` is false for a start beyond a stop, and if the trajectory had to be given up.
  pure subroutine fly_to_section(machine, start, point, events, ok)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: start(:)
    real(wp), intent(out) :: point(:)
    type(event_t), allocatable, intent(out) :: events(:)
    logical, intent(out) :: ok
    type(state_t) :: before, state
    type(multibody_state_t) :: multibody
    type(tally_t) :: tally
    type(log_t) :: log
    real(wp) :: lasted
    integer :: reason, mode, count_events
    logical :: certain
    ok = .false.
    point = 0
    select type (machine)
    type is (one_body_t)
      call open_log(log, 0.0_wp)
      log%balance%kept = .false.
      before = start_state(machine%moving, start(1), start(2), start(3))
      state = before
      call advance_period(machine%moving, state, tally, reason, log)
      ok = reason == 0
      if (.not. ok) return
      point = [state%x, state%v]
      call events_of_body(machine, before, log, state, .true., events, mode)
    type is (structure_t)
      multibody = state_at_start(machine, start)
      ok = .not. any(multibody%q /= multibody%q)
      if (.not. ok) return
      allocate (events(8))
      count_events = 0
      lasted = 0
      call advance_section(machine, multibody, lasted, events, count_events, tally, reason, certain)
      ok = reason == 0
      events = events(:count_events)
      if (ok) point = coordinates_of(machine, multibody)
    end select
  end subroutine fly_to_section

  !> The state of a trajectory of the same machine on the section. `ok` is false for a point beyond a stop.
  pure subroutine section_of_section(machine, moving, point, section, ok)
    class(hybrid_t), intent(in) :: machine
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    type(section_state_t), intent(out) :: section
    logical, intent(out) :: ok
    ok = .true.
    select type (machine)
    type is (structure_t)
      call start_of_structure(machine, point, section%multibody, ok)
      if (ok) section%state = watched_state(machine%frame%moving%machine, section%multibody)
    class default
      section = moving%start([point, 0.0_wp])
    end select
  end subroutine section_of_section

  !> A motion from a point of the section. `ok` is false for one beyond a stop.
  pure subroutine begin_walk(machine, point, walk, ok)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: point(:)
    type(walk_t), intent(out) :: walk
    logical, intent(out) :: ok
    ok = .true.
    select type (machine)
    type is (one_body_t)
      walk%body = start_state(machine%moving, point(1), point(2), 0.0_wp)
    type is (structure_t)
      call start_of_structure(machine, point, walk%multibody, ok)
    end select
  end subroutine begin_walk

  !> Takes a motion on to the next section, where it is at `point`. `ok` is false if it had to be given up.
  pure subroutine walk_on(machine, walk, point, ok)
    class(hybrid_t), intent(in) :: machine
    type(walk_t), intent(inout) :: walk
    real(wp), intent(out) :: point(:)
    logical, intent(out) :: ok
    type(tally_t) :: tally
    real(wp) :: lasted
    integer :: reason
    reason = 0
    point = 0
    select type (machine)
    type is (one_body_t)
      call advance_period(machine%moving, walk%body, tally, reason)
      point = [walk%body%x, walk%body%v]
    type is (structure_t)
      call advance_to_section(machine, walk%multibody, lasted, tally, reason)
      point = coordinates_of(machine, walk%multibody)
    end select
    ok = reason == 0
  end subroutine walk_on

  !> Flies a machine from a section point over so many sections: where it then is, the mode in which it began, and the events on
  !> the way, with `collapsed` a completed chatter as one. `ok` is false if the trajectory had to be given up.
  pure subroutine fly_sections(machine, point, sections, collapsed, image, events, mode, tally, ok)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: sections
    logical, intent(in) :: collapsed
    real(wp), intent(out) :: image(:)
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(out) :: mode
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    ok = .false.
    image = point
    mode = 0
    select type (machine)
    type is (one_body_t)
      call fly_periods(machine, point, sections, collapsed, image, events, mode, tally, ok)
    type is (structure_t)
      call fly_structure(machine, point, sections, image, events, mode, tally, ok)
    end select
  end subroutine fly_sections

  !> Image of a section point after so many sections, its derivatives by the point (and by the parameter), and what happened on
  !> the way. `ok` is false if the trajectory had to be given up or the derivatives are not known.
  pure subroutine map_with_variation(machines, point, sections, image, by_start, tally, ok, by_parameter)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: sections
    real(wp), intent(out) :: image(:), by_start(:, :)
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: by_parameter(:)
    ok = .false.
    image = point
    by_start = 0
    select type (machine => machines%centre)
    type is (one_body_t)
      call map_of_body(machines, point, sections, image, by_start, tally, ok, by_parameter)
    type is (structure_t)
      call map_of_structure(machines, point, sections, image, by_start, tally, ok, by_parameter)
    end select
  end subroutine map_with_variation

  !> Natural sizes of a position and of a speed.
  pure function section_sizes(machine) result(sizes)
    class(hybrid_t), intent(in) :: machine
    real(wp) :: sizes(2)
    sizes = machine%size_of([1, machine%positions + 1])
  end function section_sizes

  !> The copy of a point nearest to another: an angle is on a circle.
  pure function nearest_copy(machine, point, other) result(nearest)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: point(:), other(:)
    real(wp) :: nearest(size(point))
    nearest = point
    select type (machine)
    type is (one_body_t)
      nearest = point_near(point, other, machine%moving%machine%turn)
    end select
  end function nearest_copy

  !> Rows that give position [m] and speed [m/s] of what is watched from a section point.
  pure function watched_rows(machine) result(rows)
    class(hybrid_t), intent(in) :: machine
    real(wp) :: rows(2, machine%n)
    rows = 0
    select type (machine)
    type is (structure_t)
      rows = machine%watched
    class default
      rows(1, 1) = 1
      rows(2, 2) = 1
    end select
  end function watched_rows

  !> Section points (columns) for searches: `watched` (columns) are positions and speeds of what is watched. Of a structure the
  !> other coordinates of every second one are those of the machine, those of the rest spread evenly over twice their sizes, or
  !> over the share `spread` of that, start by start.
  pure function starts_of_section(machine, watched, spread) result(points)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: watched(:, :)
    real(wp), intent(in), optional :: spread(:)
    real(wp) :: points(machine%n, size(watched, 2))
    type(multibody_state_t) :: state
    real(wp) :: share
    integer :: i, k
    logical :: ok
    select type (machine)
    type is (one_body_t)
      points = watched
    type is (structure_t)
      share = 2
      do i = 1, 60
        share = (1 + share)**(1/real(machine%n + 1, wp))
      end do
      associate (moving => machine%frame%moving, w => machine%frame%moving%machine%watched)
        do i = 1, size(watched, 2)
          points(:, i) = 2*machine%size_of*(2*modulo(0.5_wp + i*[(share**(-k), k=1, machine%n)], 1.0_wp) - 1)
          if (present(spread)) points(:, i) = spread(i)*points(:, i)
          if (modulo(i, 2) == 1) then
            associate (start => moving%machine%start, shape => moving%machine%start_shape)
              call start_multibody(moving, start(1, :) + shape(:, 1)*(watched(1, i) - start(1, w)), &
                                 start(2, :) + shape(:, 2)*(watched(2, i) - start(2, w)), 0.0_wp, state, ok)
            end associate
            if (ok) points(:, i) = coordinates_of(machine, state)
          end if
          if (.not. machine%has_clock) points(machine%positions + w, i) = 0
        end do
      end associate
    end select
  end function starts_of_section

  !> A section point, moved to the barrier that it lies beyond.
  pure function within_stops(machine, point) result(within)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: point(:)
    real(wp) :: within(size(point))
    within = point
    select type (machine)
    type is (one_body_t)
      within(1) = max(min(point(1), machine%moving%machine%contact%upper), machine%moving%machine%contact%lower)
    end select
  end function within_stops

end module machine_family
