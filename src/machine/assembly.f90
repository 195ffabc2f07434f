! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Builds a multibody structure from bodies, springs, joints and drives, by name. `finish` eliminates the bodies whose
!> motion is given, merges parallel friction, and checks the whole. Messages of errors begin with the key.
module assembly
  use constants, only: two_pi
  use eigen, only: symmetric_eigen, undamped_modes
  use errors, only: error_t, fail
  use multibody, only: count_switches, is_stop, joint_elastic, joint_friction, joint_spring, joint_t, &
    multibody_t, most_degrees, most_joints, most_load_switches, name_length, reads_clock, wave_t
  use joint_forces, only: is_curved
  use normal_force, only: number_contacts, size_of_load
  use kinds, only: wp
  use matrices, only: solve
  use shared_friction, only: merge_friction
  use status, only: exit_bad_case
  use text, only: to_text
  implicit none
  private

  public :: add_body, add_link, add_joint, add_force, give_motion, move_surface, finish, set_sizes, index_of

  !> A stop or a rebound that the forces end within this share of a period is none.
  real(wp), parameter :: briefest = 1e-11_wp

contains

  !> A body of `mass` [kg] under a constant force `load` [N].
  pure subroutine add_body(machine, name, mass, load)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: mass, load
    character(len=name_length), allocatable :: names(:)
    integer :: n
    if (.not. allocated(machine%names)) then
      allocate (machine%names(0), machine%mass(0, 0), machine%damping(0, 0), machine%stiffness(0, 0), machine%load(0), &
                machine%joints(0), machine%given_names(0), machine%given(0), machine%force(0, 0), machine%start(2, 0))
    end if
    n = machine%n + 1
    names = [character(len=name_length) :: machine%names, name]
    call move_alloc(names, machine%names)
    call enlarge(machine%mass)
    call enlarge(machine%damping)
    call enlarge(machine%stiffness)
    machine%load = [machine%load, load]
    machine%mass(n, n) = mass
    machine%n = n
    machine%start = reshape([machine%start, 0.0_wp, 0.0_wp], [2, n])
    call widen_force(machine, size(machine%force, 2))
  contains
    pure subroutine enlarge(matrix)
      real(wp), allocatable, intent(inout) :: matrix(:, :)
      real(wp), allocatable :: larger(:, :)
      allocate (larger(n, n), source=0.0_wp)
      larger(:n - 1, :n - 1) = matrix
      call move_alloc(larger, matrix)
    end subroutine enlarge
  end subroutine add_body

  !> Room for `harmonics` harmonics of the forces.
  pure subroutine widen_force(machine, harmonics)
    type(multibody_t), intent(inout) :: machine
    integer, intent(in) :: harmonics
    complex(wp), allocatable :: larger(:, :)
    integer :: rows, columns
    rows = size(machine%force, 1)
    columns = size(machine%force, 2)
    allocate (larger(machine%n, max(harmonics, columns)), source=(0.0_wp, 0.0_wp))
    larger(:rows, :columns) = machine%force
    call move_alloc(larger, machine%force)
  end subroutine widen_force

  !> Number of a body, 0 if there is none of that name.
  pure integer function index_of(machine, name) result(at)
    type(multibody_t), intent(in) :: machine
    character(len=*), intent(in) :: name
    do at = machine%n, 1, -1
      if (machine%names(at) == name) return
    end do
    at = 0
  end function index_of

  !> A linear spring [N/m] and damper [N s/m] along a row; no force where the row is `length` [m].
  pure subroutine add_link(machine, row, stiffness, damping, length)
    type(multibody_t), intent(inout) :: machine
    real(wp), intent(in) :: row(:), stiffness, damping, length
    integer :: k
    do k = 1, machine%n
      machine%stiffness(:, k) = machine%stiffness(:, k) + stiffness*row*row(k)
      machine%damping(:, k) = machine%damping(:, k) + damping*row*row(k)
    end do
    machine%load = machine%load + stiffness*length*row
    machine%rest_energy = machine%rest_energy + 0.5_wp*stiffness*length**2
  end subroutine add_link

  pure subroutine add_joint(machine, joint)
    type(multibody_t), intent(inout) :: machine
    type(joint_t), intent(in) :: joint
    type(joint_t), allocatable :: joints(:)
    integer :: i
    allocate (joints(size(machine%joints) + 1))
    do i = 1, size(machine%joints)
      joints(i) = machine%joints(i)
    end do
    joints(size(joints)) = joint
    call move_alloc(joints, machine%joints)
  end subroutine add_joint

  !> A force along a row: its mean, and Re harmonic(m) exp(i m Omega t) [N].
  pure subroutine add_force(machine, row, mean, harmonic)
    type(multibody_t), intent(inout) :: machine
    real(wp), intent(in) :: row(:), mean
    complex(wp), intent(in) :: harmonic(:)
    integer :: m
    machine%load = machine%load + mean*row
    call widen_force(machine, size(harmonic))
    do m = 1, size(harmonic)
      machine%force(:, m) = machine%force(:, m) + harmonic(m)*row
    end do
  end subroutine add_force

  !> Gives the motion of a body [m]; `finish` takes it out of the coordinates.
  pure subroutine give_motion(machine, name, wave)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: name
    type(wave_t), intent(in) :: wave
    type(wave_t), allocatable :: given(:)
    character(len=name_length), allocatable :: names(:)
    integer :: i
    allocate (given(size(machine%given) + 1))
    do i = 1, size(machine%given)
      given(i) = machine%given(i)
    end do
    given(size(given)) = wave
    call move_alloc(given, machine%given)
    names = [character(len=name_length) :: machine%given_names, name]
    call move_alloc(names, machine%given_names)
  end subroutine give_motion

  !> The surface that a joint rubs or meets moves: `wave` is its velocity [m/s].
  pure subroutine move_surface(joint, frequency, wave)
    type(joint_t), intent(inout) :: joint
    real(wp), intent(in) :: frequency
    type(wave_t), intent(in) :: wave
    integer :: m
    joint%offset%rate = joint%offset%rate - wave%mean
    if (.not. allocated(wave%harmonic)) return
    call widen_wave(joint%offset, size(wave%harmonic))
    do m = 1, size(wave%harmonic)
      joint%offset%harmonic(m) = joint%offset%harmonic(m) - wave%harmonic(m)/cmplx(0.0_wp, m*frequency, wp)
    end do
  end subroutine move_surface

  pure subroutine widen_wave(wave, harmonics)
    type(wave_t), intent(inout) :: wave
    integer, intent(in) :: harmonics
    complex(wp), allocatable :: larger(:)
    if (.not. allocated(wave%harmonic)) allocate (wave%harmonic(0))
    if (size(wave%harmonic) >= harmonics) return
    allocate (larger(harmonics), source=(0.0_wp, 0.0_wp))
    larger(:size(wave%harmonic)) = wave%harmonic
    call move_alloc(larger, wave%harmonic)
  end subroutine widen_wave

  !> Completes a machine: what is given leaves the coordinates, friction on the same row becomes one joint, sizes of
  !> rounding are set. Without a `frequency` the period is that of the slowest mode, one second without any.
  pure subroutine finish(machine, error)
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: squares(:), shapes(:, :)
    integer :: i, k
    logical :: found
    if (.not. allocated(machine%start_shape)) then
      allocate (machine%start_shape(machine%n, 2), source=0.0_wp)
      machine%start_shape(machine%watched, :) = 1
    end if
    do k = 1, size(machine%given)
      call take_out(machine, trim(machine%given_names(k)), machine%given(k), error)
      if (allocated(error)) return
    end do
    do k = 1, size(machine%joints)
      call take_viscous(machine, k)
    end do
    call merge_friction(machine, i, k)
    if (k > 0) call fail(error, exit_bad_case, trim(machine%joints(k)%name)//'.law: found friction on the surface of '// &
                         trim(machine%joints(i)%name)//' that does not add up to one law with it, allowed the same law, or '// &
                         'the sum in one of them')
    if (allocated(error)) return
    call number_contacts(machine)
    call check(machine, error)
    if (allocated(error)) return
    allocate (squares(machine%n), shapes(machine%n, machine%n), machine%mobility(machine%n, machine%n))
    call undamped_modes(machine%stiffness, machine%mass, squares, shapes)
    ! Not from the modes, but for rounding the same: what an impulse does not reach has an exact zero.
    do k = 1, machine%n
      call solve(machine%mass, [(merge(1.0_wp, 0.0_wp, i == k), i=1, machine%n)], machine%mobility(:, k), found)
    end do
    machine%mobility = (machine%mobility + transpose(machine%mobility))/2
    machine%driven = machine%frequency > 0
    machine%period = 1
    if (.not. machine%driven .and. reads_clock(machine)) machine%section_time = two_pi/own_frequency(squares)
    if (.not. machine%driven .and. machine%section_time > 0) machine%frequency = two_pi/machine%section_time
    if (machine%frequency > 0) then
      machine%period = two_pi/machine%frequency
    else
      machine%frequency = own_frequency(squares)
      machine%period = two_pi/machine%frequency
    end if
    call set_sizes(machine, 0.0_wp)
  end subroutine finish

  !> Angular frequency of the slowest mode [rad/s], given the squares of all; one turn per second without any.
  pure real(wp) function own_frequency(squares) result(frequency)
    real(wp), intent(in) :: squares(:)
    frequency = two_pi
    associate (largest => squares(size(squares)))
      if (largest > 0) frequency = sqrt(squares(count(squares <= 1e-12_wp*largest) + 1))
    end associate
  end function own_frequency

  !> Takes a body whose motion is given out of the coordinates: its springs and dampers become forces, its joints get an
  !> offset.
  pure subroutine take_out(machine, name, wave, error)
    type(multibody_t), intent(inout) :: machine
    character(len=*), intent(in) :: name
    type(wave_t), intent(in) :: wave
    type(error_t), allocatable, intent(out) :: error
    complex(wp) :: iw
    real(wp) :: w
    integer, allocatable :: rest(:)
    integer :: at, i, m, harmonics
    at = index_of(machine, name)
    if (at == 0) return
    rest = pack([(i, i=1, machine%n)], [(i, i=1, machine%n)] /= at)
    if (size(rest) == 0) then
      call fail(error, exit_bad_case, 'body: found no body that is free to move, allowed at least one')
      return
    end if
    harmonics = 0
    if (allocated(wave%harmonic)) harmonics = size(wave%harmonic)
    if (abs(wave%rate) > 0 .and. any(abs(machine%stiffness(rest, at)) > 0)) then
      call fail(error, exit_bad_case, 'drive: found a body that moves away at a constant velocity with a spring on it, '// &
                'allowed without springs')
      return
    end if
    call widen_force(machine, harmonics)
    machine%rest_energy = machine%rest_energy + (0.5_wp*machine%stiffness(at, at)*wave%mean - machine%load(at))*wave%mean
    machine%load(rest) = machine%load(rest) - machine%stiffness(rest, at)*wave%mean - machine%damping(rest, at)*wave%rate
    do m = 1, harmonics
      w = m*machine%frequency
      iw = cmplx(0.0_wp, w, wp)
      machine%force(rest, m) = machine%force(rest, m) &
        - (machine%stiffness(rest, at) + iw*machine%damping(rest, at) - w**2*machine%mass(rest, at))*wave%harmonic(m)
    end do
    do i = 1, size(machine%joints)
      call take_out_of_joint(machine%joints(i), at, rest, wave)
    end do
    if (machine%watched == at) then
      machine%watched = 1
      machine%start_shape(:, :) = 0
      machine%start_shape(rest(1), :) = 1
    end if
    if (machine%watched > at) machine%watched = machine%watched - 1
    machine%mass = machine%mass(rest, rest)
    machine%damping = machine%damping(rest, rest)
    machine%stiffness = machine%stiffness(rest, rest)
    machine%load = machine%load(rest)
    machine%force = machine%force(rest, :)
    machine%names = machine%names(rest)
    machine%start = machine%start(:, rest)
    machine%start_shape = machine%start_shape(rest, :)
    machine%n = size(rest)
  end subroutine take_out

  !> The same of the rows of one joint, its memory and its load.
  pure subroutine take_out_of_joint(joint, at, rest, wave)
    type(joint_t), intent(inout) :: joint
    integer, intent(in) :: at, rest(:)
    type(wave_t), intent(in) :: wave
    integer :: m
    call take_out_of_row(joint%row, joint%offset, at, rest, wave)
    if (allocated(joint%memory)) then
      call take_out_of_row(joint%memory%slide%row, joint%memory%slide%offset, at, rest, wave)
      joint%memory%deflection = joint%memory%deflection(rest)
    end if
    if (.not. allocated(joint%load)) return
    associate (sources => joint%load%sources)
      do m = 1, size(sources)
        call take_out_of_row(sources(m)%row, sources(m)%offset, at, rest, wave)
      end do
    end associate
  end subroutine take_out_of_joint

  !> A coordinate w'q + offset(t) without the body number `at`, which moves as `wave`.
  pure subroutine take_out_of_row(row, offset, at, rest, wave)
    real(wp), allocatable, intent(inout) :: row(:)
    type(wave_t), intent(inout) :: offset
    integer, intent(in) :: at, rest(:)
    type(wave_t), intent(in) :: wave
    integer :: harmonics
    harmonics = 0
    if (allocated(wave%harmonic)) harmonics = size(wave%harmonic)
    offset%mean = offset%mean + row(at)*wave%mean
    offset%rate = offset%rate + row(at)*wave%rate
    if (harmonics > 0 .and. abs(row(at)) > 0) then
      call widen_wave(offset, harmonics)
      offset%harmonic(:harmonics) = offset%harmonic(:harmonics) + row(at)*wave%harmonic
    end if
    row = row(rest)
  end subroutine take_out_of_row

  !> What a machine must be. The mass matrix is positive definite, every joint has a row of its own kind.
  pure subroutine check(machine, error)
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: values(machine%n), vectors(machine%n, machine%n)
    integer :: i
    if (machine%n > most_degrees) then
      call fail(error, exit_bad_case, 'body: found '//to_text(machine%n)//' coordinates, allowed at most '// &
                to_text(most_degrees))
    else if (size(machine%joints) >= most_joints) then
      call fail(error, exit_bad_case, 'joints: found '//to_text(size(machine%joints))//' joints, allowed at most '// &
                to_text(most_joints - 1))
    end if
    if (count_switches(machine) > most_load_switches) call fail(error, exit_bad_case, 'body: found '// &
      to_text(count_switches(machine))//' of abs, sign, min, max and if in the expressions of a machine (a load has one more), '// &
      'allowed at most '//to_text(most_load_switches))
    if (allocated(error)) return
    call symmetric_eigen(machine%mass, values, vectors)
    if (.not. values(1) > 1e-14_wp*values(machine%n)) then
      call fail(error, exit_bad_case, 'body: found a singular mass matrix, allowed a positive mass for every coordinate')
      return
    end if
    do i = 1, size(machine%joints)
      associate (joint => machine%joints(i))
        if (.not. any(abs(joint%row) > 0)) then
          call fail(error, exit_bad_case, trim(joint%name)//'.between: found two ends that are the same, or whose motion is '// &
                    'given, allowed at least one that is free to move')
          return
        end if
        if (is_curved(joint, 1)) machine%linear = .false.
      end associate
    end do
  end subroutine check

  !> What is viscous of friction belongs to the structure, the velocity of the surface being a force on it: where friction
  !> sticks it has no part.
  pure subroutine take_viscous(machine, j)
    type(multibody_t), intent(inout) :: machine
    integer, intent(in) :: j
    type(joint_t) :: joint
    integer :: m
    joint = machine%joints(j)
    associate (damping => joint%friction%damping)
      if (joint%kind /= joint_friction .or. .not. damping > 0) return
      call add_link(machine, joint%row, 0.0_wp, damping, 0.0_wp)
      machine%load = machine%load - damping*joint%offset%rate*joint%row
      if (allocated(joint%offset%harmonic)) then
        call widen_force(machine, size(joint%offset%harmonic))
        do m = 1, size(joint%offset%harmonic)
          machine%force(:, m) = machine%force(:, m) &
            - damping*cmplx(0.0_wp, m*machine%frequency, wp)*joint%offset%harmonic(m)*joint%row
        end do
      end if
    end associate
    machine%joints(j)%friction%damping = 0
  end subroutine take_viscous

  !> Sizes of forces, speeds and lengths for rounding; `inertia` is the force that surfaces which move give bodies [N].
  pure subroutine set_sizes(machine, inertia)
    type(multibody_t), intent(inout) :: machine
    real(wp), intent(in) :: inertia
    real(wp) :: accelerations, largest
    integer :: i
    largest = inertia + sum(abs(machine%load)) + sum(abs(machine%force))
    do i = 1, size(machine%joints)
      associate (joint => machine%joints(i))
        if (joint%kind == joint_friction .or. joint%kind == joint_elastic) then
          largest = largest + joint%friction%break_away*size_of_load(joint, machine%frequency)
        end if
        if (joint%kind == joint_spring .and. allocated(joint%load)) largest = largest + size_of_load(joint, machine%frequency)
        if (is_stop(joint%kind)) then
          if (joint%upper < huge(1.0_wp)) machine%length_scale = max(machine%length_scale, abs(joint%upper))
          if (joint%lower > -huge(1.0_wp)) machine%length_scale = max(machine%length_scale, abs(joint%lower))
        end if
      end associate
    end do
    machine%force_scale = largest
    largest = largest + maxval(abs(machine%stiffness))*machine%length_scale
    accelerations = largest*maxval(abs(machine%mobility))
    machine%length_scale = max(machine%length_scale, accelerations/machine%frequency**2)
    machine%negligible_speed = briefest*machine%period*accelerations
  end subroutine set_sizes

end module assembly
