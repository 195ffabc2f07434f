! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the kernel for tapes shares with its callers, member by member as `tape_types.hpp` has it, beside the `lane_batch_t` that
!> controls the lanes.
module tape_lane_types
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  implicit none
  private

  integer, parameter, public :: tape_lane_count = 16
  integer, parameter, public :: lane_tape_order = 18, most_tape_nodes = 192, most_tape_series = 64, most_tape_variables = 12, &
    most_tape_switches = 8, most_tape_checks = 16, most_tape_terms = 256, tape_levels = 10, tape_speeds = 4, &
    tape_boxes = tape_levels*tape_speeds, most_tape_section = 10, most_tape_regions = 64
  integer, parameter :: metric_numbers = (most_tape_section*(most_tape_section + 1))/2
  !> Operations beside those of `operations`: products and quotients with a factor that does not vary; the sign of slip, and a
  !> branch by it; sine and cosine of an argument that grows evenly in time; a sum of terms.
  integer, parameter, public :: op_scale = 25, op_divide_steady = 26, op_slip = 27, op_select_slip = 28, op_sin_even = 29, &
    op_cos_even = 30, op_sum = 31

  !> Mirrors `tape_node` of tape_types.hpp. Numbers of nodes and series begin with 0.
  type, bind(c), public :: lane_node_t
    integer(c_int) :: operation = 0, first = 0, second = 0, first_series = -1, second_series = -1, series = -1, slopes = -1, &
      other = 0
    real(c_double) :: value = 0
  end type lane_node_t

  !> Mirrors `tape_term` of tape_types.hpp.
  type, bind(c), public :: lane_term_t
    integer(c_int) :: node = 0, factor = 0
  end type lane_term_t

  !> Mirrors `tape_operand` of tape_types.hpp.
  type, bind(c), public :: lane_operand_t
    integer(c_int) :: index = -1, moves = 0
  end type lane_operand_t

  !> Mirrors `tape_operation` of tape_types.hpp.
  type, bind(c), public :: lane_operation_t
    integer(c_int) :: operation = 0, node = 0, steady = 0, first = -1, second = -1, own = -1, slopes = -1, count = 0
    type(lane_operand_t) :: a, b, to
  end type lane_operation_t

  !> Mirrors `tape_even` of tape_types.hpp.
  type, bind(c), public :: lane_even_t
    integer(c_int) :: operation = 0, node = 0, series = -1, slopes = -1, other = 0, unused = 0
  end type lane_even_t

  !> Mirrors `tape_change` of tape_types.hpp.
  type, bind(c), public :: lane_change_t
    type(lane_operand_t) :: from
    integer(c_int) :: factor = -1, slopes = -1
  end type lane_change_t

  !> Mirrors `tape_check` of tape_types.hpp.
  type, bind(c), public :: lane_check_t
    integer(c_int) :: node = 0, argument = -1, own = -1, unused = 0
  end type lane_check_t

  !> Mirrors `tape_region` of tape_types.hpp.
  type, bind(c), public :: tape_region_t
    real(c_double) :: attractor = 0, point(most_tape_section) = 0, scaling(most_tape_section) = 0, metric(metric_numbers) = 0, &
      reach = 0
  end type tape_region_t

  !> Mirrors `tape_machine` of tape_types.hpp.
  type, bind(c), public :: tape_machine_t
    integer(c_int) :: nodes = 0, by_slip = 0, varying = 0, variables = 0, clock = 0, switches = 0, proves = 1, turns_freely = 0, &
      passes = 0, checks = 0, terms = 0, branches_by_slip = 0, hold = 0, level = -1, throws = -1, bounce = -1
    integer(c_int) :: rate(most_tape_variables) = 0, decider(most_tape_switches) = 0, decider_series(most_tape_switches) = -1
    type(lane_check_t) :: check(most_tape_checks)
    type(lane_term_t) :: term(most_tape_terms)
    type(lane_node_t) :: node(most_tape_nodes)
    integer(c_int) :: operations = 0, evens = 0
    type(lane_operation_t) :: operation(most_tape_nodes)
    type(lane_operand_t) :: part(most_tape_terms)
    type(lane_even_t) :: even(most_tape_nodes)
    type(lane_change_t) :: change(most_tape_variables)
    real(c_double) :: unit = 1, tolerance = 0, sizes(most_tape_variables) = 1
    real(c_double) :: box(most_tape_variables) = 1, speed(tape_speeds) = 0, level_size(tape_levels) = 0, &
      longest(tape_boxes) = 0, remainder(most_tape_variables, tape_boxes) = 0
    real(c_double) :: upper = 0, lower = 0, restitution = 0, hold_level = 0, friction = 0, damping = 0, stiffness = 0, mass = 1, &
      length = 1, longest_rest = 0, throw_factor = 0, period = 0, phase_speed = 0, domain = 0
  end type tape_machine_t

  !> Mirrors `tape_batch` of tape_types.hpp.
  type, bind(c), public :: tape_batch_t
    integer(c_int) :: regions = 0, complete = 1
    type(tape_region_t) :: region(most_tape_regions)
    real(c_double) :: z(tape_lane_count, most_tape_variables) = 0
    real(c_double), dimension(tape_lane_count) :: time = 0, slip = 1, since = 0, phase_end = 0, passed = 0, lasted = 0, &
      limit = huge(1.0_c_double), origin = 0, crossed = 0, proven = 1
  end type tape_batch_t

end module tape_lane_types
