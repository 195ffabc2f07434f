! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What is reported of the attractors of a map.
module catalogue_report
  use angle_units, only: unit_of
  use attractors, only: attractor_t, kind_chaotic, kind_cycle, kind_family, kind_not_known, regime_names
  use basin, only: catalogue_t
  use build_motion, only: machine_of
  use crank_summary, only: crank_outcomes, crank_stalled, crank_summary_t
  use crank_turns, only: summarize_attractor
  use discover, only: is_given_up, most_not_known
  use errors, only: error_t
  use journal, only: journal_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use motor_choices, only: has_motor, resonance_of
  use restoring_law, only: position_is_angle
  use statistics, only: share_upper_limit
  use text, only: to_text
  implicit none
  private

  public :: report_found, list_attractors, not_known_text, missed_text

  !> Confidence of the bound on what the sample has missed.
  real(wp), parameter :: confidence = 0.95_wp

contains

  !> How many attractors the catalogues have, how many families of cycles, and how many entries of which nobody knows whether they
  !> are some.
  pure subroutine count_found(catalogues, attractors, families, not_known)
    type(catalogue_t), intent(in) :: catalogues(:)
    integer, intent(out) :: attractors, families, not_known
    logical, allocatable :: found(:), known(:), family(:)
    integer :: slice, last
    last = maxval([0, (maxval([0, catalogues(slice)%attractors%id]), slice=1, size(catalogues))])
    allocate (found(last), known(last), family(last), source=.false.)
    do slice = 1, size(catalogues)
      associate (entries => catalogues(slice)%attractors)
        found(entries%id) = .true.
        known(pack(entries%id, entries%kind /= kind_not_known)) = .true.
        family(pack(entries%id, entries%kind == kind_family)) = .true.
      end associate
    end do
    families = count(family)
    attractors = count(known .and. .not. family)
    not_known = count(found .and. .not. known)
  end subroutine count_found

  !> These numbers in a line.
  subroutine report_found(journal, catalogues, source)
    type(journal_t), intent(inout) :: journal
    type(catalogue_t), intent(in) :: catalogues(:)
    character(len=*), intent(in) :: source
    character(len=:), allocatable :: line
    integer :: attractors, families, not_known
    call count_found(catalogues, attractors, families, not_known)
    line = counted(attractors, 'attractor')
    if (families > 0) line = line//' and '//to_text(families)//trim(merge(' family  ', ' families', families == 1))//' of cycles'
    if (not_known > 0) line = line//' and '//counted(not_known, 'motion')//' not known to be periodic'
    call journal%line('catalogue', line//' in '//counted(size(catalogues), 'slice')//' '//source, &
                      '"attractors": '//to_text(attractors)//', "families": '//to_text(families)// &
                      ', "not_known": '//to_text(not_known))
  end subroutine report_found

  !> '1 slice', '2 slices'.
  pure function counted(number, thing) result(words)
    integer, intent(in) :: number
    character(len=*), intent(in) :: thing
    character(len=:), allocatable :: words
    words = to_text(number)//' '//thing
    if (number /= 1) words = words//'s'
  end function counted

  !> The attractors, each in a line.
  subroutine list_attractors(journal, attractors, laws)
    type(journal_t), intent(inout) :: journal
    type(attractor_t), intent(in) :: attractors(:)
    type(law_choice_t), intent(in) :: laws(:)
    class(machine_t), allocatable :: machine
    type(error_t), allocatable :: error
    logical :: is_angle
    integer :: first, last
    is_angle = position_is_angle(laws)
    if (has_motor(laws)) call machine_of(laws, options_t(), machine, error)
    first = 1
    do while (first <= size(attractors))
      last = alike_until(attractors, first)
      call journal%line('attractor', attractor_text(attractors(first:last), is_angle)// &
                        speed_text(laws, machine, attractors(first)))
      first = last + 1
    end do
  end subroutine list_attractors

  !> The mean speed of the crank of a motor on a cycle, and on which side of the resonance that is; '' without a motor.
  function speed_text(laws, machine, attractor) result(text)
    type(law_choice_t), intent(in) :: laws(:)
    class(machine_t), allocatable, intent(in) :: machine
    type(attractor_t), intent(in) :: attractor
    character(len=:), allocatable :: text
    type(crank_summary_t) :: crank
    text = ''
    if (.not. allocated(machine) .or. .not. (attractor%kind == kind_cycle .or. attractor%rests)) return
    call summarize_attractor(machine, attractor, crank)
    if (crank%outcome == crank_stalled) then
      text = ', crank stalled at '//to_text(attractor%section(3), 5)//' rad'
      return
    end if
    text = ', crank speed '//to_text(crank%speed, 6)//' rad/s'
    if (resonance_of(laws) > 0) text = text//', '//to_text(crank%speed/resonance_of(laws), 4)//' times the natural frequency'
    text = text//': '//trim(crank_outcomes(crank%outcome))
  end function speed_text

  !> The last of the entries from `first` on that share one line: motions that are not known to be periodic, alike but for their
  !> amplitude.
  pure integer function alike_until(attractors, first) result(last)
    type(attractor_t), intent(in) :: attractors(:)
    integer, intent(in) :: first
    last = first
    do while (last < size(attractors))
      associate (one => attractors(first), next => attractors(last + 1))
        if (one%kind /= kind_not_known .or. next%kind /= kind_not_known .or. next%id /= attractors(last)%id + 1) return
        if (one%features%regime /= next%features%regime .or. (one%multiplier > 1 .neqv. next%multiplier > 1)) return
        if (abs(one%features%impacts_per_period - next%features%impacts_per_period) > 0) return
      end associate
      last = last + 1
    end do
  end function alike_until

  !> An attractor in a line, or entries that are alike.
  function attractor_text(attractors, is_angle) result(line)
    type(attractor_t), intent(in) :: attractors(:)
    logical, intent(in) :: is_angle
    character(len=:), allocatable :: line
    integer :: last
    last = size(attractors)
    associate (attractor => attractors(1))
      line = '  '//to_text(attractor%id)
      if (last > 1) line = line//' to '//to_text(attractors(last)%id)
      line = line//': '//trim(regime_names(attractor%features%regime))
      select case (attractor%kind)
      case (kind_chaotic)
        line = line//', chaotic'
      case (kind_not_known)
        line = line//', not known to be periodic'
      case (kind_family)
        line = line//', a family of cycles: every start has its own'
      case default
        if (attractor%by_event) then
          line = line//', limit cycle of '//to_text(attractor%duration, 8)//' s'
          if (attractor%period > 1) line = line//' with '//to_text(attractor%period)//' turns'
        else
          line = line//', period '//to_text(attractor%period)
        end if
      end select
      if (attractor%rests) then
        line = line//', x = '//to_text(attractor%section(1), 5)//' '//unit_of('m', is_angle)
      else
        line = line//', amplitude '//range_text(attractors%features%amplitude, 5)//' '//unit_of('m', is_angle)
      end if
      line = line//', '//to_text(attractor%features%impacts_per_period, 4)//' impacts per period'
      if (attractor%kind == kind_cycle .and. abs(attractor%features%rotation) > 0) then
        line = line//', rotation number '//to_text(attractor%features%rotation, 4)
      end if
      if (attractor%kind == kind_chaotic .or. attractor%kind == kind_not_known) then
        line = line//', neighbours '//trim(merge('drift apart  ', 'come together', attractor%multiplier > 1))//' by '// &
               range_text(attractors%multiplier, 4)//' a period'
      else
        line = line//', multiplier '//to_text(attractor%multiplier, 4)
      end if
    end associate
  end function attractor_text

  !> '0.5', '0.5 to 0.7'.
  pure function range_text(values, digits) result(words)
    real(wp), intent(in) :: values(:)
    integer, intent(in) :: digits
    character(len=:), allocatable :: words
    words = to_text(minval(values), digits)
    if (to_text(maxval(values), digits) /= words) words = words//' to '//to_text(maxval(values), digits)
  end function range_text

  !> A warning about the entries of which nobody knows whether they are attractors; '' if there are none.
  function not_known_text(catalogues, extension) result(line)
    type(catalogue_t), intent(in) :: catalogues(:)
    real(wp), intent(in) :: extension
    character(len=:), allocatable :: line
    integer :: slice, entries, slices, here
    logical :: cut
    cut = .false.
    entries = 0
    slices = 0
    do slice = 1, size(catalogues)
      here = count(catalogues(slice)%attractors%kind == kind_not_known)
      entries = entries + here
      if (here > 0) slices = slices + 1
      cut = cut .or. is_given_up(catalogues(slice)%attractors)
    end do
    line = ''
    if (entries == 0) return
    line = 'warning: '//to_text(entries)//' entries of the catalogue, in '//to_text(slices)//' of '//to_text(size(catalogues))// &
      ' slices, are not known to be periodic, nor that neighbouring motions drift apart for good: perhaps long transients. A '// &
      'longer run.duration or run.extension (now '//to_text(extension, 3)//') decides'
    if (cut) line = line//'. After '//to_text(most_not_known)//' such and no attractor in a slice, '// &
      'its other starts are not followed'
  end function not_known_text

  !> How large an attractor may be that was not found: none of the `sample` starts of a slice went elsewhere. '' where
  !> a slice has none that is known, whether or not it was looked for. The bound is that of independent starts.
  function missed_text(catalogues, sample) result(line)
    type(catalogue_t), intent(in) :: catalogues(:)
    integer, intent(in) :: sample
    character(len=:), allocatable :: line
    integer :: i
    line = ''
    if (size(catalogues) == 0) return
    if (any([(all(catalogues(i)%attractors%kind == kind_not_known), i=1, size(catalogues))])) return
    line = 'an attractor that was not found attracts less than '//to_text(100*share_upper_limit(0, sample, confidence), 3)// &
      ' % of the starts'
    if (size(catalogues) > 1) line = line//' of its slice'
    line = line//', with '//to_text(100*confidence, 2)//' % confidence: none of '//to_text(sample)//' sampled starts led to another'
  end function missed_text

end module catalogue_report
