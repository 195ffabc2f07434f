! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Orbits of symmetric machines: whether the second half of one is the mirror image of the first, and which branches are mirror
!> images of each other.
module orbit_symmetry
  use body_family, only: family_t
  use branch_point, only: branch_t, label_bp
  use errors, only: error_t
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use machine_family, only: machine_of_family
  use part_of_branch, only: lies_on
  use periodic_orbit, only: closing_time, orbit_t, same_orbit
  implicit none
  private

  public :: mark_symmetry, centre_of, is_mirror_image

  !> Instants at which they are compared, as shares of half the period.
  real(wp), parameter :: instants(4) = [0.0837_wp, 0.3141_wp, 0.5772_wp, 0.9069_wp]

contains

  !> Marks the points of a branch whose orbits are symmetric.
  subroutine mark_symmetry(family, branch)
    type(family_t), intent(in) :: family
    type(branch_t), intent(inout) :: branch
    class(hybrid_t), allocatable :: machine
    type(error_t), allocatable :: error
    integer :: i
    do i = 1, size(branch%points)
      associate (point => branch%points(i))
        ! Half a period later the drive is the other way round only after an odd number of periods.
        if (modulo(point%orbit%periods, 2) == 0) return
        call machine_of_family(family, point%orbit%parameter, machine, error)
        if (allocated(error)) return
        if (.not. machine%has_clock) return
        point%symmetric = is_symmetric(machine, point%orbit)
      end associate
    end do
  end subroutine mark_symmetry

  !> Whether half a period later every position is as far on the other side of its middle, with the opposite velocity.
  pure logical function is_symmetric(machine, orbit)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    real(wp), dimension(size(orbit%y)) :: one, other, twice, first
    real(wp) :: half
    integer :: i
    half = closing_time(machine, orbit)/2
    is_symmetric = .true.
    do i = 1, size(instants)
      one = state_at(machine, orbit, instants(i)*half)
      other = state_at(machine, orbit, (1 + instants(i))*half)
      twice = one + other
      if (i == 1) first = twice
      if (i == 1) first(machine%positions + 1:) = 0
      is_symmetric = maxval(abs(twice - first)/machine%size_of) < same_orbit
      if (.not. is_symmetric) return
    end do
  end function is_symmetric

  !> State of an orbit at a time since its section [s].
  pure function state_at(machine, orbit, time) result(y)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    real(wp), intent(in) :: time
    real(wp) :: y(size(orbit%y)), from(size(orbit%y)), t
    integer :: k, mode
    from = orbit%y
    t = 0
    mode = orbit%mode
    do k = 1, size(orbit%events)
      if (orbit%events(k)%time > time) exit
      from = orbit%events(k)%departure(:size(y))
      t = orbit%events(k)%time
      mode = orbit%events(k)%after
    end do
    call machine%fly(mode, t, from, time, y)
  end function state_at

  !> Middle [m] of the symmetric orbits of some branches, the same for all; `known` is false without any whose machine must be
  !> symmetric too.
  pure subroutine centre_of(branches, family, centre, known)
    type(branch_t), intent(in) :: branches(:)
    type(family_t), intent(in) :: family
    real(wp), intent(out) :: centre
    logical, intent(out) :: known
    integer :: b, i
    known = .false.
    centre = 0
    do b = 1, size(branches)
      do i = 1, size(branches(b)%points)
        associate (point => branches(b)%points(i))
          ! A linear motion is symmetric in any machine.
          if (.not. point%symmetric .or. (size(point%orbit%events) == 0 .and. point%label /= label_bp)) cycle
          if (known .and. abs((point%x_min + point%x_max)/2 - centre) > 1e-3_wp*family%sizes(1)) then
            known = .false.
            return
          end if
          if (.not. known) centre = (point%x_min + point%x_max)/2
          known = .true.
        end associate
      end do
    end do
  end subroutine centre_of

  !> Whether a branch of one body is part of the mirror image of another one.
  pure logical function is_mirror_image(part, whole, family, centre) result(mirrored)
    type(branch_t), intent(in) :: part, whole
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: centre
    mirrored = size(part%points(1)%orbit%y) == 2
    if (mirrored) mirrored = lies_on(part, whole, family, centre)
  end function is_mirror_image

end module orbit_symmetry
