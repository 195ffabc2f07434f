! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a search for branches has been given and has found.
module search_state
  use body_family, only: family_t
  use branch_point, only: branch_t, plan_t
  use equilibrium_branch, only: equilibria_t
  use kinds, only: wp
  use orbit_search, only: found_t
  use periodic_orbit, only: orbit_t
  use search_watch, only: search_watch_t
  implicit none
  private

  !> Other processes that take part in a search, this one among them.
  type, abstract, public :: workers_t
  contains
    !> How many there are, and which this is, from 0.
    procedure(number_of), deferred :: count
    procedure(number_of), deferred :: own_number
    procedure(exchange), deferred :: exchange
  end type workers_t

  abstract interface
    integer function number_of(self)
      import :: workers_t
      class(workers_t), intent(in) :: self
    end function number_of

    !> Every process gets the numbers of all of them, in their order. Collective.
    subroutine exchange(self, own, all_numbers)
      import :: workers_t, wp
      class(workers_t), intent(in) :: self
      real(wp), intent(in), contiguous :: own(:)
      real(wp), allocatable, intent(out) :: all_numbers(:)
    end subroutine exchange
  end interface

  !> A branch that another process has followed before it is known whether it is needed.
  type, public :: traced_t
    type(orbit_t) :: seed
    type(branch_t) :: branch
  end type traced_t

  type, public :: search_t
    type(family_t) :: family
    type(plan_t) :: plan
    !> Values at which orbits are searched, and those found at each that are on a branch or a seed.
    real(wp), allocatable :: values(:)
    type(found_t), allocatable :: found(:)
    !> Starts of the searches (columns x, v), longest period looked for, and the longest that is followed.
    real(wp), allocatable :: starts(:, :)
    integer :: longest = 4, longest_followed = 4
    !> Branches that are followed at most.
    integer :: most_branches = 60
    integer :: seeds = 0
    !> Whether any orbit that was found depends on the parameter.
    logical :: depends = .false.
    type(branch_t), allocatable :: branches(:)
    !> Branches of equilibria of a machine without a clock.
    type(equilibria_t), allocatable :: equilibria(:)
    !> Rows that give position and speed of what is watched from a section point; whether the section is a time of the drive.
    real(wp), allocatable :: watch(:, :)
    logical :: has_clock = .true.
    !> Receives the progress of the search, if any.
    class(search_watch_t), pointer :: watcher => null()
    !> Other processes, if any; seeds that may be needed next, and what was made of those that were followed.
    class(workers_t), pointer :: workers => null()
    type(orbit_t), allocatable :: expected(:)
    type(traced_t), allocatable :: traced(:)
  end type search_t

end module search_state
