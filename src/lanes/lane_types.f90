! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the lanes of the C++ kernel share with their callers: the machine and the batch, member by member as `lane_types.hpp`
!> has them.
module lane_types
  use curve_law, only: most_knots
  use kinds, only: wp
  use lane_curve, only: restitution_curve_t
  use structure_types, only: structure_machine_t
  use tape_lane_types, only: tape_machine_t
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_size_t, c_sizeof
  implicit none
  private

  public :: widest_lanes, lane_sizes, separatrix_fly_lanes, law_t, machine_t, mode_t, contact_series_t, region_t, regions_t, table_t

  integer, parameter, public :: lane_count = 16, most_harmonics = 64, layer_nodes = 10, most_regions = 64, &
    series_order = 18, most_impacts = 16, impact_rows = 4

  !> What a lane is doing: nothing, flying, stopped at its time, left to the event loop, just set off.
  real(wp), parameter, public :: lane_idle = 0, lane_flying = 1, lane_stopped = 2, lane_left = 3, lane_fresh = 4

  !> Mirrors `lane_layer` of lane_types.hpp.
  type, bind(c) :: layer_t
    real(c_double) :: excess = 0, thickness = 0, edge = 0, level = 0, precision = 0, steepest = 0
    real(c_double), dimension(layer_nodes) :: speed = 0, force = 0, weight = 0
    real(c_double), dimension(layer_nodes, layer_nodes) :: from_rest = 0, from_edge = 0
    real(c_double), dimension(layer_nodes) :: first_from_rest = 0, second_from_rest = 0, first_from_edge = 0, second_from_edge = 0
  end type layer_t

  !> Mirrors `lane_mode` of lane_types.hpp.
  type, bind(c) :: mode_t
    real(c_double) :: natural = 0, damped = 0, decay = 0, origin = 0, rest = 0
    real(c_double) :: barrier = 0, leads_to = 0, lead = 0, guess = 0, close = 0, stride = 0
    real(c_double) :: bound_periodic = 0, bound_free = 0, sixth_periodic = 0, sixth_free = 0
    real(c_double) :: cosine(most_harmonics) = 0, sine(most_harmonics) = 0
  end type mode_t

  !> Tables of a force: over the extension, over the position, the factor of dry friction over the position, friction over the
  !> speed upwards and downwards, free play over the extension.
  integer, parameter, public :: over_extension = 1, over_position = 2, factor_over_position = 3, over_speed = 4, &
    over_speed_downwards = 5, &
    over_play = 6, tables = 6

  !> Mirrors `lane_table` of lane_types.hpp.
  type, bind(c) :: table_t
    real(c_double) :: knots = 0
    real(c_double), dimension(0:most_knots) :: from = 0, low = 0, high = 0
    real(c_double) :: c(0:3, 0:most_knots) = 0
  end type table_t

  !> Mirrors `lane_law` of lane_types.hpp.
  type, bind(c) :: law_t
    real(c_double) :: series = 0
    real(c_double) :: stiffness = 0, pendulum = 0, cubic = 0, viscous = 0, asymmetric_viscous = 0, quadratic = 0, &
      cubic_damping = 0, kinetic = 0, asymmetric = 0, offset = 0, length = 0
    real(c_double) :: excess(2) = 0, velocity(2) = 1, exponent(2) = 1, edge = 0, rest_friction = 0
    real(c_double) :: dahl_stiffness = 0, dahl_level(2) = 0, inverse_mass = 1, log_scale = 0
    real(c_double) :: foot_rate(0:series_order - 1, most_harmonics) = 0
    real(c_double) :: has_tables = 0
    type(table_t) :: table(tables)
    real(c_double) :: change_at_rest(2) = 0
  end type law_t

  !> Mirrors `lane_contact` of lane_types.hpp.
  type, bind(c) :: contact_series_t
    real(c_double) :: stiffness = 0, damping = 0, twice_exponent = 0, linear = 0, by_impact = 0, foot_terms = 0, foot_time = 0, &
      log_stiffness = 0, log_foot_time = 0
  end type contact_series_t

  !> Mirrors `lane_machine` of lane_types.hpp.
  type, bind(c) :: machine_t
    real(c_double) :: natural = 0, damped = 0, decay = 0, drive_frequency = 0, period = 0
    real(c_double) :: rest = 0, offset = 0, kinetic = 0, break_away = 0
    real(c_double) :: upper = 0, lower = 0, restitution = 0, restitution_law = 0, coefficients(2) = 0, slow = 0, domain = 0
    real(c_double) :: bound_periodic = 0, bound_free = 0, close = 0, stride = 0
    integer(c_int) :: harmonics = 0
    real(c_double) :: cosine(most_harmonics) = 0, sine(most_harmonics) = 0
    type(layer_t) :: layer
    real(c_double) :: several_modes = 0, friction_slope = 0, force_rate = 0
    type(mode_t) :: mode(0:5)
    type(law_t) :: law
    type(contact_series_t) :: contact
    type(restitution_curve_t) :: curve
  end type machine_t

  !> Mirrors `lane_region` of lane_types.hpp.
  type, bind(c) :: region_t
    real(c_double) :: attractor = 0, x = 0, v = 0, scaling_x = 1, scaling_v = 1, metric_xx = 0, metric_xv = 0, metric_vv = 0, &
      reach = 0
  end type region_t

  !> Mirrors `lane_regions` of lane_types.hpp.
  type, bind(c) :: regions_t
    integer(c_int) :: count = 0, complete = 1
    type(region_t) :: region(most_regions)
  end type regions_t

  !> Mirrors `lane_batch` of lane_types.hpp.
  type, bind(c), public :: lane_batch_t
    real(c_double), dimension(lane_count) :: status = lane_idle, until = 0, time = 0, x = 0, v = 0, start = 0, &
      direction = 1, start_v = 0, start_a = 0, start_j = 0, z_re = 0, z_im = 0, up_span = 0, down_span = 0, up_hits = 0, &
      down_hits = 0, found = 0, span = 0, hits = 0, end_x = 0, end_v = 0, end_a = 0, end_j = 0, end_re = 0, end_im = 0, &
      flights = 0, impacts = 0, speed_sum = 0, last_speed = 0, margin = huge(1.0_c_double), sections = 0, &
      budget = huge(1.0_c_double), leaves = 0, elapsed = 0, reached = 0, settled = -1, pressed_on = 0, touch = 0, z = 0, skip = 0, &
      reach = 0, reach_v = 0, reach_a = 0, reach_j = 0, end_s = 0
  end type lane_batch_t

  !> A machine ready to fly in lanes.
  type, public :: lane_flow_t
    !> False if the machine has something that only the event loop knows.
    logical :: available = .false.
    !> Doubles per vector.
    integer :: width = 2
    !> The GPU that flies them, -1: none, vectors do.
    integer :: gpu = -1
    type(machine_t) :: machine
    !> A body must be so fast [m/s] to be put into a lane: out of its Stribeck layer.
    real(wp) :: slowest = 0
    !> Lanes take a trajectory back before its next stop: with a Stribeck layer, and structures.
    logical :: resumes = .false.
    !> A multibody structure.
    type(structure_machine_t), allocatable :: structure
    !> A body whose equations are a tape.
    type(tape_machine_t), allocatable :: tape
  end type lane_flow_t

  interface
    pure function separatrix_lane_width() result(width) bind(c)
      import :: c_int
      integer(c_int) :: width
    end function separatrix_lane_width

    !> Bytes of lane_machine, lane_regions, lane_batch and of the impacts of a sampled lane as C++ has them.
    pure subroutine separatrix_lane_sizes(machine, regions, batch, impacts) bind(c)
      import :: c_size_t
      integer(c_size_t), intent(out) :: machine, regions, batch, impacts
    end subroutine separatrix_lane_sizes

    pure subroutine separatrix_fly_lanes(width, machine, regions, batch) bind(c)
      import :: c_int, lane_batch_t, machine_t, regions_t
      integer(c_int), value :: width
      type(machine_t), intent(in) :: machine
      type(regions_t), intent(in) :: regions
      type(lane_batch_t), intent(inout) :: batch
    end subroutine separatrix_fly_lanes
  end interface

contains

  !> Doubles in the widest vector of this processor.
  pure integer function widest_lanes()
    widest_lanes = separatrix_lane_width()
  end function widest_lanes

  !> Whether both sides of the boundary to C++ agree on the sizes of what they share.
  logical function lane_sizes()
    integer(c_size_t) :: machine, regions, batch, impacts
    type(machine_t) :: one_machine
    type(regions_t) :: one_table
    type(lane_batch_t) :: one_batch
    call separatrix_lane_sizes(machine, regions, batch, impacts)
    lane_sizes = machine == c_sizeof(one_machine) .and. regions == c_sizeof(one_table) .and. batch == c_sizeof(one_batch) .and. &
      impacts == most_impacts*impact_rows*c_sizeof(1.0_c_double)
  end function lane_sizes

end module lane_types
