! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A structure from section to section.
submodule(structure) structure_sections
  use multibody_log, only: watched_state
  use multibody_motion, only: start_multibody
  use structure_family, only: map_of_family, state_at_start
  use structure_walk, only: advance_section, advance_to_section, fly_structure_on, start_of_structure
  implicit none

contains

  module procedure begin_structure
    allocate (section%multibody)
    call start_of_structure(self, point, section%multibody, ok)
    if (ok) section%state = watched_state(self%frame%moving%machine, section%multibody)
  end procedure begin_structure

  module procedure go_on_with_structure
    type(tally_t) :: tally
    integer :: reason
    call advance_to_section(self, section%multibody, section%lasted, tally, reason)
    point = coordinates_of(self, section%multibody)
    ok = reason == 0
  end procedure go_on_with_structure

  module procedure fly_structure_to_section
    type(multibody_state_t) :: state
    type(tally_t) :: tally
    real(wp) :: lasted
    integer :: reason, count_events
    logical :: certain
    point = 0
    state = state_at_start(self, start)
    ok = .not. any(state%q /= state%q)
    if (.not. ok) return
    allocate (events(8))
    count_events = 0
    lasted = 0
    call advance_section(self, state, lasted, events, count_events, tally, reason, certain)
    ok = reason == 0
    events = events(:count_events)
    if (ok) point = coordinates_of(self, state)
  end procedure fly_structure_to_section

  module procedure fly_structure_over_sections
    call fly_structure_on(self, point, sections, image, events, mode, tally, ok)
  end procedure fly_structure_over_sections

  module procedure map_of_structure
    call map_of_family(machines, point, sections, image, by_start, tally, ok, by_parameter)
  end procedure map_of_structure

  module procedure starts_of_structure
    type(multibody_state_t) :: state
    real(wp) :: share
    integer :: i, k
    logical :: ok
    share = 2
    do i = 1, 60
      share = (1 + share)**(1/real(self%n + 1, wp))
    end do
    associate (moving => self%frame%moving, w => self%frame%moving%machine%watched)
      do i = 1, size(watched, 2)
        points(:, i) = 2*self%size_of*(2*modulo(0.5_wp + i*[(share**(-k), k=1, self%n)], 1.0_wp) - 1)
        if (present(spread)) points(:, i) = spread(i)*points(:, i)
        if (modulo(i, 2) == 1) then
          associate (start => moving%machine%start, shape => moving%machine%start_shape)
            call start_multibody(moving, start(1, :) + shape(:, 1)*(watched(1, i) - start(1, w)), &
                                 start(2, :) + shape(:, 2)*(watched(2, i) - start(2, w)), 0.0_wp, state, ok)
          end associate
          if (ok) points(:, i) = coordinates_of(self, state)
        end if
        if (.not. self%has_clock) points(self%positions + w, i) = 0
      end do
    end associate
  end procedure starts_of_structure

end submodule structure_sections
