! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a motion looks like: its features over some drive periods, the events of its cycle.
module motion_features
  use attractors, only: features_t, regime_at_rest, regime_of, regime_stuck, wrap_range
  use event_words, only: canonical_word
  use kinds, only: int64, wp
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: tally_t
  implicit none
  private

  public :: features_over, cycle_word

contains

  !> Features of what was counted over `periods` drive periods. Bodies that do not slip may well move.
  pure function features_over(moving, tally, periods) result(features)
    class(machine_t), intent(in) :: moving
    type(tally_t), intent(in) :: tally
    real(wp), intent(in) :: periods
    type(features_t) :: features
    features = regime_of(tally, periods)
    features%rotation = real(tally%turns, wp)/periods
    call wrap_range(features, moving%turn)
    if (moving%has_driver .and. features%regime == regime_at_rest) features%regime = regime_stuck
  end function features_over

  !> Event word of the cycle of `periods` drive periods that a state on the section has reached, wherever on it that is.
  pure integer(int64) function cycle_word(moving, section, periods) result(word)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    integer, intent(in) :: periods
    integer(int64) :: words(periods)
    type(section_state_t) :: later
    type(tally_t) :: tally
    integer :: i, reason
    later = section
    words = 0
    do i = 1, periods
      call moving%begin_tally(later, tally)
      call moving%advance_to_section(later, tally, reason)
      if (reason /= 0) exit
      words(i) = tally%word
    end do
    word = canonical_word(words)
  end function cycle_word

end module motion_features
