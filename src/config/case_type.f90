! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The case: everything that a run needs, in SI units.
module case_type
  use axis, only: axis_t, name_length
  use derived_quantities, only: derived_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use refinement, only: refine_t
  implicit none
  private

  !> Positions in `case_t%laws`, the order of `families`; the body is the first.
  integer, parameter, public :: restoring_law = 2, friction_law = 3, &
    contact_law = 4, drive_law = 5

  !> State and crank angle at the beginning.
  type, public :: start_t
    real(wp) :: x0 = 0, v0 = 0, crank_angle = 0
    !> Where x0 comes from, for messages: file and line, or `--set`.
    character(len=:), allocatable :: origin
  end type start_t

  type, public :: run_t
    !> Length of a trajectory and of the window of its steady values (s).
    real(wp) :: duration = 50, window = 12.5_wp
    !> 'captured' or 'duration'.
    character(len=8) :: stop = 'captured'
    !> A trajectory that has not converged goes on up to extension*duration.
    real(wp) :: extension = 4
    !> Largest |x| (m).
    real(wp) :: domain = 1e6_wp
    !> What steady values are taken over: whole drive periods, or the window as it is.
    character(len=13) :: average = 'whole_periods'
  end type run_t

  type, public :: integrator_t
    !> 'auto', 'exact' or 'adaptive'.
    character(len=8) :: flight = 'auto'
    !> Whether many trajectories fly at once, in vectors, where the machine allows: auto or off.
    character(len=8) :: lanes = 'auto'
    !> Relative tolerance of the adaptive flight.
    real(wp) :: tolerance = 1e-13_wp
    !> Most events of one trajectory.
    integer :: event_budget = 1000000
    !> Most steps of its flights that take them.
    integer :: step_budget = 5000000
  end type integrator_t

  type, public :: attractors_t
    !> Starts per slice from which attractors are discovered.
    integer :: sample = 256
    integer :: seed = 1
    !> Longest period looked for, in drive periods.
    integer :: max_period = 16
    !> Most points without an attractor from which attractors are searched again.
    integer :: second_look = 128
  end type attractors_t

  !> Starts drawn at random.
  type, public :: sample_t
    !> How many, and from which sequence.
    integer :: count = 1000, seed = 1
    !> The starts that are drawn: names, units, 'uniform' between `first` and `second` or 'normal' with mean and deviation.
    character(len=name_length), allocatable :: names(:)
    character(len=20), allocatable :: units(:)
    character(len=8), allocatable :: kinds(:)
    real(wp), allocatable :: first(:), second(:)
    !> A row for each of them, a column for each point.
    real(wp), allocatable :: drawn(:, :)
  end type sample_t

  type, public :: sweep_t
    !> Whether the case has a [sweep] table, and if it is not wanted one that lacks nothing; the rest is meaningless without it.
    logical :: present = .false.
    !> Whether a sweep is what is wanted of the case.
    logical :: wanted = .true.
    !> The swept parameter, its unit and its values.
    type(axis_t) :: swept
    !> 'both', 'up' or 'down'.
    character(len=8) :: directions = 'both'
    !> Numbers of brute-force starts over x0 and v0; [0, 0] for none.
    integer :: starts(2) = 7
    !> Ranges of those starts (m, m/s).
    real(wp) :: x0(2) = 0, v0(2) = 0
    !> Stroboscopic samples kept per value.
    integer :: samples = 32
    !> Width to which the limits of a region are bracketed, in units of the parameter.
    real(wp) :: limit_tolerance = 1e-3_wp
  end type sweep_t

  type, public :: trajectory_t
    integer :: samples_per_period = 200
  end type trajectory_t

  !> A sensor: samples per second, noise (one sigma), resolution and delay.
  type, public :: record_t
    real(wp) :: rate = 2000, noise = 0, resolution = 0, delay = 0
    integer :: seed = 1
  end type record_t

  type, public :: case_t
    character(len=:), allocatable :: title
    !> Name of the file and its text as read.
    character(len=:), allocatable :: path, raw_text
    !> The case with every default filled in, itself a case file.
    character(len=:), allocatable :: resolved_text
    !> Defaults that change the physics, for the log.
    character(len=:), allocatable :: assumed
    !> One law per family, in the order of `families`, then the effects.
    type(law_choice_t), allocatable :: laws(:)
    type(start_t) :: start
    type(run_t) :: run
    type(integrator_t) :: integrator
    type(attractors_t) :: attractors
    !> With starts drawn at random the last axis counts them.
    type(axis_t), allocatable :: axes(:)
    type(sample_t) :: sample
    !> Points of a tile along each axis, 0 = automatic.
    integer, allocatable :: tile(:)
    type(refine_t) :: refine
    type(sweep_t) :: sweep
    type(trajectory_t) :: trajectory
    type(record_t) :: record
    !> Quantities derived from motions.
    type(derived_t), allocatable :: derived(:)
  end type case_t

end module case_type
