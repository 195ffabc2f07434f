! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> When this rank did which item of a work list, and how often it asked for more. Off, it keeps nothing.
module work_log
  use kinds, only: real64
  use team, only: team_t
  implicit none
  private

  !> Values of an entry: item, seconds from the start of the list to its beginning and to its end,
  !> questions that this rank had asked rank 0 by then.
  integer, parameter, public :: entry_values = 4

  type, public :: work_log_t
    logical :: on = .false.
    integer :: count = 0
    !> Questions asked, this rank's and since the log began.
    integer :: questions = 0
    real(real64), allocatable, private :: entries(:, :)
    logical, private :: open = .false.
  contains
    procedure :: begin
    procedure :: end => end_entry
    procedure :: collect
  end type work_log_t

contains

  !> Notes that `item` begins, `seconds` after the start.
  subroutine begin(self, item, seconds)
    class(work_log_t), intent(inout) :: self
    integer, intent(in) :: item
    real(real64), intent(in) :: seconds
    real(real64), allocatable :: longer(:, :)
    if (.not. self%on) return
    if (.not. allocated(self%entries)) allocate (self%entries(entry_values, 64))
    if (self%count == size(self%entries, 2)) then
      allocate (longer(entry_values, 2*self%count))
      longer(:, :self%count) = self%entries
      call move_alloc(longer, self%entries)
    end if
    self%count = self%count + 1
    self%entries(:, self%count) = [real(item, real64), seconds, seconds, real(self%questions, real64)]
    self%open = .true.
  end subroutine begin

  !> Notes that the item begun last is done.
  subroutine end_entry(self, seconds)
    class(work_log_t), intent(inout) :: self
    real(real64), intent(in) :: seconds
    if (.not. self%on .or. .not. self%open) return
    self%entries(3, self%count) = seconds
    self%open = .false.
  end subroutine end_entry

  !> The entries of all ranks on rank 0, rank by rank; `entries(:, i)` as in `entry_values`, done by `rank(i)`. Empty elsewhere.
  !> Collective.
  subroutine collect(self, team, entries, rank)
    class(work_log_t), intent(in) :: self
    class(team_t), intent(in) :: team
    real(real64), allocatable, intent(out) :: entries(:, :)
    integer, allocatable, intent(out) :: rank(:)
    real(real64), allocatable :: mine(:), values(:), counts(:)
    integer :: i, k, row
    allocate (mine(entry_values*self%count))
    if (self%count > 0) mine = reshape(self%entries(:, :self%count), [size(mine)])
    call team%gather([real(self%count, real64)], counts)
    call team%gather(mine, values)
    entries = reshape(values, [entry_values, size(values)/entry_values])
    allocate (rank(size(entries, 2)))
    row = 0
    do i = 1, size(counts)
      do k = 1, nint(counts(i))
        row = row + 1
        rank(row) = i - 1
      end do
    end do
  end subroutine collect

end module work_log
