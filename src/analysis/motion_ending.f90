! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How the motion of a body on a tape ends that comes to no further section: why, and where it rests.
module motion_ending
  use eigen, only: general_eigen
  use exponents, only: rests_by_friction, rests_nowhere, rests_on_equilibrium, rests_on_stop, spectrum_t
  use hybrid_body, only: hybrid_body_t, rests_on_barrier
  use kinds, only: wp
  use machine_type, only: section_state_t
  use matrices, only: solve
  use motion_state, only: mode_slip_plus, mode_stick, reset_tally, tally_t
  use own_body, only: own_body_t
  use status, only: is_given_up, reason_not_smooth, reason_step_failed, reason_time_over
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: note_ending, note_rest

  integer, parameter :: most_newton = 60
  !> In natural sizes: rates of what rests; how near to an equilibrium a motion has come to it; steps of Newton's method at its end.
  real(wp), parameter :: still = 1e-5_wp, near = 1e-3_wp, converged = 1e-13_wp

contains

  !> Flies once more from a start (see `machine_t`), or from a point of the section, and notes why no section follows.
  subroutine note_ending(machines, from, is_start, spectrum)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: from(:)
    logical, intent(in) :: is_start
    type(spectrum_t), intent(inout) :: spectrum
    type(section_state_t) :: section
    type(tally_t) :: tally
    real(wp) :: before(machines%centre%n)
    logical :: ok, died_away
    died_away = spectrum%at_rest
    spectrum%reason = reason_step_failed
    spectrum%at_rest = .false.
    select type (body => machines%centre)
    class is (hybrid_body_t)
      if (is_start) then
        call body%start(from, section, ok)
      else
        call body%begin(from, section, ok)
      end if
      if (.not. ok) return
      before = body%point_of(section)
      spectrum%ending%lasted = -section%state%time
      call reset_tally(tally, section%state, .false.)
      call body%advance(section, tally, spectrum%reason)
      spectrum%ending%lasted = spectrum%ending%lasted + section%state%time
      spectrum%ending%impacts = tally%impacts
      if (spectrum%reason == 0) spectrum%reason = reason_not_smooth
      if (spectrum%reason == reason_time_over) then
        call note_rest(machines, body%point_of(section), section%state%mode, spectrum)
        spectrum%ending%moved = .not. is_start .or. any(abs(body%point_of(section) - before) > 0)
      else if (died_away .and. is_given_up(spectrum%reason)) then
        ! Its turns have come to the rounding.
        call note_rest(machines, before, mode_slip_plus, spectrum)
      end if
    end select
  end subroutine note_ending

  !> Notes where a body by expressions rests that has come to a state in a mode.
  subroutine note_rest(machines, point, mode, spectrum)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: mode
    type(spectrum_t), intent(inout) :: spectrum
    real(wp) :: there(size(point))
    logical :: ok
    select type (body => machines%centre)
    type is (own_body_t)
      if (body%has_clock) return
      associate (ending => spectrum%ending)
        there = point
        ok = norm2(body%slope(mode, 0.0_wp, point)/body%size_of)*body%size_of_time() < still
        if (.not. ok) return
        if (rests_on_barrier(mode)) then
          ending%rest = rests_on_stop
        else if (mode == mode_stick .and. body%rests(mode)) then
          ending%rest = rests_by_friction
        else if (body%smooth_turns) then
          call find_equilibrium(body, point, there, ending%eigenvalues, ok)
          if (ok) ending%rest = rests_on_equilibrium
        end if
        if (ending%rest == rests_nowhere) return
        ending%point = there
      end associate
      spectrum%at_rest = .true.
      spectrum%reason = 0
    end select
  end subroutine note_rest

  !> The equilibrium next to a state, by Newton's method, and its eigenvalues.
  subroutine find_equilibrium(body, start, point, values, ok)
    type(own_body_t), intent(in) :: body
    real(wp), intent(in) :: start(:)
    real(wp), intent(out) :: point(:)
    complex(wp), allocatable, intent(out) :: values(:)
    logical, intent(out) :: ok
    real(wp) :: rates(size(start)), slopes(size(start), size(start)), step(size(start))
    integer :: i
    point = start
    do i = 1, most_newton
      call body%rates_at(mode_slip_plus, point, rates, slopes)
      call solve(slopes, -rates, step, ok)
      if (ok) ok = norm2((point + step - start)/body%size_of) <= near
      if (.not. ok) return
      point = point + step
      if (norm2(step/body%size_of) <= converged) exit
    end do
    ok = i <= most_newton
    if (ok) call body%rates_at(mode_slip_plus, point, rates, slopes)
    if (ok) call set_eigenvalues(slopes, values, ok)
  end subroutine find_equilibrium

  !> Eigenvalues of a matrix, largest real part first.
  pure subroutine set_eigenvalues(matrix, values, ok)
    real(wp), intent(in) :: matrix(:, :)
    complex(wp), allocatable, intent(out) :: values(:)
    logical, intent(out) :: ok
    complex(wp) :: vectors(size(matrix, 1), size(matrix, 1)), first
    integer :: i, k
    allocate (values(size(matrix, 1)))
    call general_eigen(matrix, values, vectors, ok)
    if (.not. ok) return
    where (abs(aimag(values)) <= 1e-12_wp*maxval(abs(values))) values = cmplx(real(values), 0.0_wp, wp)
    do i = 1, size(values) - 1
      k = i - 1 + maxloc(real(values(i:)) + 1e-9_wp*aimag(values(i:)), 1)
      first = values(k)
      values(k) = values(i)
      values(i) = first
    end do
  end subroutine set_eigenvalues

end module motion_ending
