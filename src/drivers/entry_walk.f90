! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A walk over the entries of the catalogues of a map: the ranks share the slices, and all of them get all numbers.
module entry_walk
  use basin, only: catalogue_t
  use errors, only: error_t
  use grid, only: grid_t, slice_motion
  use kinds, only: int64, wp
  use machine_type, only: machine_t
  use team, only: team_t
  implicit none
  private

  public :: begin_walk

  type, public :: entry_walk_t
    !> Machine of the present slice.
    class(machine_t), allocatable :: machine
    !> Numbers of the present catalogue and of the attractor in it.
    integer :: catalogue = 0, attractor = 0
    !> Ranks; entries before those of each catalogue.
    integer, private :: step = 1
    integer, allocatable, private :: before(:)
    !> Number of an entry, and what was noted of it, one after the other.
    real(wp), allocatable, private :: noted(:)
  contains
    procedure :: next
    procedure :: note
    procedure :: gather
  end type entry_walk_t

contains

  !> A walk that is before its first entry.
  function begin_walk(team, catalogues) result(walk)
    class(team_t), intent(in) :: team
    type(catalogue_t), intent(in) :: catalogues(:)
    type(entry_walk_t) :: walk
    integer :: i
    allocate (walk%before(size(catalogues) + 1), source=0)
    do i = 1, size(catalogues)
      walk%before(i + 1) = walk%before(i) + size(catalogues(i)%attractors)
    end do
    allocate (walk%noted(0))
    walk%step = team%size()
    walk%catalogue = team%rank() + 1 - team%size()
  end function begin_walk

  !> Goes to the next entry of this rank; `found`: there is one. Slices without a machine have none.
  subroutine next(self, grid, found)
    class(entry_walk_t), intent(inout) :: self
    type(grid_t), intent(in) :: grid
    logical, intent(out) :: found
    type(error_t), allocatable :: error
    integer :: count
    self%attractor = self%attractor + 1
    do
      count = 0
      if (self%catalogue > 0) count = self%before(self%catalogue + 1) - self%before(self%catalogue)
      found = self%attractor <= count .and. allocated(self%machine)
      if (found .or. self%catalogue + self%step >= size(self%before)) return
      self%catalogue = self%catalogue + self%step
      self%attractor = 1
      call slice_motion(grid, int(self%catalogue - 1, int64), self%machine, error)
      if (allocated(error) .and. allocated(self%machine)) deallocate (self%machine)
    end do
  end subroutine next

  !> Keeps numbers of the present entry.
  pure subroutine note(self, numbers)
    class(entry_walk_t), intent(inout) :: self
    real(wp), intent(in) :: numbers(:)
    self%noted = [self%noted, real(self%before(self%catalogue) + self%attractor, wp), numbers]
  end subroutine note

  !> Numbers (rows) of every entry (columns), slice after slice; those of which none were noted are `not_known`. Collective.
  subroutine gather(self, team, not_known, values)
    class(entry_walk_t), intent(in) :: self
    class(team_t), intent(in) :: team
    real(wp), intent(in) :: not_known(:)
    real(wp), allocatable, intent(out) :: values(:, :)
    real(wp), allocatable :: gathered(:)
    integer :: i
    call team%allgather(self%noted, gathered)
    values = spread(not_known, 2, self%before(size(self%before)))
    do i = 1, size(gathered), 1 + size(not_known)
      values(:, nint(gathered(i))) = gathered(i + 1:i + size(not_known))
    end do
  end subroutine gather

end module entry_walk
