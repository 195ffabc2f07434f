! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A multibody structure made ready to fly in lanes: linear, of few coordinates, with a clock, dry friction and contacts, rigid or
!> linear.
module structure_preparation
  use eigen, only: modulus
  use elementary, only: exponential, sine_cosine
  use friction_law, only: falls
  use guard_search, only: most_radians
  use multibody, only: joint_contact, joint_friction, joint_soft, joint_t, multibody_t
  use multibody_flows, only: multibody_motion_t
  use kinds, only: wp
  use lane_curve, only: restitution_curve_of
  use multibody_state, only: acts_as_spring
  use lane_types, only: lane_flow_t
  use mode_flow, only: mode_flow_t
  use motion_state, only: flight_adaptive
  use structure_functions, only: never_pulls, set_functions
  use structure_types, only: lane_coordinates, lane_drifts, lane_joints, lane_switches, lane_terms, lane_waves, panel_lengths, &
    structure_joint_t, structure_machine_t, structure_mode_t
  implicit none
  private

  public :: prepare_structure_lanes

  !> Over so many radians of the fastest part Taylor's remainder of a speed after five terms is below rounding.
  real(wp), parameter :: taylor_span = 2e-3_wp
  !> Radians of a panel, and how much longer panels may be.
  real(wp), parameter :: coarse = 3.0_wp, widths(panel_lengths) = [4.0_wp, 2.5_wp, 1.6_wp, 1.0_wp]
  !> Shares of the sizes of forces and lengths within which a choice is left to the event loop.
  real(wp), parameter :: rounding = 1e-12_wp
  !> The position of a stop that is not there [m].
  real(wp), parameter :: no_stop = 1e300_wp
  !> Longest end of a chatter that is completed, and shortest flight that ends a burst of impacts, in periods; as in
  !> `multibody_transition` and `multibody_motion`.
  real(wp), parameter :: longest_chatter = 1e-2_wp, burst_gap = 1e-6_wp

