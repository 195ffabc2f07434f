! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The event words of periodic orbits.
module orbit_words
  use search_state, only: search_t
  use build_motion, only: period_of
  use errors, only: error_t
  use event_words, only: canonical_word
  use guards, only: turns_round
  use hybrid_machine, only: event_t
  use kinds, only: int64, wp
  use law_table, only: change_parameter, law_choice_t
  use motion_state, only: append_word, event_chatter_lower, event_chatter_upper, event_impact_lower, event_impact_upper, &
    event_stick, event_touch_lower, event_touch_upper, tally_t, word_chatter_lower, word_chatter_upper, word_lower, word_period, &
    word_stick, word_upper
  use one_body, only: rests_on_barrier
  use orbit_symmetry, only: centre_of, is_mirror_image
  use periodic_orbit, only: orbit_t
  use text, only: to_text
  implicit none
  private

  public :: symmetry_text, word_of

contains

  !> What of a branch is symmetric, and of which other one it is the mirror image; nothing for machines without symmetric orbits.
  pure function symmetry_text(search, b) result(text)
    type(search_t), intent(in) :: search
    integer, intent(in) :: b
    character(len=:), allocatable :: text
    real(wp) :: centre
    logical :: known
    integer :: c
    text = ''
    call centre_of(search%branches, search%family, centre, known)
    if (.not. known) return
    associate (points => search%branches(b)%points)
      ! Free motion is symmetric where impacts on one stop are not: symmetry is not reported of a branch with both.
      if (.not. any(points%symmetric)) text = ', not symmetric'
      if (all(points%symmetric)) text = ', symmetric'
      if (count(points%symmetric) > size(points)/2) return
    end associate
    if (is_mirror_image(search%branches(b), search%branches(b), search%family, centre)) then
      text = ', not symmetric, with its mirror image'
      return
    end if
    do c = 1, size(search%branches)
      if (c == b) cycle
      if (is_mirror_image(search%branches(b), search%branches(c), search%family, centre)) then
        text = ', not symmetric, mirror image of branch '//to_text(c)
        return
      end if
    end do
  end function symmetry_text

  !> The event word of an orbit.
  integer(int64) function word_of(orbit, search) result(word)
    type(orbit_t), intent(in) :: orbit
    type(search_t), intent(in) :: search
    type(tally_t) :: tally
    integer(int64) :: words(orbit%periods)
    real(wp) :: period
    integer :: i, k
    if (.not. search%has_clock) then
      word = word_between_sections(orbit)
      return
    end if
    period = period_at(orbit, search)
    do i = 1, orbit%periods
      tally = tally_t()
      do k = 1, size(orbit%events)
        associate (event => orbit%events(k))
          if (event%time < (i - 1)*period .or. (event%time >= i*period .and. i < orbit%periods)) cycle
          call append_event(event, tally)
        end associate
      end do
      call append_word(tally, word_period)
      words(i) = tally%word
    end do
    word = canonical_word(words)
  end function word_of

  !> The same without a clock.
  pure integer(int64) function word_between_sections(orbit) result(word)
    type(orbit_t), intent(in) :: orbit
    type(tally_t) :: tally
    integer(int64) :: words(orbit%periods)
    integer :: i, k
    words = 0
    i = 1
    do k = 1, size(orbit%events)
      if (orbit%events(k)%guard == turns_round) then
        call append_word(tally, word_period)
        words(min(i, size(words))) = tally%word
        tally = tally_t()
        i = i + 1
      else
        call append_event(orbit%events(k), tally)
      end if
    end do
    word = canonical_word(words)
  end function word_between_sections

  pure subroutine append_event(event, tally)
    type(event_t), intent(in) :: event
    type(tally_t), intent(inout) :: tally
    select case (event%kind)
    case (event_impact_upper, event_touch_upper)
      call append_word(tally, word_upper)
    case (event_impact_lower, event_touch_lower)
      call append_word(tally, word_lower)
    case (event_stick)
      call append_word(tally, word_stick)
    case (event_chatter_upper)
      call append_word(tally, word_chatter_upper)
    case (event_chatter_lower)
      call append_word(tally, word_chatter_lower)
    end select
    ! An impact of one body without rebound.
    if (event%guard == 0 .and. any(event%kind == [event_impact_upper, event_impact_lower]) .and. rests_on_barrier(event%after)) then
      call append_word(tally, word_stick)
    end if
  end subroutine append_event

  !> Drive period of the machine of an orbit [s].
  real(wp) function period_at(orbit, search) result(period)
    type(orbit_t), intent(in) :: orbit
    type(search_t), intent(in) :: search
    type(law_choice_t), allocatable :: laws(:)
    type(error_t), allocatable :: error
    logical :: known
    laws = search%family%laws
    call change_parameter(laws, search%family%path, orbit%parameter, known)
    call period_of(laws, period, error)
  end function period_at

end module orbit_words
