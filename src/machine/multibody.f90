! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A multibody structure: a linear structure of n coordinates,
!>   M q'' + C q' + K q = load + Re sum_m force_m exp(i m Omega t) + sum over joints of w r,
!> whose joints act along rows w: the joint coordinate is s = w'q + offset(t), the force of the joint is r.
!> Friction slides at u = s'; a contact bounds s from above, below or both.
module multibody
  use bristle_law, only: bristle_t
  use contact_law, only: contact_t
  use friction_law, only: friction_t
  use kinds, only: wp
  use tape, only: tape_t
  implicit none
  private

  public :: wave_value, harmonics_in, offset_of, is_stop, integral_of, reads_clock, count_switches

  !> One joint more than a machine may have: the section of a motion without a clock.
  integer, parameter, public :: most_degrees = 64, most_joints = 49

  !> Most switching functions of all expressions of a machine.
  integer, parameter, public :: most_load_switches = 32

  !> Kinds of joints: dry friction, spring and slider in series, rigid contact, contact with a force over penetration,
  !> a spring whose force is not linear, one without force at which the watched coordinate turns round, and friction with memory.
  integer, parameter, public :: joint_friction = 1, joint_elastic = 2, joint_contact = 3, joint_soft = 4, joint_spring = 5, &
    joint_section = 6, joint_bristle = 7

  !> How the speeds after an impact of several contacts at once are found.
  integer, parameter, public :: together_newton = 0, together_sequence = 1

  integer, parameter, public :: name_length = 48

  !> mean + rate t + Re sum over m of harmonic(m) exp(i m Omega t), t being time since the section.
  type, public :: wave_t
    real(wp) :: mean = 0, rate = 0
    complex(wp), allocatable :: harmonic(:)
  end type wave_t

  !> What a normal force depends on: a coordinate w'q + offset(t), or the force of the soft contact of that coordinate.
  type, public :: source_t
    real(wp), allocatable :: row(:)
    type(wave_t) :: offset
    !> Name and number of the contact; '' and 0 without one.
    character(len=name_length) :: contact = ''
    integer :: joint = 0
  end type source_t

  !> Normal force of friction, or the force of a joint [N], an expression. Its variables are the time [s], the phase [rad], and of
  !> each source its value and its first three derivatives by the time.
  type, public :: load_t
    type(tape_t) :: tape
    integer :: node = 0
    !> Node of the rate of each variable.
    integer, allocatable :: rates(:)
    real(wp), allocatable :: parameters(:)
    type(source_t), allocatable :: sources(:)
    !> The time is counted from the start, else from the section.
    logical :: by_clock = .false.
    !> Number of the parameter that is the direction of sliding: 1, -1, 0 at rest. None if it is 0.
    integer :: slip = 0
  end type load_t

  !> Friction with memory. The deflection z [m] is the velocity of a coordinate of its own, of the mass s0, whose kinetic energy
  !> is that of the bristles. One joint acts along the surfaces with the force r, and one on the coordinate with s0 z'.
  type, public :: memory_t
    type(bristle_t) :: law
    !> The joint acts on the deflection.
    logical :: on_deflection = .false.
    !> Sliding speed, and the row of the deflection.
    type(source_t) :: slide
    real(wp), allocatable :: deflection(:)
  end type memory_t

  type, public :: joint_t
    character(len=name_length) :: name = ''
    integer :: kind = joint_friction
    real(wp), allocatable :: row(:)
    !> The part of the joint coordinate that is given: a belt, a moving stop, a body whose motion is given.
    type(wave_t) :: offset
    !> Friction, of the slider too.
    type(friction_t) :: friction
    !> Contact, stops excepted.
    type(contact_t) :: contact
    !> Stops of a contact [m], huge means none.
    real(wp) :: upper = huge(1.0_wp), lower = -huge(1.0_wp)
    !> Spring of elastic friction [N/m]; what a spring has besides the structure's stiffness: -c1 s - c2 s^2 - c3 s^3 - moment sin s
    !> + attraction/(gap - s)^2.
    real(wp) :: stiffness = 0, quadratic = 0, cubic = 0, moment = 0, attraction = 0, gap = 1
    !> What the force of a spring is multiplied by, a function of the time; without one, by 1.
    type(wave_t), allocatable :: strength
    !> Normal force, by which the forces of friction, then coefficients, are multiplied; the whole force of a spring that has one.
    type(load_t), allocatable :: load
    type(memory_t), allocatable :: memory
  end type joint_t

  !> A controller that moves a position s = row'q after a reference, its force u = P e + I (integral of e) + D e' acting along the
  !> row, e = reference - s; the reference runs on from the start. What is continuous of it is part of the structure (`control`).
  type, public :: controller_t
    real(wp), allocatable :: row(:)
    type(wave_t) :: reference
    real(wp) :: proportional = 0, integral = 0, derivative = 0
    !> Time between samples [s], between which the force is held; 0: continuous.
    real(wp) :: sample_time = 0
    !> Number of the coordinate that is the integral of e, 0 without one.
    integer :: integral_at = 0
    !> What the structure has of it: of its stiffness, damping and constant force.
    real(wp), allocatable :: stiffness(:, :), damping(:, :), load(:)
  end type controller_t

  !> An impulse along a row [N s] at a time after the start [s].
  type, public :: impulse_t
    real(wp), allocatable :: row(:)
    real(wp) :: amount = 0, time = 0
  end type impulse_t

  !> A body that drives the watched one through friction and stops alone: what is counted and written down is then that of two
  !> bodies. They stick where the one does not slide over the other; the energy is that of bodies and springs, without that of the
  !> drive and of what presses a stop.
  type, public :: driver_t
    !> Its coordinate; 0 where its motion is given.
    integer :: at = 0
    type(wave_t) :: motion
    !> The stops are its own.
    logical :: carries = .false.
    !> Velocity at which its stops run on [m/s]: the watched coordinate is then counted from where they have come to by the last
    !> section.
    real(wp) :: stops_run = 0
    !> Velocities at which coordinates run on after the reference of a controller [m/s].
    real(wp), allocatable :: running(:)
    !> Constant force of the drive [N].
    real(wp), allocatable :: push(:)
  end type driver_t

  type, public :: multibody_t
    !> Number of coordinates.
    integer :: n = 0
    real(wp), allocatable :: mass(:, :), damping(:, :), stiffness(:, :), load(:)
    !> Energy of the springs where all coordinates are zero [J].
    real(wp) :: rest_energy = 0
    !> Amplitudes of the forces [N], one column per harmonic.
    complex(wp), allocatable :: force(:, :)
    type(joint_t), allocatable :: joints(:)
    !> Names of the coordinates.
    character(len=name_length), allocatable :: names(:)
    !> Names of the reference points whose positions are angles.
    character(len=name_length), allocatable :: angles(:)
    !> Bodies whose motion is given, and how they move.
    character(len=name_length), allocatable :: given_names(:)
    type(wave_t), allocatable :: given(:)
    !> Angular frequency of the drive and period of the section [rad/s, s].
    real(wp) :: frequency = 0, period = 0
    !> Something depends on the time.
    logical :: driven = .false.
    !> Time from section to section of a machine without a drive [s]; 0: its section is an event.
    real(wp) :: section_time = 0
    type(controller_t), allocatable :: controller
    !> In the order of their times.
    type(impulse_t), allocatable :: impulses(:)
    type(driver_t), allocatable :: driver
    integer :: together = together_newton
    !> The coordinate that extremes refer to.
    integer :: watched = 1
    !> Position and velocity at the start.
    real(wp), allocatable :: start(:, :)
    !> Displacements and velocities (columns) of all coordinates at the start for one of the watched coordinate.
    real(wp), allocatable :: start_shape(:, :)
    !> Inverse of the mass matrix.
    real(wp), allocatable :: mobility(:, :)
    !> Sizes for rounding: of forces [N], of speeds that are none [m/s], of lengths [m].
    real(wp) :: force_scale = 0, negligible_speed = 0, length_scale = 0
    !> The motion is linear in every mode.
    logical :: linear = .true.
  end type multibody_t

