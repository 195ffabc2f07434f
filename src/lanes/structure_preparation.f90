! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A jointed structure made ready to fly in lanes: linear, of few coordinates, with a clock, dry friction on surfaces that go
!> nowhere and rigid contacts.
module structure_preparation
  use contact_law, only: contact_constant
  use eigen, only: modulus
  use elementary, only: exponential, sine_cosine
  use flight_path, only: begin_change, force_powers, path_t
  use friction_law, only: falls
  use jointed, only: joint_contact, joint_friction, joint_t, jointed_t
  use jointed_flows, only: jointed_motion_t
  use kinds, only: wp
  use lane_types, only: lane_flow_t
  use mode_flow, only: mode_flow_t
  use motion_state, only: flight_adaptive
  use structure_types, only: lane_coordinates, lane_joints, lane_sliders, lane_terms, lane_waves, panel_lengths, &
    structure_joint_t, structure_machine_t, structure_mode_t
  implicit none
  private

  public :: prepare_structure_lanes

  !> Over so many radians of the fastest part Taylor's remainder of a speed after five terms is below rounding.
  real(wp), parameter :: taylor_span = 2e-3_wp
  !> Radians of a panel, and how much longer panels may be.
  real(wp), parameter :: coarse = 3.0_wp, stretches(panel_lengths) = [4.0_wp, 2.5_wp, 1.6_wp, 1.0_wp]
  !> Shares of the sizes of forces and lengths within which a choice is left to the event loop.
  real(wp), parameter :: rounding = 1e-12_wp
  !> Longest end of a chatter that is completed, and shortest flight that ends a burst of impacts, in periods; as in
  !> `jointed_transition` and `jointed_motion`.
  real(wp), parameter :: longest_chatter = 1e-2_wp, burst_gap = 1e-6_wp

