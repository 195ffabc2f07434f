! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The label that a trajectory gives its start, as boundaries between basins know it.
module start_label
  use attractors, only: attractor_t
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use status, only: reason_left_domain
  use single_trajectory, only: outcome_t, run_from_section, span_t
  implicit none
  private

  public :: label_of, label_from

  !> Labels that are no attractors: the motion is not known (not converged, or given up), or it has left the domain.
  integer, parameter, public :: label_not_known = 0, label_left_domain = -1

contains

  !> The number of the attractor, or one of the codes above.
  pure integer function label_of(outcome) result(label)
    type(outcome_t), intent(in) :: outcome
    label = max(outcome%attractor, label_not_known)
    if (outcome%attractor == 0 .and. outcome%reason == reason_left_domain) label = label_left_domain
  end function label_of

  !> Label of a state on the section.
  pure integer function label_from(moving, catalogue, span, section) result(label)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(section_state_t), intent(in) :: section
    type(outcome_t) :: outcome
    call run_from_section(moving, catalogue, span, section, outcome)
    label = label_of(outcome)
  end function label_from

end module start_label