contains

  !> Value and first two derivatives of a wave at `time` [s], turning(m) = exp(i m Omega t).
  pure subroutine wave_value(wave, frequency, time, turning, value, rate, curvature)
    type(wave_t), intent(in) :: wave
    real(wp), intent(in) :: frequency, time
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: value, rate
    real(wp), intent(out), optional :: curvature
    complex(wp) :: now
    real(wp) :: w
    integer :: m
    value = wave%mean + wave%rate*time
    rate = wave%rate
    if (present(curvature)) curvature = 0
    if (.not. allocated(wave%harmonic)) return
    do m = 1, size(wave%harmonic)
      now = wave%harmonic(m)*turning(m)
      w = m*frequency
      value = value + real(now)
      rate = rate - w*aimag(now)
      if (present(curvature)) curvature = curvature - w**2*real(now)
    end do
  end subroutine wave_value

  !> Number of harmonics of a wave.
  pure integer function harmonics_in(wave)
    type(wave_t), intent(in) :: wave
    harmonics_in = 0
    if (allocated(wave%harmonic)) harmonics_in = size(wave%harmonic)
  end function harmonics_in

  !> Whether a joint is a stop, rigid or soft.
  pure elemental logical function is_stop(kind)
    integer, intent(in) :: kind
    is_stop = kind == joint_contact .or. kind == joint_soft
  end function is_stop

  !> Whether a force depends on the time since the start.
  pure logical function reads_clock(machine)
    type(multibody_t), intent(in) :: machine
    integer :: j
    reads_clock = .false.
    do j = 1, size(machine%joints)
      if (allocated(machine%joints(j)%load)) reads_clock = reads_clock .or. machine%joints(j)%load%by_clock
    end do
  end function reads_clock

  !> Number of switching functions of all expressions.
  pure integer function count_switches(machine) result(switches)
    type(multibody_t), intent(in) :: machine
    integer :: j
    switches = 0
    do j = 1, size(machine%joints)
      if (allocated(machine%joints(j)%load)) switches = switches + size(machine%joints(j)%load%tape%switches)
    end do
  end function count_switches

  !> Number of the coordinate that is the integral of what a controller sees, 0 without one.
  pure integer function integral_of(machine) result(at)
    type(multibody_t), intent(in) :: machine
    at = 0
    if (allocated(machine%controller)) at = machine%controller%integral_at
  end function integral_of

  !> Harmonic m of the offset of a joint, 0 if it has none.
  pure complex(wp) function offset_of(joint, m) result(amplitude)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: m
    amplitude = 0
    if (.not. allocated(joint%offset%harmonic)) return
    if (m <= size(joint%offset%harmonic)) amplitude = joint%offset%harmonic(m)
  end function offset_of

end module multibody
