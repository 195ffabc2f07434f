! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Builds the catalogues of all slices of a grid on a team: every rank discovers its share of the slices, then all
!> are known to all. The result does not depend on the number of ranks.
module catalogue_search
  use attractors, only: attractor_t, pack_attractor, packed_size, unpack_attractor
  use basin, only: catalogue_t, discover_slice, label_slices
  use case_type, only: attractors_t
  use errors, only: error_t, fail
  use grid, only: grid_t
  use journal, only: journal_t
  use kinds, only: int64, wp
  use signals, only: signal_count
  use status, only: exit_resumable
  use team, only: team_t
  use trajectory, only: span_t
  implicit none
  private

  public :: search_catalogues

  character(len=*), parameter :: stopped = 'stopped while searching for attractors; nothing was written yet, start again'

contains

  !> Catalogues of every slice, labelled along the slices; none if no start is an axis (then every point is its own
  !> slice). A second round offers each slice the attractors of its neighbours, so that none is missed
  !> because the sample happened to miss its basin.
  subroutine search_catalogues(team, journal, grid, span, settings, catalogues, error)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    type(attractors_t), intent(in) :: settings
    type(catalogue_t), allocatable, intent(out) :: catalogues(:)
    type(error_t), allocatable, intent(out) :: error
    type(attractor_t), allocatable :: neighbours(:)
    type(catalogue_t), allocatable :: first_round(:)
    integer(int64) :: slice
    allocate (catalogues(merge(grid%slices, 0_int64, any(grid%start_axis > 0))))
    if (size(catalogues) == 0) return
    allocate (neighbours(0))
    call journal%begin('slices', 2*grid%slices, 0_int64)
    do slice = team%rank(), grid%slices - 1, team%size()
      call discover_slice(grid, span, slice, settings%sample, settings%seed, settings%max_period, neighbours, &
                          catalogues(slice + 1), error)
      if (allocated(error)) exit
      if (signal_count() > 0) then
        call fail(error, exit_resumable, stopped)
        exit
      end if
      call journal%progress(slice + 1)
    end do
    call team%agree(error)
    if (allocated(error)) return
    call exchange(team, catalogues)
    if (grid%slices > 1) then
      first_round = catalogues
      do slice = team%rank(), grid%slices - 1, team%size()
        neighbours = first_round(max(slice, 1_int64))%attractors
        neighbours = [neighbours, first_round(min(slice + 2, grid%slices))%attractors]
        call discover_slice(grid, span, slice, settings%sample, settings%seed, settings%max_period, neighbours, &
                            catalogues(slice + 1), error)
        if (allocated(error)) exit
        if (signal_count() > 0) then
          call fail(error, exit_resumable, stopped)
          exit
        end if
        call journal%progress(grid%slices + slice + 1)
      end do
      call team%agree(error)
      if (allocated(error)) return
      call exchange(team, catalogues)
    end if
    call label_slices(catalogues)
  end subroutine search_catalogues

  !> Every rank gets the catalogues of the slices that the others searched.
  subroutine exchange(team, catalogues)
    class(team_t), intent(in) :: team
    type(catalogue_t), intent(inout) :: catalogues(:)
    real(wp), allocatable :: mine(:), all_values(:)
    integer :: slice, i, position
    allocate (mine(0))
    do slice = team%rank() + 1, size(catalogues), team%size()
      do i = 1, size(catalogues(slice)%attractors)
        mine = [mine, real(slice, wp), pack_attractor(catalogues(slice)%attractors(i))]
      end do
    end do
    call team%allgather(mine, all_values)
    do slice = 1, size(catalogues)
      if (allocated(catalogues(slice)%attractors)) deallocate (catalogues(slice)%attractors)
      allocate (catalogues(slice)%attractors(0))
    end do
    do position = 1, size(all_values), packed_size + 1
      slice = nint(all_values(position))
      catalogues(slice)%attractors = [catalogues(slice)%attractors, &
                                      unpack_attractor(all_values(position + 1:position + packed_size))]
    end do
  end subroutine exchange

end module catalogue_search
