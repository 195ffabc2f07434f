! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The stable and unstable sets of the saddles of a plane, side by side on the ranks.
module boundary_sets
  use body_family, only: family_t
  use boundary_names, only: names_t
  use boundary_search, only: plane_t
  use checkpoint, only: checkpoint_t
  use errors, only: error_t
  use grid, only: grid_t, point_slice, slice_laws
  use invariant_sets, only: grow_set, set_t
  use kinds, only: int64, wp
  use machine_family, only: machine_neighbourhood
  use one_body, only: one_body_t
  use saddle_search, only: saddle_t
  use session, only: session_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: grow_sets

  !> Saddles of a plane whose sets are grown, those first that most boundary points lead to.
  integer, parameter :: most_grown = 6
  !> Sides that are kept together: those of two saddles.
  integer, parameter :: sides_of_part = 8

contains

  !> Grows the stable and unstable sets of the saddles within `windows` times the window of a plane of x0 and v0, side by side on
  !> the ranks.
  subroutine grow_sets(session, kept, grid, plane, windows, names)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    real(wp), intent(in) :: windows
    type(names_t), intent(inout) :: names
    type(family_t) :: family
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    type(set_t) :: set
    real(wp), allocatable :: part(:)
    real(wp) :: low(2), high(2)
    integer, allocatable :: chosen(:)
    integer :: n, at, length, first
    logical :: found
    if (len(names%problem) > 0 .or. .not. windows > 0 .or. size(names%saddles) == 0) return
    call window_of(grid, plane, windows, low, high, length)
    if (length == 0) return
    family%laws = slice_laws(grid, point_slice(grid, plane%index))
    family%options = grid%options
    call machine_neighbourhood(family, 0.0_wp, machines, error)
    if (allocated(error)) return
    if (.not. has_sets(machines)) return
    chosen = most_reached(names%reached)
    call session%journal%begin('sides of stable and unstable sets', int(4*size(chosen), int64), 0_int64)
    do first = 0, 4*size(chosen) - 1, sides_of_part
      call kept%recall(session, part, found)
      if (.not. found) then
        call grow_part(session, machines, names%saddles(chosen), first, low, high, part)
        call kept%keep(session, part)
      end if
      do n = first, min(4*size(chosen), first + sides_of_part) - 1
        at = 1
        do while (nint(part(at)) /= n)
          at = at + 3 + 3*nint(part(at + 2))
        end do
        length = nint(part(at + 2))
        set%stable = is_stable(n)
        set%side = side_of(n)
        set%ending = nint(part(at + 1))
        set%points = reshape(part(at + 3:at + 2 + 2*length), [2, length])
        set%piece = nint(part(at + 3 + 2*length:at + 2 + 3*length))
        names%sets = [names%sets, set]
        names%saddle_of_set = [names%saddle_of_set, chosen(1 + n/4)]
      end do
    end do
  end subroutine grow_sets

  !> Whether sets of saddles are curves of a plane that are followed: those of one body.
  pure logical function has_sets(machines)
    type(neighbourhood_t), intent(in) :: machines
    select type (body => machines%centre)
    type is (one_body_t)
      has_sets = .true.
    class default
      has_sets = .false.
    end select
  end function has_sets

  !> Of the four sides of every saddle the first two are of its stable set.
  pure logical function is_stable(n)
    integer, intent(in) :: n
    is_stable = modulo(n, 4) < 2
  end function is_stable

  pure integer function side_of(n)
    integer, intent(in) :: n
    side_of = merge(1, -1, modulo(n, 2) == 0)
  end function side_of

  !> Grows the sides from number `first` on (from 0), each on one rank: number, ending, points, their positions and pieces.
  subroutine grow_part(session, machines, saddles, first, low, high, part)
    type(session_t), intent(inout) :: session
    type(neighbourhood_t), intent(in) :: machines
    type(saddle_t), intent(in) :: saddles(:)
    integer, intent(in) :: first
    real(wp), intent(in) :: low(2), high(2)
    real(wp), allocatable, intent(out) :: part(:)
    type(set_t) :: set
    real(wp), allocatable :: own(:)
    integer :: n
    allocate (own(0))
    select type (body => machines%centre)
    type is (one_body_t)
      do n = first + session%team%rank(), min(4*size(saddles), first + sides_of_part) - 1, session%team%size()
        call grow_set(machines, body, saddles(1 + n/4), is_stable(n), side_of(n), low, high, set)
        own = [own, real(n, wp), real(set%ending, wp), real(size(set%piece), wp), reshape(set%points, [size(set%points)]), &
               real(set%piece, wp)]
        call session%journal%progress(int(n + 1, int64))
      end do
    end select
    call session%team%allgather(own, part)
  end subroutine grow_part

  !> The window in x and v; `axes` is 0 if the plane is not that of x0 and v0.
  pure subroutine window_of(grid, plane, windows, low, high, axes)
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    real(wp), intent(in) :: windows
    real(wp), intent(out) :: low(2), high(2)
    integer, intent(out) :: axes
    integer :: k
    low = 0
    high = 0
    axes = 0
    do k = 1, 2
      associate (axis => grid%start_axis(k))
        if (.not. any(plane%axes == axis)) return
        associate (values => grid%axes(axis)%values)
          low(k) = (values(1) + values(size(values)))/2 - windows*(values(size(values)) - values(1))/2
          high(k) = (values(1) + values(size(values)))/2 + windows*(values(size(values)) - values(1))/2
        end associate
      end associate
    end do
    axes = 2
  end subroutine window_of

  !> The saddles that most points lead to, in their order.
  pure function most_reached(reached) result(chosen)
    integer, intent(in) :: reached(:)
    integer, allocatable :: chosen(:)
    integer :: k, least
    least = 0
    do while (count(reached >= least) > most_grown .and. least <= maxval(reached))
      least = least + 1
    end do
    chosen = pack([(k, k=1, size(reached))], reached >= least)
    if (size(chosen) == 0) chosen = pack([(k, k=1, size(reached))], reached == maxval(reached))
    chosen = chosen(:min(size(chosen), most_grown))
  end function most_reached

end module boundary_sets
