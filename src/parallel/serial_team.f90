! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A team of one process without MPI.
module serial_team
  use kinds, only: int64, real64
  use system, only: exit_at_once
  use team, only: team_t
  implicit none
  private

  type, extends(team_t), public :: serial_team_t
  contains
    procedure :: rank => rank_of
    procedure :: size => size_of
    procedure :: communicator
    procedure :: barrier
    procedure :: arrive
    procedure :: all_arrived
    procedure :: abort => abort_with
    procedure :: broadcast_text
    procedure :: broadcast_integers
    procedure :: sum => sum_integers
    procedure :: gather
    procedure :: allgather => gather
    procedure :: close => close_team
  end type serial_team_t

contains

  !> 0.
  pure integer function rank_of(self)
    class(serial_team_t), intent(in) :: self
    associate (unused => self)
    end associate
    rank_of = 0
  end function rank_of

  !> 1.
  pure integer function size_of(self)
    class(serial_team_t), intent(in) :: self
    associate (unused => self)
    end associate
    size_of = 1
  end function size_of

  !> -1: there is none.
  pure integer function communicator(self)
    class(serial_team_t), intent(in) :: self
    associate (unused => self)
    end associate
    communicator = -1
  end function communicator

  !> Nobody to wait for.
  subroutine barrier(self)
    class(serial_team_t), intent(in) :: self
    associate (unused => self)
    end associate
  end subroutine barrier

  !> Nobody to wait for.
  subroutine arrive(self)
    class(serial_team_t), intent(inout) :: self
    associate (unused => self)
    end associate
  end subroutine arrive

  !> True: there is nobody else.
  logical function all_arrived(self)
    class(serial_team_t), intent(inout) :: self
    associate (unused => self)
    end associate
    all_arrived = .true.
  end function all_arrived

  !> Ends the program at once with this exit code.
  subroutine abort_with(self, code)
    class(serial_team_t), intent(in) :: self
    integer, intent(in) :: code
    associate (unused => self)
    end associate
    call exit_at_once(code)
  end subroutine abort_with

  !> The text stays as it is.
  subroutine broadcast_text(self, text, root)
    class(serial_team_t), intent(in) :: self
    character(len=:), allocatable, intent(inout) :: text
    integer, intent(in), optional :: root
    associate (unused => self, also => text, too => root)
    end associate
  end subroutine broadcast_text

  !> The values stay as they are.
  subroutine broadcast_integers(self, values, root)
    class(serial_team_t), intent(in) :: self
    integer(int64), intent(inout), contiguous :: values(:)
    integer, intent(in), optional :: root
    associate (unused => self, also => values, too => root)
    end associate
  end subroutine broadcast_integers

  !> The values are their own sums.
  subroutine sum_integers(self, values)
    class(serial_team_t), intent(in) :: self
    integer(int64), intent(inout), contiguous :: values(:)
    associate (unused => self, also => values)
    end associate
  end subroutine sum_integers

  !> A copy of the values.
  subroutine gather(self, values, all_values)
    class(serial_team_t), intent(in) :: self
    real(real64), intent(in), contiguous :: values(:)
    real(real64), allocatable, intent(out) :: all_values(:)
    associate (unused => self)
    end associate
    all_values = values
  end subroutine gather

  !> Nothing to give back.
  subroutine close_team(self)
    class(serial_team_t), intent(inout) :: self
    associate (unused => self)
    end associate
  end subroutine close_team

end module serial_team
