! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Derivatives of the map from section to section by the point, from the variations of the motion, where those are known: of one
!> body between sections of its drive, and of a structure from one time to a later one.
module section_slopes
  use body_machine, only: body_machine_t
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use machine_type, only: machine_t
  use motion_state, only: tally_t
  use multibody_machine, only: multibody_machine_t
  use one_body, only: one_body_of, why_not_varied
  use structure, only: structure_of, structure_t
  use structure_family, only: why_structure_not_varied => why_not_varied
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: slopes_of

contains

  !> Derivative of the map over `periods` at a section point (SI), point and image in units of `scale`; `ok` is false where it is
  !> not known, or there is none.
  pure subroutine slopes_of(moving, point, periods, scale, slopes, ok)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:), scale(:)
    integer, intent(in) :: periods
    real(wp), intent(out) :: slopes(:, :)
    logical, intent(out) :: ok
    type(neighbourhood_t) :: machines
    type(tally_t) :: tally
    real(wp) :: image(size(point))
    integer :: k
    slopes = 0
    call varied_machine(moving, scale([1, (size(point) + 2)/2]), machines)
    ok = allocated(machines%centre)
    if (ok) ok = machines%centre%n == size(point)
    if (ok) call machines%centre%map(machines, point, periods, image, slopes, tally, ok)
    do k = 1, size(point)
      slopes(:, k) = slopes(:, k)*scale(k)/scale(:size(point))
    end do
  end subroutine slopes_of

  !> The machine whose variations are those of a motion; nothing where they are not known. `sizes`: of a position [m] and of a speed
  !> [m/s].
  pure subroutine varied_machine(moving, sizes, machines)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: sizes(2)
    type(neighbourhood_t), intent(out) :: machines
    class(hybrid_t), allocatable :: machine
    type(structure_t) :: structure
    if (moving%by_event) return
    select type (moving)
    type is (body_machine_t)
      if (len(why_not_varied(moving%body)) == 0) allocate (machine, source=one_body_of(moving%body, sizes(1)))
    type is (multibody_machine_t)
      if (len(why_structure_not_varied(moving%bodies)) > 0) return
      structure = structure_of(moving%bodies, sizes)
      ! The sections are times here, of a machine without a clock too.
      structure%has_clock = .true.
      structure%frame%moving%section = 0
      allocate (machine, source=structure)
    end select
    if (allocated(machine)) call move_alloc(machine, machines%centre)
  end subroutine varied_machine

end module section_slopes