contains

  !> `flow%available` if the structure can fly in lanes.
  pure subroutine prepare_structure_lanes(moving, flow)
    type(jointed_motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    integer, allocatable :: sliders(:)
    integer :: j, key
    real(wp) :: fastest
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
      do j = 1, size(machine%joints)
        call set_joint(machine, j, m%joint(j))
      end do
      sliders = pack([(j, j=1, size(machine%joints))], machine%joints%kind == joint_friction)
      fastest = moving%harmonics*machine%frequency
      do key = 0, 2**size(sliders) - 1
        call set_mode(moving, sliders, key, m%mode(key + 1), fastest)
      end do
      m%close = taylor_span/fastest
      call set_panels(fastest, 2**size(sliders), m)
      flow%available = m%mode(1)%known > 0
    end associate
  end subroutine prepare_structure_lanes

  !> Panels over which quintics err by no more than about 2 % of what a function swings: as the fastest exponent [rad/s] asks
  !> for, and longer.
  pure subroutine set_panels(fastest, modes, m)
    real(wp), intent(in) :: fastest
    integer, intent(in) :: modes
    type(structure_machine_t), intent(inout) :: m
    real(wp) :: sine, cosine, shrink
    integer :: l, k, i
    do l = 1, panel_lengths
      m%panel(l) = coarse/fastest*stretches(l)
      m%steepest(l) = (coarse/m%panel(l))**6
      if (l == panel_lengths) m%steepest(l) = huge(1.0_wp)
      do k = 1, nint(m%waves)
        call sine_cosine(k*m%drive_frequency*m%panel(l), m%step_sine(k, l), m%step_cosine(k, l))
      end do
      do i = 1, modes
        associate (mode => m%mode(i))
          do k = 1, nint(mode%terms)
            call sine_cosine(mode%turn(k)*m%panel(l), sine, cosine)
            shrink = exponential(-mode%decay(k)*m%panel(l))
            mode%step_re(k, l) = shrink*cosine
            mode%step_im(k, l) = shrink*sine
          end do
        end associate
      end do
    end do
  end subroutine set_panels

  !> Whether the structure is one that the kernel has room and laws for.
  pure logical function fits_lanes(moving) result(fits)
    type(jointed_motion_t), intent(in) :: moving
    integer :: j
    associate (machine => moving%machine)
      fits = machine%driven .and. machine%linear .and. machine%n <= lane_coordinates .and. moving%harmonics <= lane_waves .and. &
        moving%section == 0 .and. size(machine%joints) <= lane_joints .and. moving%options%flight /= flight_adaptive
      fits = fits .and. .not. allocated(machine%controller) .and. .not. allocated(machine%impulses)
      if (.not. fits) return
      fits = count(machine%joints%kind == joint_friction) <= lane_sliders .and. &
        all(machine%joints%kind == joint_friction .or. machine%joints%kind == joint_contact)
      do j = 1, size(machine%joints)
        associate (joint => machine%joints(j))
          fits = fits .and. .not. abs(joint%offset%rate) > 0
          if (joint%kind == joint_friction) fits = fits .and. .not. falls(joint%friction) .and. has_plain_level(joint)
          if (joint%kind == joint_contact) fits = fits .and. joint%contact%kind == contact_constant
        end associate
      end do
    end associate
  end function fits_lanes

  !> Whether friction takes as much to slide as to hold, or clearly less.
  pure logical function has_plain_level(joint)
    type(joint_t), intent(in) :: joint
    associate (drop => joint%friction%break_away - joint%friction%kinetic)
      has_plain_level = joint%friction%kinetic > 0 .and. .not. joint%friction%damping > 0 .and. &
        (abs(drop) <= 0 .or. drop > 1e-6_wp*joint%friction%kinetic)
    end associate
  end function has_plain_level

  pure subroutine set_joint(machine, j, into)
    type(jointed_t), intent(in) :: machine
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
        into%even = merge(1, 0, joint%friction%break_away <= joint%friction%kinetic)
        into%tie = rounding*max(machine%force_scale, into%upper)
        return
      end if
      into%has_upper = merge(1, 0, joint%upper < huge(1.0_wp))
      into%has_lower = merge(1, 0, joint%lower > -huge(1.0_wp))
      into%upper = joint%upper
      into%lower = joint%lower
      into%restitution = joint%contact%restitution
      into%tie = rounding*machine%length_scale
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

  !> The mode in which the friction joints whose bits are set in `key` stick. `fastest` [rad/s] grows to its largest exponent.
  pure subroutine set_mode(moving, sliders, key, mode, fastest)
    type(jointed_motion_t), intent(in) :: moving
    integer, intent(in) :: sliders(:), key
    type(structure_mode_t), intent(inout) :: mode
    real(wp), intent(inout) :: fastest
    integer :: i, j, k, bits, terms
    bits = 0
    do i = 1, size(sliders)
      if (btest(key, i - 1)) bits = ibset(bits, sliders(i) - 1)
    end do
    associate (machine => moving%machine, flow => moving%flows(bits + 1))
      if (.not. flow%modal .or. flow%damped + flow%rigid > 0) return
      terms = size(flow%exponent)
      if (terms == 0 .or. terms > lane_terms) return
      ! What grows has no bounds.
      if (any(real(flow%exponent) > rounding*modulus(flow%exponent))) return
      mode%known = 1
      mode%terms = terms
      mode%decay(:terms) = -real(flow%exponent)
      mode%turn(:terms) = aimag(flow%exponent)
      fastest = max(fastest, maxval(modulus(flow%exponent)))
      call set_amplitudes(machine, flow, mode)
      do j = 1, size(machine%joints)
        k = findloc(flow%held, j, 1)
        call set_function(machine, flow, j, k, mode)
      end do
      call set_statics(machine, flow, mode)
      do i = 1, size(sliders)
        if (btest(bits, sliders(i) - 1)) cycle
        associate (holding => moving%flows(ibset(bits, sliders(i) - 1) + 1))
          k = findloc(holding%held, sliders(i), 1)
          mode%felt_mass(sliders(i)) = holding%hold(k, k)
          ! Joints that depend on each other share a force in more ways than one.
          if (size(holding%independent) < size(holding%held)) mode%known = 0
        end associate
      end do
      if (size(flow%independent) < size(flow%held)) mode%known = 0
    end associate
  end subroutine set_mode

  !> From the state to the amplitudes, and back.
  pure subroutine set_amplitudes(machine, flow, mode)
    type(jointed_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(structure_mode_t), intent(inout) :: mode
    real(wp) :: project(size(flow%basis, 2), machine%n)
    complex(wp) :: by_place(machine%n), by_speed(machine%n)
    integer :: i, k, m, f
    f = flow%flexible
    project = matmul(transpose(flow%basis), machine%mass)
    associate (n => machine%n)
      do k = 1, size(flow%exponent)
        by_place = 0
        by_speed = 0
        do i = 1, f
          by_place = by_place + flow%left(k, i)*flow%frequency(i)*project(i, :)
          by_speed = by_speed + flow%left(k, f + i)*project(i, :)
        end do
        mode%from_place_re(k, :n) = real(by_place)
        mode%from_place_im(k, :n) = aimag(by_place)
        mode%from_speed_re(k, :n) = real(by_speed)
        mode%from_speed_im(k, :n) = aimag(by_speed)
        mode%shape_re(:n, k) = real(flow%shape(:, k))
        mode%shape_im(:n, k) = aimag(flow%shape(:, k))
      end do
      do m = 1, size(flow%response, 2)
        mode%wave_re(:n, m) = real(flow%response(:, m))
        mode%wave_im(:n, m) = aimag(flow%response(:, m))
      end do
    end associate
  end subroutine set_amplitudes

  !> The function of joint j: the force that holds it as constraint number `held`, its speed, or its coordinate.
  pure subroutine set_function(machine, flow, j, held, mode)
    type(jointed_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    integer, intent(in) :: j, held
    type(structure_mode_t), intent(inout) :: mode
    complex(wp) :: part, swing
    integer :: k, m
    logical :: slides
    slides = machine%joints(j)%kind == joint_friction
    do k = 1, size(flow%exponent)
      if (held > 0) then
        part = flow%force_shape(k, held)
      else
        part = flow%joint_shape(k, j)
        if (slides) part = part*flow%exponent(k)
      end if
      mode%part_re(j, k) = real(part)
      mode%part_im(j, k) = aimag(part)
      mode%part_size(j, k) = modulus(part)
    end do
    do m = 1, size(flow%response, 2)
      if (held > 0) then
        swing = flow%force_response(m, held)
      else
        swing = flow%joint_response(m, j)
        if (slides) swing = swing*cmplx(0.0_wp, m*machine%frequency, wp)
      end if
      mode%swing_re(j, m) = real(swing)
      mode%swing_im(j, m) = aimag(swing)
      mode%steady(j) = mode%steady(j) + modulus(swing)
      mode%steady_sixth(j) = mode%steady_sixth(j) + modulus(swing)*(m*machine%frequency)**6
    end do
  end subroutine set_function

  !> Where the structure would be at rest under its load, and what each joint adds to that: friction in its direction, or the
  !> place where it is held.
  pure subroutine set_statics(machine, flow, mode)
    type(jointed_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(structure_mode_t), intent(inout) :: mode
    real(wp), dimension(machine%n) :: none, force, place
    type(path_t) :: path
    integer :: j, i
    none = 0
    associate (n => machine%n)
      call begin_change(machine, flow, none, none, machine%load, path)
      mode%still(:n) = path%powers(:n, 0)
      call set_levels(path, .true., mode%level)
      do j = 1, size(machine%joints)
        if (machine%joints(j)%kind /= joint_friction) cycle
        i = findloc(flow%held, j, 1)
        force = 0
        place = 0
        if (i > 0) place = flow%carried(:, i)
        if (i == 0) force = -machine%joints(j)%friction%kinetic*machine%joints(j)%row
        call begin_change(machine, flow, place, none, force, path)
        mode%still_by_joint(:n, j) = path%powers(:n, 0)
        call set_levels(path, .false., mode%level_by_joint(j, :))
      end do
    end associate

  contains

    !> Constant parts of the functions of the joints.
    pure subroutine set_levels(path, with_offset, level)
      type(path_t), intent(in) :: path
      logical, intent(in) :: with_offset
      real(wp), intent(inout) :: level(:)
      real(wp) :: powers(0:3)
      integer :: k, held
      do k = 1, size(machine%joints)
        held = findloc(flow%held, k, 1)
        level(k) = 0
        if (held > 0) then
          powers = force_powers(machine, flow, path, held)
          level(k) = powers(0)
        else if (machine%joints(k)%kind == joint_contact) then
          level(k) = sum(machine%joints(k)%row*path%powers(:machine%n, 0))
          if (with_offset) level(k) = level(k) + machine%joints(k)%offset%mean
        end if
      end do
    end subroutine set_levels

  end subroutine set_statics

end module structure_preparation
