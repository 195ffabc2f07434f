! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Events of a multibody structure without progress in time: whether modes repeat, and how often they had to be held.
module progress_watch
  use multibody, only: multibody_t, most_degrees, most_joints
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  implicit none
  private

  public :: note_flight, note_hold, goes_round

  !> Events without progress in time after which the phases are held for an instant, and how often that may be, in all and in a row.
  integer, parameter :: most_idle_steps = 8, most_holds = 100, longest_row = 32
  !> Holds nearer to each other than this share of a period are in a row.
  real(wp), parameter :: row_gap = 1e-6_wp

  type, public :: progress_watch_t
    private
    integer :: idle_steps = 0, holds = 0, in_a_row = 0
    real(wp) :: last_hold = -huge(1.0_wp)
    !> The modes and speeds at this instant so far.
    integer :: phase(most_joints, most_idle_steps), left(most_joints, most_idle_steps)
    real(wp) :: v(most_degrees, most_idle_steps)
  end type progress_watch_t

contains

  !> Notes a flight from the time `before` [s] to `state`. Phases are to be `held` for an instant where a mode repeats, or too many
  !> follow each other, without progress.
  pure subroutine note_flight(watch, machine, before, state, held)
    type(progress_watch_t), intent(inout) :: watch
    type(multibody_t), intent(in) :: machine
    real(wp), intent(in) :: before
    type(multibody_state_t), intent(in) :: state
    logical, intent(out) :: held
    real(wp) :: rounding
    integer :: i, n, joints
    n = machine%n
    joints = size(machine%joints)
    held = .false.
    if (state%time > before) then
      watch%idle_steps = 0
      return
    end if
    rounding = machine%negligible_speed + 64*epsilon(rounding)*maxval(abs(state%v(:machine%n)))
    do i = 1, watch%idle_steps
      held = held .or. (all(watch%phase(:joints, i) == state%phase(:joints)) .and. &
                        all(watch%left(:joints, i) == state%left(:joints)) .and. &
                        all(abs(watch%v(:n, i) - state%v(:n)) <= rounding))
    end do
    watch%idle_steps = min(watch%idle_steps + 1, most_idle_steps)
    watch%phase(:joints, watch%idle_steps) = state%phase(:joints)
    watch%left(:joints, watch%idle_steps) = state%left(:joints)
    watch%v(:n, watch%idle_steps) = state%v(:n)
    held = held .or. watch%idle_steps >= most_idle_steps
  end subroutine note_flight

  !> Notes that the phases are held at `time` [s].
  pure subroutine note_hold(watch, machine, time)
    type(progress_watch_t), intent(inout) :: watch
    type(multibody_t), intent(in) :: machine
    real(wp), intent(in) :: time
    watch%idle_steps = 0
    watch%holds = watch%holds + 1
    watch%in_a_row = merge(watch%in_a_row + 1, 1, time - watch%last_hold < row_gap*machine%period)
    watch%last_hold = time
  end subroutine note_hold

  !> Whether modes follow each other without end.
  pure logical function goes_round(watch)
    type(progress_watch_t), intent(in) :: watch
    goes_round = watch%holds >= most_holds .or. watch%in_a_row >= longest_row
  end function goes_round

end module progress_watch
