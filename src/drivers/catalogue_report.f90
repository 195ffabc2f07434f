! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What is said of the attractors of a map.
module catalogue_report
  use angle_units, only: unit_of
  use attractors, only: attractor_t, kind_chaotic, kind_cycle, kind_not_known, regime_names
  use basin, only: catalogue_t
  use kinds, only: wp
  use statistics, only: share_upper_limit
  use text, only: to_text
  implicit none
  private

  public :: attractor_text, not_known_text, missed_text

  !> Confidence of the bound on what the sample has missed.
  real(wp), parameter :: confidence = 0.95_wp

contains

  !> An attractor in a line.
  function attractor_text(attractor, is_angle) result(line)
    type(attractor_t), intent(in) :: attractor
    logical, intent(in) :: is_angle
    character(len=:), allocatable :: line
    line = '  '//to_text(attractor%id)//': '//trim(regime_names(attractor%features%regime))
    select case (attractor%kind)
    case (kind_chaotic)
      line = line//', chaotic'
    case (kind_not_known)
      line = line//', not known to be periodic'
    case default
      if (attractor%by_event) then
        line = line//', limit cycle of '//to_text(attractor%duration, 8)//' s'
        if (attractor%period > 1) line = line//' with '//to_text(attractor%period)//' turns'
      else
        line = line//', period '//to_text(attractor%period)
      end if
    end select
    line = line//', amplitude '//to_text(attractor%features%amplitude, 5)//' '//unit_of('m', is_angle)//', '// &
           to_text(attractor%features%impacts_per_period, 4)//' impacts per period'
    if (attractor%kind == kind_cycle .and. abs(attractor%features%rotation) > 0) then
      line = line//', rotation number '//to_text(attractor%features%rotation, 4)
    end if
    if (attractor%kind == kind_chaotic .or. attractor%kind == kind_not_known) then
      line = line//', neighbours drift apart by '//to_text(attractor%multiplier, 4)//' a period'
    else
      line = line//', multiplier '//to_text(attractor%multiplier, 4)
    end if
  end function attractor_text

  !> A warning about the entries of which nobody knows whether they are attractors; '' if there are none.
  function not_known_text(catalogues, extension) result(line)
    type(catalogue_t), intent(in) :: catalogues(:)
    real(wp), intent(in) :: extension
    character(len=:), allocatable :: line
    integer :: slice, entries, slices, here
    entries = 0
    slices = 0
    do slice = 1, size(catalogues)
      here = count(catalogues(slice)%attractors%kind == kind_not_known)
      entries = entries + here
      if (here > 0) slices = slices + 1
    end do
    line = ''
    if (entries == 0) return
    line = 'warning: '//to_text(entries)//' of the attractors, in '//to_text(slices)//' of '//to_text(size(catalogues))// &
      ' slices, are not known to be periodic, nor do neighbouring motions drift apart: perhaps long transients. A longer '// &
      'run.duration or run.extension (now '//to_text(extension, 3)//') tells'
  end function not_known_text

  !> How large an attractor may be that was not found: none of the `sample` starts of a slice went elsewhere. '' where
  !> a slice has none, whether or not it was looked for. The bound is that of independent starts.
  function missed_text(catalogues, sample) result(line)
    type(catalogue_t), intent(in) :: catalogues(:)
    integer, intent(in) :: sample
    character(len=:), allocatable :: line
    integer :: i
    line = ''
    if (size(catalogues) == 0) return
    if (any([(size(catalogues(i)%attractors) == 0, i=1, size(catalogues))])) return
    line = 'an attractor that was not found attracts less than '//to_text(100*share_upper_limit(0, sample, confidence), 3)// &
      ' % of the starts'
    if (size(catalogues) > 1) line = line//' of its slice'
    line = line//', with '//to_text(100*confidence, 2)//' % confidence: none of '//to_text(sample)//' sampled starts led to another'
  end function missed_text

end module catalogue_report
