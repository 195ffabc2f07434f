! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Where dry friction holds joints at rest a structure without a clock has a continuum of equilibria, a family: the joints that are
!> held, and between which positions the watched coordinate may rest.
module rest_family
  use body_family, only: family_t
  use equilibrium, only: correct_equilibrium, equilibrium_t
  use errors, only: error_t
  use multibody, only: joint_elastic, joint_friction, most_joints
  use multibody_state, only: joint_motion, turning_at
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use structure, only: structure_t
  use structure_modes, only: count_joints, mode_number
  use text, only: join
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: find_rest_family

  !> Joints that friction holds together for which the interval is computed.
  integer, parameter :: most_held = 10

  type, public :: rest_family_t
    !> Names of the joints that dry friction holds, with commas; '' for none.
    character(len=:), allocatable :: joints
    !> Between which positions [m] the watched coordinate may rest if no stop is in the way; `known` for linear machines.
    logical :: known = .false.
    real(wp) :: low = 0, high = 0
  end type rest_family_t

contains

  !> The family of a machine at the value `parameter`. The position is affine in the forces of the joints held, each within what
  !> breaks it away: its extremes are at the corners, from the equilibria with sliding forces one way and the other.
  subroutine find_rest_family(family, parameter, found)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: parameter
    type(rest_family_t), intent(out) :: found
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    integer :: phase(most_joints), held(most_joints), count_held, i
    real(wp) :: corner, other, ratio, middle, half
    logical :: plain, ok
    found%joints = ''
    call machine_neighbourhood(family, parameter, machines, error)
    if (allocated(error)) return
    select type (structure => machines%centre)
    type is (structure_t)
      if (structure%has_clock) return
      call held_at_rest(structure, phase, held, count_held, plain)
      associate (machine => structure%frame%moving%machine)
        found%joints = join([(machine%joints(held(i))%name, i=1, count_held)], ', ')
        if (count_held == 0 .or. count_held > most_held .or. .not. (plain .and. machine%linear)) return
        call position_of(family, parameter, machines, structure, phase, corner, ok)
        if (.not. ok) return
        middle = corner
        half = 0
        do i = 1, count_held
          phase(held(i)) = -1
          call position_of(family, parameter, machines, structure, phase, other, ok)
          if (.not. ok) return
          phase(held(i)) = 1
          associate (friction => machine%joints(held(i))%friction)
            ratio = friction%break_away/(friction%kinetic + friction%excess + friction%second_excess)
          end associate
          middle = middle + (other - corner)/2
          half = half + abs(other - corner)/2*ratio
        end do
      end associate
      found%low = middle - half
      found%high = middle + half
      found%known = .true.
    end select
  end subroutine find_rest_family

  !> Where the watched coordinate is at rest in a mode.
  subroutine position_of(family, parameter, machines, structure, phase, position, ok)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: parameter
    type(neighbourhood_t), intent(in) :: machines
    type(structure_t), intent(in) :: structure
    integer, intent(in) :: phase(:)
    real(wp), intent(out) :: position
    logical, intent(out) :: ok
    type(neighbourhood_t) :: own
    type(equilibrium_t) :: point
    real(wp) :: along(structure%n + 1), rows(2, structure%n)
    integer :: i
    own = machines
    point = equilibrium_t(mode=mode_number(structure%frame%moving%machine, phase), parameter=parameter, &
                          y=[(0.0_wp, i=1, structure%n)])
    along = 0
    along(structure%n + 1) = 1
    call correct_equilibrium(family, own, point, along, ok)
    rows = structure%watched
    position = sum(rows(1, :)*point%y)
  end subroutine position_of

  !> Joints that dry friction holds where nothing moves, with the phases of all joints there, those held sliding forwards. Not
  !> `plain` where the forces of friction at rest are not within fixed limits alone.
  pure subroutine held_at_rest(structure, phase, held, count_held, plain)
    type(structure_t), intent(in) :: structure
    integer, intent(out) :: phase(:), held(:), count_held
    logical, intent(out) :: plain
    real(wp) :: still(structure%frame%moving%machine%n), s, u
    complex(wp) :: turning(structure%frame%moving%harmonics)
    integer :: j
    phase = 0
    held = 0
    count_held = 0
    plain = .true.
    still = 0
    associate (machine => structure%frame%moving%machine)
      turning = turning_at(machine%frequency, 0.0_wp, structure%frame%moving%harmonics)
      do j = 1, count_joints(machine)
        associate (joint => machine%joints(j))
          if (all(joint%kind /= [joint_friction, joint_elastic])) cycle
          call joint_motion(machine, j, still, still, 0.0_wp, turning, s, u)
          phase(j) = merge(1, -1, u >= 0)
          if (abs(u) > machine%negligible_speed) cycle
          phase(j) = 1
          count_held = count_held + 1
          held(count_held) = j
          plain = plain .and. joint%kind == joint_friction .and. &
                  joint%friction%kinetic + joint%friction%excess + joint%friction%second_excess > 0
        end associate
      end do
    end associate
  end subroutine held_at_rest

end module rest_family
