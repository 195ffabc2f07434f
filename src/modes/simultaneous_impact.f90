! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Impacts of rigid contacts, one or several at once. Friction of a given strength has no part in them. With the opening
!> speed gamma, G = N' M^-1 N and impulses P >= 0:
!>   newton    0 <= gamma+ + e gamma- is complementary to P (Moreau; Glocker, Set-Valued Force Laws), all contacts together,
!>             with the smallest restitution of those that touch each other: never a gain of energy;
!>   sequence  one after the other, the fastest first, until none closes.
module simultaneous_impact
  use bounded_lcp, only: solve_bounded_lcp
  use contact_law, only: restitution_at
  use multibody, only: joint_contact, multibody_t, most_joints, together_sequence
  use multibody_state, only: joint_motion, multibody_state_t, rounding_of_speed
  use kinds, only: wp
  implicit none
  private

  public :: apply_impact, speeds_after

  !> A sequence of impacts ends as one without rebound when its speeds have dropped to this share of the first, or after
  !> so many.
  real(wp), parameter :: spent = 1e-9_wp
  integer, parameter :: longest_sequence = 10000

contains

  !> Changes the speeds by an impact of the contacts with `side` +1, -1 (at their upper or lower stop), 0 not touching.
  !> `plastic` takes every restitution as zero. `speed_before` are the opening speeds of the contacts, `lost` the kinetic
  !> energy lost [J].
  pure subroutine apply_impact(machine, state, turning, side, plastic, speed_before, lost, ok)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: side(:)
    logical, intent(in) :: plastic
    real(wp), intent(out) :: speed_before(:), lost
    logical, intent(out) :: ok
    real(wp) :: g(most_joints, most_joints), gamma(most_joints), e(most_joints), impulse(most_joints), s, u, kick(machine%n)
    integer :: list(most_joints), count_touching, i, j, k, n
    n = machine%n
    speed_before = 0
    count_touching = 0
    do j = 1, size(machine%joints)
      if (side(j) == 0 .or. machine%joints(j)%kind /= joint_contact) cycle
      count_touching = count_touching + 1
      list(count_touching) = j
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      gamma(count_touching) = -side(j)*u
      speed_before(j) = gamma(count_touching)
      e(count_touching) = 0
      ! Between stops without room nothing rebounds.
      associate (joint => machine%joints(j))
        if (.not. plastic .and. joint%upper > joint%lower) e(count_touching) = restitution_at(joint%contact, abs(u))
      end associate
    end do
    do i = 1, count_touching
      do k = 1, count_touching
        g(k, i) = side(list(k))*side(list(i)) &
                  *sum(machine%joints(list(k))%row*matmul(machine%mobility, machine%joints(list(i))%row))
      end do
    end do
    associate (m => count_touching)
      call speeds_after(g(:m, :m), gamma(:m), e(:m), machine%together == together_sequence .and. .not. plastic, &
                        impulse(:m), ok)
    end associate
    kick = 0
    do i = 1, count_touching
      kick = kick - side(list(i))*impulse(i)*matmul(machine%mobility, machine%joints(list(i))%row)
    end do
    lost = -sum(kick*matmul(machine%mass, state%v(:n) + kick/2))
    state%v(:n) = state%v(:n) + kick
    call still(machine, turning, list(:count_touching), impulse(:count_touching), state)
  end subroutine apply_impact

  !> Takes from the speeds what the rounding of the impulses has left of those of contacts in `list` that have none. Impulses that
  !> go through a row leave bodies at rest with no speed to compare rounding with.
  pure subroutine still(machine, turning, list, impulse, state)
    type(multibody_t), intent(in) :: machine
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: list(:)
    real(wp), intent(in) :: impulse(:)
    type(multibody_state_t), intent(inout) :: state
    real(wp), dimension(size(list)) :: left, r, y, none
    real(wp) :: g(size(list), size(list)), magnitude(machine%n), kick(machine%n, size(list)), s, u
    logical :: moves(size(list)), blurred, ok
    integer :: i, k, side(size(list))
    magnitude = abs(state%v(:machine%n))
    do i = 1, size(list)
      kick(:, i) = matmul(machine%mobility, machine%joints(list(i))%row)
      magnitude = magnitude + abs(impulse(i)*kick(:, i))
    end do
    blurred = .false.
    do i = 1, size(list)
      g(:, i) = [(sum(machine%joints(list(k))%row*kick(:, i)), k=1, size(list))]
      call joint_motion(machine, list(i), state%q, state%v, state%time, turning, s, u)
      left(i) = u
      moves(i) = abs(u) > 64*epsilon(u)*(sum(abs(machine%joints(list(i))%row)*magnitude) + abs(machine%joints(list(i))%offset%rate))
      if (moves(i)) cycle
      blurred = blurred .or. abs(u) > machine%negligible_speed + rounding_of_speed(machine, list(i), state)
    end do
    if (.not. blurred) return
    none = huge(1.0_wp)
    side = 0
    call solve_bounded_lcp(g, left, -none, none, moves, 0.0_wp, side, r, y, ok)
    state%v(:machine%n) = state%v(:machine%n) + matmul(kick, r)
  end subroutine still

  !> Impulses of contacts with the opening speeds `gamma` and restitutions `e`.
  pure subroutine speeds_after(g, gamma, e, in_sequence, impulse, ok)
    real(wp), intent(in) :: g(:, :), gamma(:), e(:)
    logical, intent(in) :: in_sequence
    real(wp), intent(out) :: impulse(:)
    logical, intent(out) :: ok
    real(wp), dimension(size(gamma)) :: speed, part
    real(wp) :: first
    integer :: i, count_impacts
    if (.not. in_sequence .or. size(gamma) == 1) then
      call together(g, gamma, shared(g, e), impulse, ok)
      return
    end if
    impulse = 0
    speed = gamma
    first = -minval(gamma)
    do count_impacts = 1, longest_sequence
      i = minloc(speed, 1)
      if (speed(i) >= 0) then
        ok = .true.
        return
      end if
      if (-speed(i) <= spent*first) exit
      part(i) = -(1 + e(i))*speed(i)/g(i, i)
      impulse(i) = impulse(i) + part(i)
      speed = speed + g(:, i)*part(i)
    end do
    call together(g, speed, 0*e, part, ok)
    impulse = impulse + part
  end subroutine speeds_after

  pure subroutine together(g, gamma, e, impulse, ok)
    real(wp), intent(in) :: g(:, :), gamma(:), e(:)
    real(wp), intent(out) :: impulse(:)
    logical, intent(out) :: ok
    real(wp), dimension(size(gamma)) :: zero, none, y
    logical :: fixed(size(gamma))
    integer :: side(size(gamma))
    zero = 0
    none = huge(1.0_wp)
    fixed = .false.
    side = merge(0, -1, gamma < 0)
    call solve_bounded_lcp(g, (1 + e)*gamma, zero, none, fixed, 8*epsilon(1.0_wp)*maxval(abs(gamma)), side, impulse, y, ok)
    impulse = max(impulse, 0.0_wp)
  end subroutine together

  !> The smallest restitution of all contacts that act on each other.
  pure function shared(g, e) result(smallest)
    real(wp), intent(in) :: g(:, :), e(:)
    real(wp) :: smallest(size(e)), before(size(e))
    integer :: i
    smallest = e
    do
      before = smallest
      do i = 1, size(e)
        smallest(i) = minval(before, mask=abs(g(:, i)) > 1e-12_wp*g(i, i))
      end do
      if (.not. any(smallest < before)) return
    end do
  end function shared

end module simultaneous_impact