contains

  !> `flow%available` if the structure can fly in lanes.
  pure subroutine prepare_structure_lanes(moving, flow)
    type(multibody_motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    integer, allocatable :: switches(:)
    integer :: j, key
    flow%available = fits_lanes(moving)
    if (.not. flow%available) return
    flow%resumes = .true.
    allocate (flow%structure)
    associate (machine => moving%machine, m => flow%structure)
      m%coordinates = machine%n
      m%joints = size(machine%joints)
      m%waves = moving%harmonics
      m%drive_frequency = machine%frequency
      m%period = machine%period
      m%domain = moving%options%domain
      m%slowest = machine%negligible_speed
      m%chatter_share = moving%chatter_share
      m%chatter_time = longest_chatter*machine%period
      m%burst_gap = burst_gap*machine%period
      m%shortest = 10*m%burst_gap
      m%misses = merge(1, 0, moving%notes_misses)
      do j = 1, size(machine%joints)
        call set_joint(machine, j, m%joint(j))
        if (.not. never_pulls(machine%joints(j))) cycle
        m%pushes = m%pushes + 1
        m%joint(j)%push = m%joints + m%pushes
      end do
      switches = pack([(j, j=1, size(machine%joints))], machine%joints%kind /= joint_contact)
      do key = 0, 2**size(switches) - 1
        call set_mode(moving, switches, key, m%mode(key + 1))
        if (m%mode(key + 1)%known > 0) call set_panels(moving, m%mode(key + 1))
      end do
      flow%available = m%mode(1)%known > 0
    end associate
  end subroutine prepare_structure_lanes

  !> Panels over which quintics err by no more than about 2 % of the amplitude of a function: as the fastest exponent of a mode
  !> [rad/s] asks for, and longer; where misses are noted, such that the rate of a gap turns once within.
  pure subroutine set_panels(moving, mode)
    type(multibody_motion_t), intent(in) :: moving
    type(structure_mode_t), intent(inout) :: mode
    real(wp) :: fastest, sine, cosine, shrink
    integer :: l, k, terms
    associate (harmonics => moving%harmonics, frequency => moving%machine%frequency)
      terms = nint(mode%terms)
      fastest = harmonics*frequency
      if (terms > 0) fastest = max(fastest, maxval(hypot(mode%decay(:terms), mode%turn(:terms))))
      mode%close = taylor_span/fastest
      do l = 1, panel_lengths
        mode%panel(l) = coarse/fastest*widths(l)
        if (moving%notes_misses) mode%panel(l) = most_radians/fastest
        mode%steepest(l) = (coarse/mode%panel(l))**6
        if (l == panel_lengths) mode%steepest(l) = huge(1.0_wp)
        do k = 1, harmonics
          call sine_cosine(k*frequency*mode%panel(l), mode%step_sine(k, l), mode%step_cosine(k, l))
        end do
        do k = 1, terms
          call sine_cosine(mode%turn(k)*mode%panel(l), sine, cosine)
          shrink = exponential(-mode%decay(k)*mode%panel(l))
          mode%step_re(k, l) = shrink*cosine
          mode%step_im(k, l) = shrink*sine
        end do
      end do
    end associate
  end subroutine set_panels

  !> Whether the structure is one that the kernel has room and laws for.
  pure logical function fits_lanes(moving) result(fits)
    type(multibody_motion_t), intent(in) :: moving
    integer :: j
    associate (machine => moving%machine)
      fits = machine%driven .and. machine%frequency > 0 .and. machine%linear .and. machine%n <= lane_coordinates .and. &
        moving%harmonics > 0 .and. moving%harmonics <= lane_waves .and. &
        moving%section == 0 .and. &
        size(machine%joints) <= lane_joints .and. moving%options%flight /= flight_adaptive
      fits = fits .and. .not. allocated(machine%controller) .and. .not. allocated(machine%impulses)
      if (.not. fits) return
      fits = count(machine%joints%kind /= joint_contact) <= lane_switches
      do j = 1, size(machine%joints)
        associate (joint => machine%joints(j))
          select case (joint%kind)
          case (joint_friction)
            fits = fits .and. .not. falls(joint%friction) .and. has_plain_level(joint)
          case (joint_contact)
            fits = fits .and. .not. abs(joint%offset%rate) > 0
          case (joint_soft)
            fits = fits .and. acts_as_spring(joint, 1) .and. .not. abs(joint%offset%rate) > 0
          case default
            fits = .false.
          end select
        end associate
      end do
    end associate
  end function fits_lanes

  !> Whether friction takes as much to slide as to hold, or clearly less.
  pure logical function has_plain_level(joint)
    type(joint_t), intent(in) :: joint
    associate (drop => joint%friction%break_away - joint%friction%kinetic)
      has_plain_level = joint%friction%kinetic > 0 .and. .not. joint%friction%damping > 0 .and. &
        (abs(drop) <= rounding*joint%friction%kinetic .or. drop > 1e-6_wp*joint%friction%kinetic)
    end associate
  end function has_plain_level

  pure subroutine set_joint(machine, j, into)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    type(structure_joint_t), intent(inout) :: into
    real(wp) :: kick(machine%n)
    integer :: i
    associate (joint => machine%joints(j), n => machine%n)
      into%row(:n) = joint%row
      if (joint%kind == joint_friction) then
        into%slides = 1
        into%has_upper = 1
        into%has_lower = 1
        into%upper = joint%friction%break_away
        into%lower = -joint%friction%break_away
        into%kinetic = joint%friction%kinetic
        into%even = merge(1, 0, joint%friction%break_away <= joint%friction%kinetic*(1 + rounding))
        into%tie = rounding*max(machine%force_scale, into%upper)
        return
      end if
      into%has_upper = merge(1, 0, joint%upper < huge(1.0_wp))
      into%has_lower = merge(1, 0, joint%lower > -huge(1.0_wp))
      into%upper = min(joint%upper, no_stop)
      into%lower = max(joint%lower, -no_stop)
      into%tie = rounding*machine%length_scale
      if (joint%kind == joint_soft) then
        into%soft = 1
        into%pulls = merge(0, 1, never_pulls(joint))
        into%stiffness = joint%contact%stiffness
        return
      end if
      into%restitution = joint%contact%restitution
      into%restitution_law = joint%contact%kind
      into%coefficients = joint%contact%coefficients
      into%curve = restitution_curve_of(joint%contact%change)
      kick = matmul(machine%mobility, joint%row)
      kick = kick/sum(joint%row*kick)
      into%kick(:n) = kick
      do i = 1, size(machine%joints)
        associate (row => machine%joints(i)%row)
          if (abs(sum(row*kick)) > rounding*sum(abs(row*kick))) into%cross(i) = sum(row*kick)
        end associate
      end do
    end associate
  end subroutine set_joint

  !> The mode in which the joints whose bits are set in `key` stick or are pressed.
  pure subroutine set_mode(moving, switches, key, mode)
    type(multibody_motion_t), intent(in) :: moving
    integer, intent(in) :: switches(:), key
    type(structure_mode_t), intent(inout) :: mode
    integer :: i, k, bits, terms
    bits = 0
    do i = 1, size(switches)
      if (btest(key, i - 1)) bits = ibset(bits, switches(i) - 1)
    end do
    associate (machine => moving%machine, flow => moving%flows(bits + 1))
      if (.not. flow%modal) return
      terms = size(flow%exponent)
      if (terms > lane_terms .or. flow%damped + flow%rigid > lane_drifts) return
      ! What grows has no bounds.
      if (any(real(flow%exponent) > rounding*modulus(flow%exponent))) return
      ! The event loop decides whether what is held by surfaces that move stands still.
      if (size(flow%basis, 2) == 0 .and. any([(goes_anywhere(machine%joints(flow%held(i))), i=1, size(flow%held))])) return
      mode%known = 1
      mode%terms = terms
      mode%drifts = flow%damped + flow%rigid
      mode%idle = merge(1, 0, size(flow%basis, 2) == 0)
      mode%decay(:terms) = -real(flow%exponent)
      mode%turn(:terms) = aimag(flow%exponent)
      call set_amplitudes(machine, flow, mode)
      call set_functions(machine, flow, mode)
      do i = 1, size(switches)
        if (btest(bits, switches(i) - 1) .or. machine%joints(switches(i))%kind /= joint_friction) cycle
        associate (holding => moving%flows(ibset(bits, switches(i) - 1) + 1))
          k = findloc(holding%held, switches(i), 1)
          mode%felt_mass(switches(i)) = holding%hold(k, k)
          ! Joints that depend on each other share a force in more ways than one.
          if (size(holding%independent) < size(holding%held)) mode%known = 0
        end associate
      end do
      if (size(flow%independent) < size(flow%held)) mode%known = 0
    end associate
  end subroutine set_mode

  !> Whether the surface of a joint moves.
  pure logical function goes_anywhere(joint)
    type(joint_t), intent(in) :: joint
    goes_anywhere = abs(joint%offset%rate) > 0 .or. allocated(joint%offset%harmonic)
  end function goes_anywhere

  !> From the state to the amplitudes and what is along the directions without a spring, and back.
  pure subroutine set_amplitudes(machine, flow, mode)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(structure_mode_t), intent(inout) :: mode
    real(wp) :: project(size(flow%basis, 2), machine%n)
    complex(wp) :: by_position(machine%n), by_speed(machine%n)
    integer :: i, k, m, f
    f = flow%flexible
    project = matmul(transpose(flow%basis), machine%mass)
    associate (n => machine%n, d => flow%damped)
      do i = 1, d + flow%rigid
        mode%drift(:n, i) = flow%basis(:, f + i)
        mode%position_from_position(i, :n) = project(f + i, :)
        if (i > d) mode%pace_from_speed(i, :n) = project(f + i, :)
      end do
      do k = 1, size(flow%exponent)
        by_position = 0
        by_speed = 0
        do i = 1, f
          by_position = by_position + flow%left(k, i)*flow%frequency(i)*project(i, :)
        end do
        do i = 1, f + d
          by_speed = by_speed + flow%left(k, f + i)*project(i, :)
        end do
        mode%from_position_re(k, :n) = real(by_position)
        mode%from_position_im(k, :n) = aimag(by_position)
        mode%from_speed_re(k, :n) = real(by_speed)
        mode%from_speed_im(k, :n) = aimag(by_speed)
        mode%shape_re(:n, k) = real(flow%shape(:, k))
        mode%shape_im(:n, k) = aimag(flow%shape(:, k))
        ! The exponentials carry a part of the damped directions.
        do i = 1, d
          mode%position_from_position(i, :n) = mode%position_from_position(i, :n) - real(flow%drift(i, k)*by_position)
          mode%position_from_speed(i, :n) = mode%position_from_speed(i, :n) - real(flow%drift(i, k)*by_speed)
        end do
      end do
      do m = 1, size(flow%response, 2)
        mode%wave_re(:n, m) = real(flow%response(:, m))
        mode%wave_im(:n, m) = aimag(flow%response(:, m))
      end do
    end associate
  end subroutine set_amplitudes

end module structure_preparation
