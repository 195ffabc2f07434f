! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Shares of attractors among starts drawn at random, with their confidence intervals, and the starts themselves.
module sample_shares
  use case_type, only: sample_t
  use file_layout, only: axis_dimension
  use grid, only: sample_axis
  use kinds, only: int64, wp
  use map_schema, only: schema_t, type_float64
  use statistics, only: share_upper_limit
  implicit none
  private

  public :: add_sample_shares, add_samples, share_with_interval

  !> Of both limits together.
  real(wp), parameter :: confidence = 0.95_wp

contains

  !> Share of `found` among `points`, and the limits of its interval of 95 % confidence (Clopper and Pearson 1934).
  function share_with_interval(found, points) result(share)
    integer(int64), intent(in) :: found, points
    real(wp) :: share(3)
    real(wp), parameter :: one_side = (1 + confidence)/2
    share(1) = real(found, wp)/real(max(points, 1_int64), wp)
    share(2) = 1 - share_upper_limit(points - found, points, one_side)
    share(3) = share_upper_limit(found, points, one_side)
  end function share_with_interval

  !> The values that were drawn, along the axis that counts them.
  subroutine add_samples(schema, sample)
    type(schema_t), intent(inout) :: schema
    type(sample_t), intent(in) :: sample
    integer :: k
    if (.not. allocated(sample%drawn)) return
    do k = 1, size(sample%names)
      call schema%add_variable(axis_dimension(sample%names(k)), type_float64, [sample_axis], units=trim(sample%units(k)), &
                               long_name='start drawn at random: '//trim(sample%names(k)), data=sample%drawn(k, :))
    end do
  end subroutine add_samples

  !> Shares of the entries of the catalogue, each among the `points` of its slice.
  subroutine add_sample_shares(schema, captured, points)
    type(schema_t), intent(inout) :: schema
    integer(int64), intent(in) :: captured(:), points
    real(wp) :: shares(3, size(captured))
    integer :: k
    if (size(captured) == 0) return
    do k = 1, size(captured)
      shares(:, k) = share_with_interval(captured(k), points)
    end do
    call add('share', 'share of the starts of the slice', shares(1, :))
    call add('share_lower', 'lower limit of the share, with share_upper at 95 % confidence', shares(2, :))
    call add('share_upper', 'upper limit of the share', shares(3, :))

  contains

    subroutine add(name, long_name, data)
      character(len=*), intent(in) :: name, long_name
      real(wp), intent(in) :: data(:)
      call schema%add_variable(name, type_float64, ['entry'], units='1', long_name=long_name, data=data, group='catalogue')
    end subroutine add

  end subroutine add_sample_shares

end module sample_shares
