! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What is said of the attractors of a map.
module catalogue_report
  use attractors, only: attractor_t, kind_chaotic, kind_not_known, regime_names
  use basin, only: catalogue_t
  use kinds, only: wp
  use text, only: to_text
  implicit none
  private

  public :: attractor_text, not_known_text

contains

  !> An attractor in a line.
  function attractor_text(attractor) result(line)
    type(attractor_t), intent(in) :: attractor
    character(len=:), allocatable :: line
    line = '  '//to_text(attractor%id)//': '//trim(regime_names(attractor%features%regime))
    select case (attractor%kind)
    case (kind_chaotic)
      line = line//', chaotic'
    case (kind_not_known)
      line = line//', not known to be periodic'
    case default
      line = line//', period '//to_text(attractor%period)
    end select
    line = line//', amplitude '//to_text(attractor%features%amplitude, 5)//' m, '// &
           to_text(attractor%features%impacts_per_period, 4)//' impacts per period'
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

end module catalogue_report
