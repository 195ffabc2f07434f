! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What impacts and constraints do to the state of a multibody structure, with derivatives.
module structure_impact
  use simultaneous_impact, only: speeds_after
  use contact_law, only: contact_t, restitution_at
  use multibody, only: joint_contact, multibody_t, most_joints, together_sequence
  use multibody_state, only: is_held, joint_motion, multibody_state_t
  use kinds, only: wp
  use matrices, only: solve
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: carried_by, apply_impact_with_slopes

  !> Steps of the differences of impacts, as a share of the speeds, and how far their halves may differ.
  real(wp), parameter :: step = merge(3e-4_wp, 1e-6_wp, epsilon(1.0_wp) > 1e-20_wp), bent = 1e-2_wp

contains

  !> Joints that are held in these phases and do not depend on each other, of contacts only if asked, and where a unit of each moves
  !> the structure, least in the metric of the masses.
  pure subroutine carried_by(machine, phase, contacts_only, held, carried)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: phase(:)
    logical, intent(in) :: contacts_only
    integer, allocatable, intent(out) :: held(:)
    real(wp), allocatable, intent(out) :: carried(:, :)
    real(wp), allocatable :: rows(:, :), g(:, :), unit(:), answer(:)
    real(wp) :: left
    integer :: j, k
    logical :: ok
    allocate (held(0), rows(machine%n, 0))
    do j = 1, size(machine%joints)
      if (.not. is_held(machine%joints(j), phase(j))) cycle
      if (contacts_only .and. machine%joints(j)%kind /= joint_contact) cycle
      associate (row => machine%joints(j)%row)
        left = sum(row*matmul(machine%mobility, row))
        if (size(held) > 0) then
          unit = matmul(transpose(rows), matmul(machine%mobility, row))
          answer = unit
          call solve(matmul(transpose(rows), matmul(machine%mobility, rows)), unit, answer, ok)
          if (.not. left - sum(answer*unit) > 1e-10_wp*left) cycle
        end if
        held = [held, j]
        rows = reshape([rows, row], [machine%n, size(held)])
      end associate
    end do
    g = matmul(transpose(rows), matmul(machine%mobility, rows))
    allocate (carried(machine%n, size(held)))
    do k = 1, size(held)
      unit = [(0.0_wp, j=1, size(held))]
      unit(k) = 1
      answer = unit
      call solve(g, unit, answer, ok)
      carried(:, k) = matmul(machine%mobility, matmul(rows, answer))
    end do
  end subroutine carried_by

  !> Speeds after an impact of the contacts with `side` +1, -1 (0: not touching), see module `simultaneous_impact`, and their
  !> derivatives by the speeds before and by the time. Not a number where the impact is not smooth.
  pure subroutine apply_impact_with_slopes(machine, state, turning, side, plastic, v, by_speed, by_time)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: side(:)
    logical, intent(in) :: plastic
    real(wp), intent(out) :: v(:), by_speed(:, :), by_time(:)
    integer :: list(most_joints), m, i, j, k
    real(wp), dimension(most_joints) :: gamma, given, impulse
    real(wp) :: s, u, slopes(most_joints, most_joints), kick(machine%n)
    m = 0
    do j = 1, size(machine%joints)
      if (side(j) == 0 .or. machine%joints(j)%kind /= joint_contact) cycle
      m = m + 1
      list(m) = j
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given(m))
      gamma(m) = -side(j)*u
    end do
    call find_impulses(machine, list(:m), side, plastic, gamma, impulse, slopes)
    v = state%v(:machine%n)
    by_speed = 0
    by_time = 0
    do i = 1, machine%n
      by_speed(i, i) = 1
    end do
    do i = 1, m
      kick = -side(list(i))*matmul(machine%mobility, machine%joints(list(i))%row)
      v = v + kick*impulse(i)
      do k = 1, m
        associate (row => machine%joints(list(k))%row)
          do j = 1, machine%n
            by_speed(:, j) = by_speed(:, j) + kick*slopes(i, k)*(-side(list(k))*row(j))
          end do
          by_time = by_time + kick*slopes(i, k)*(-side(list(k))*given(k))
        end associate
      end do
    end do
  end subroutine apply_impact_with_slopes

  !> Impulses of the contacts in `list` for their opening speeds `gamma` [m/s], and the derivatives of these, not a number where an
  !> impulse is not smooth. One alone goes on smoothly where the contact opens already, beyond a graze: it pulls there.
  pure subroutine find_impulses(machine, list, side, plastic, gamma, impulse, slopes)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: list(:), side(:)
    logical, intent(in) :: plastic
    real(wp), intent(in) :: gamma(:)
    real(wp), intent(out) :: impulse(:), slopes(:, :)
    real(wp) :: near(most_joints), h, values(most_joints, -2:2), forth, back
    integer :: m, i, k
    m = size(list)
    slopes = 0
    if (m == 1) then
      call single_impulse(machine, list(1), gamma(1), plastic, impulse(1), slopes(1, 1))
      return
    end if
    call impulses(gamma, impulse)
    do i = 1, m
      ! What rests on a contact stays there: only what really closes is varied.
      h = step*maxval(abs(gamma(:m)))
      do k = -2, 2
        near = gamma
        near(i) = near(i) + k*h
        call impulses(near, values(:, k))
      end do
      slopes(:m, i) = (8*(values(:m, 1) - values(:m, -1)) - (values(:m, 2) - values(:m, -2)))/(12*h)
      forth = norm2(values(:m, 1) - values(:m, 0))
      back = norm2(values(:m, 0) - values(:m, -1))
      if (abs(gamma(i)) > 10*h .and. abs(forth - back) > bent*max(forth, back)) slopes(:m, i) = ieee_value(1.0_wp, ieee_quiet_nan)
      if (.not. abs(gamma(i)) > 10*h) slopes(:m, i) = 0
    end do

  contains

    pure subroutine impulses(opening, impulse)
      real(wp), intent(in) :: opening(:)
      real(wp), intent(out) :: impulse(:)
      real(wp) :: g(m, m), e(m)
      integer :: a, b
      logical :: ok
      do a = 1, m
        e(a) = 0
        if (.not. plastic) e(a) = restitution_at(machine%joints(list(a))%contact, abs(opening(a)))
        do b = 1, m
          g(b, a) = side(list(a))*side(list(b)) &
                    *sum(machine%joints(list(b))%row*matmul(machine%mobility, machine%joints(list(a))%row))
        end do
      end do
      impulse = 0
      call speeds_after(g, opening(:m), e, machine%together == together_sequence .and. .not. plastic, impulse(:m), ok)
      if (.not. ok) impulse = ieee_value(1.0_wp, ieee_quiet_nan)
    end subroutine impulses

  end subroutine find_impulses

  !> The impulse of one contact alone, -(1 + e) gamma/g, and how it changes with its opening speed.
  pure subroutine single_impulse(machine, j, gamma, plastic, impulse, slope)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    real(wp), intent(in) :: gamma
    logical, intent(in) :: plastic
    real(wp), intent(out) :: impulse, slope
    real(wp) :: h, e(-2:2), change, g
    integer :: k
    associate (joint => machine%joints(j))
      change = 0
      e = 0
      if (.not. plastic) then
        h = step*abs(gamma)
        e = [(restitution_at(joint%contact, abs(gamma + k*h)), k=-2, 2)]
        ! Of a restitution that depends on the speed.
        if (joint%contact%kind /= 0) change = (8*(e(1) - e(-1)) - (e(2) - e(-2)))/(12*h)
      end if
      g = sum(joint%row*matmul(machine%mobility, joint%row))
      impulse = -(1 + e(0))*gamma/g
      slope = -(1 + e(0) + change*gamma)/g
    end associate
  end subroutine single_impulse

end module structure_impact
