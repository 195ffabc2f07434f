! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The processes that work on one run. Children: serial_team, mpi_team. Every procedure but
!> `rank`, `size`, `is_root`, `communicator`, `all_arrived` and `abort` is collective.
module team
  use errors, only: error_t
  use kinds, only: int64, real64
  implicit none
  private

  !> Longest host name kept.
  integer, parameter, public :: host_length = 64

  type, abstract, public :: team_t
  contains
    procedure(number_of), deferred :: rank
    procedure(number_of), deferred :: size
    procedure(number_of), deferred :: communicator
    procedure(act), deferred :: barrier
    procedure(act_finally), deferred :: arrive
    procedure(condition_of), deferred :: all_arrived
    procedure(abort_with), deferred :: abort
    procedure(broadcast_text_to), deferred :: broadcast_text
    procedure(broadcast_integers_to), deferred :: broadcast_integers
    procedure(sum_integers), deferred :: sum
    procedure(gather_reals), deferred :: gather
    procedure(gather_reals), deferred :: allgather
    procedure(act_finally), deferred :: close
    procedure :: broadcast_integer
    generic :: broadcast => broadcast_text, broadcast_integers, broadcast_integer
    procedure :: is_root
    procedure :: any => any_of
    procedure :: agree
    procedure :: hosts
  end type team_t

  abstract interface
    !> Rank from 0, number of ranks, or handle of the communicator (-1: none).
    pure integer function number_of(self)
      import :: team_t
      class(team_t), intent(in) :: self
    end function number_of

    !> Waits for all ranks.
    subroutine act(self)
      import :: team_t
      class(team_t), intent(in) :: self
    end subroutine act

    !> `close`: gives the communicator back, and ends MPI if this team started it. `arrive`: begins a barrier without waiting.
    subroutine act_finally(self)
      import :: team_t
      class(team_t), intent(inout) :: self
    end subroutine act_finally

    !> Whether all ranks have called `arrive`. Not collective.
    logical function condition_of(self)
      import :: team_t
      class(team_t), intent(inout) :: self
    end function condition_of

    !> Ends the program on all ranks with this exit code; does not return.
    subroutine abort_with(self, code)
      import :: team_t
      class(team_t), intent(in) :: self
      integer, intent(in) :: code
    end subroutine abort_with

    !> Every rank gets the text of rank `root` (0 unless given), of any length.
    subroutine broadcast_text_to(self, text, root)
      import :: team_t
      class(team_t), intent(in) :: self
      character(len=:), allocatable, intent(inout) :: text
      integer, intent(in), optional :: root
    end subroutine broadcast_text_to

    !> Every rank gets the values of rank `root` (0 unless given); equal sizes on all ranks.
    subroutine broadcast_integers_to(self, values, root)
      import :: int64, team_t
      class(team_t), intent(in) :: self
      integer(int64), intent(inout), contiguous :: values(:)
      integer, intent(in), optional :: root
    end subroutine broadcast_integers_to

    !> Every rank gets the sums over the ranks, element by element.
    subroutine sum_integers(self, values)
      import :: int64, team_t
      class(team_t), intent(in) :: self
      integer(int64), intent(inout), contiguous :: values(:)
    end subroutine sum_integers

    !> The ranks' values, of any sizes, one after the other in the order of the ranks: with `gather`
    !> on rank 0 (size 0 elsewhere), with `allgather` on every rank.
    subroutine gather_reals(self, values, all_values)
      import :: real64, team_t
      class(team_t), intent(in) :: self
      real(real64), intent(in), contiguous :: values(:)
      real(real64), allocatable, intent(out) :: all_values(:)
    end subroutine gather_reals
  end interface

contains

  !> Whether this is rank 0.
  pure logical function is_root(self)
    class(team_t), intent(in) :: self
    is_root = self%rank() == 0
  end function is_root

  !> Every rank gets the value of rank `root` (0 unless given).
  subroutine broadcast_integer(self, value, root)
    class(team_t), intent(in) :: self
    integer, intent(inout) :: value
    integer, intent(in), optional :: root
    integer(int64) :: values(1)
    values = value
    call self%broadcast_integers(values, root)
    value = int(values(1))
  end subroutine broadcast_integer

  !> Whether the condition holds on any rank.
  logical function any_of(self, condition)
    class(team_t), intent(in) :: self
    logical, intent(in) :: condition
    integer(int64) :: count(1)
    count = merge(1_int64, 0_int64, condition)
    call self%sum(count)
    any_of = count(1) > 0
  end function any_of

  !> If any rank has an error, every rank gets that of the lowest such rank.
  subroutine agree(self, error)
    class(team_t), intent(in) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer(int64) :: failed(0:self%size() - 1)
    integer :: first, code
    character(len=:), allocatable :: message
    failed = 0
    if (allocated(error)) failed(self%rank()) = 1
    call self%sum(failed)
    if (maxval(failed) == 0) return
    first = findloc(failed, 1_int64, dim=1) - 1
    code = 0
    message = ''
    if (self%rank() == first) then
      code = error%code
      message = error%message
    end if
    call self%broadcast_integer(code, first)
    call self%broadcast_text(message, first)
    if (.not. allocated(error)) allocate (error)
    error%code = code
    error%message = message
  end subroutine agree

  !> The names of the hosts, each once, in the order of the ranks; the same on every rank. `mine` is
  !> the name of this rank's host.
  subroutine hosts(self, mine, names)
    class(team_t), intent(in) :: self
    character(len=*), intent(in) :: mine
    character(len=host_length), allocatable, intent(out) :: names(:)
    real(real64), allocatable :: codes(:)
    character(len=host_length) :: name
    integer :: i, k, found
    name = mine
    call self%allgather([(real(iachar(name(i:i)), real64), i=1, host_length)], codes)
    allocate (names(self%size()))
    found = 0
    do k = 0, self%size() - 1
      do i = 1, host_length
        name(i:i) = achar(nint(codes(k*host_length + i)))
      end do
      if (any(names(1:found) == name)) cycle
      found = found + 1
      names(found) = name
    end do
    names = names(1:found)
  end subroutine hosts

end module team
