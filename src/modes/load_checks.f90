! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What must hold of the expression of a normal force, or a force, between parts; whether it repeats with the drive.
module load_checks
  use errors, only: error_t, fail
  use kinds, only: wp
  use multibody, only: load_t, multibody_t
  use status, only: exit_bad_case
  use tape_value, only: evaluate
  use text, only: to_text
  implicit none
  private

  public :: check_values, repeats

  !> Points of a period at which a normal force is compared with that a period later, and the share that rounding may change.
  integer, parameter :: points = 24
  real(wp), parameter :: same = 1e-9_wp

contains

  !> A constant load is not negative.
  pure subroutine check_values(is_load, load, node, error)
    logical, intent(in) :: is_load
    type(load_t), intent(in) :: load
    integer, intent(in) :: node
    type(error_t), allocatable, intent(inout) :: error
    real(wp) :: now(load%tape%count), z(size(load%rates))
    integer :: fault(load%tape%count)
    if (load%tape%is_full) then
      call fail(error, exit_bad_case, 'found too many operations')
      return
    end if
    z = 0
    call evaluate(load%tape, z, load%parameters, now, fault)
    if (is_load .and. load%tape%nodes(node)%is_steady .and. (fault(node) > 0 .or. now(node) < 0)) then
      call fail(error, exit_bad_case, 'found '//to_text(real(now(node), kind(1d0)))//' N, allowed at least 0')
    end if
  end subroutine check_values

  !> Whether an expression that names the time repeats with the period of the drive, and with it all that it switches at: a step
  !> after many periods shows in its switching function from the first.
  pure logical function repeats(machine, load, node)
    type(multibody_t), intent(in) :: machine
    type(load_t), intent(in) :: load
    integer, intent(in) :: node
    real(wp), dimension(load%tape%count) :: now, later, largest, change
    real(wp) :: z(size(load%rates)), period
    integer, dimension(load%tape%count) :: fault, fault_later
    integer :: i
    repeats = .false.
    if (.not. machine%frequency > 0) return
    period = 8*atan(1.0_wp)/machine%frequency
    largest = 0
    change = 0
    do i = 0, points - 1
      z(3:) = modulo(i*0.618_wp, 1.0_wp) - 0.5_wp
      z(:2) = [period, 8*atan(1.0_wp)]*(i + 0.318_wp)/points
      call evaluate(load%tape, z, load%parameters, now, fault)
      z(1) = z(1) + period
      call evaluate(load%tape, z, load%parameters, later, fault_later)
      where (max(fault, fault_later) == 0)
        largest = max(largest, abs(now), abs(later))
        change = max(change, abs(now - later))
      end where
    end do
    associate (nodes => [node, load%tape%switches%argument])
      repeats = all(change(nodes) <= same*largest(nodes))
    end associate
  end function repeats

end module load_checks
