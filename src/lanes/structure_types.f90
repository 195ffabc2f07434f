! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the kernel for multibody structures shares with its callers, member by member as `structure_types.hpp` has it, beside the
!> `lane_batch_t` that controls the lanes.
module structure_types
  use lane_curve, only: restitution_curve_t
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  implicit none
  private

  integer, parameter, public :: structure_lane_count = 16
  integer, parameter, public :: lane_coordinates = 8, lane_terms = 16, lane_joints = 4, lane_switches = 4, &
    lane_structure_modes = 16, lane_functions = 8, lane_waves = 8, lane_drifts = 4, lane_powers = 4, panel_lengths = 4
  integer, parameter :: section = 2*lane_coordinates, metric_numbers = (section*(section + 1))/2
  integer, parameter, public :: structure_regions = 64

  !> Mirrors `structure_mode` of structure_types.hpp.
  type, bind(c), public :: structure_mode_t
    real(c_double) :: known = 0, terms = 0, drifts = 0, powers = 0, idle = 0
    real(c_double), dimension(lane_terms) :: decay = 0, turn = 0
    real(c_double), dimension(lane_terms, lane_coordinates) :: from_position_re = 0, from_position_im = 0, from_speed_re = 0, &
      from_speed_im = 0
    real(c_double), dimension(lane_coordinates, lane_terms) :: shape_re = 0, shape_im = 0
    real(c_double), dimension(lane_coordinates, lane_waves) :: wave_re = 0, wave_im = 0
    real(c_double) :: still(lane_coordinates, lane_powers) = 0, still_by_joint(lane_coordinates, lane_joints, lane_powers) = 0
    real(c_double), dimension(lane_drifts, lane_coordinates) :: position_from_position = 0, position_from_speed = 0, &
      pace_from_speed = 0
    real(c_double) :: drift(lane_coordinates, lane_drifts) = 0, level_by_position(lane_functions, lane_drifts) = 0, &
      level_by_pace(lane_functions, lane_drifts, 2) = 0
    real(c_double), dimension(lane_functions, lane_terms) :: part_re = 0, part_im = 0, part_size = 0
    real(c_double), dimension(lane_functions, lane_waves) :: amplitude_re = 0, amplitude_im = 0
    real(c_double) :: level(lane_functions, lane_powers) = 0, level_by_joint(lane_joints, lane_functions, lane_powers) = 0
    real(c_double), dimension(lane_functions) :: steady = 0, steady_sixth = 0
    real(c_double) :: close = 0
    real(c_double), dimension(panel_lengths) :: panel = 0, steepest = 0
    real(c_double), dimension(lane_terms, panel_lengths) :: step_re = 0, step_im = 0
    real(c_double), dimension(lane_waves, panel_lengths) :: step_cosine = 0, step_sine = 0
    real(c_double) :: felt_mass(lane_joints) = 0
  end type structure_mode_t

  !> Mirrors `structure_joint` of structure_types.hpp.
  type, bind(c), public :: structure_joint_t
    real(c_double) :: slides = 0, soft = 0, pulls = 0, stiffness = 0, push = 0, upper = 0, lower = 0, &
      has_upper = 0, has_lower = 0, kinetic = 0, tie = 0, even = 0, restitution = 0, restitution_law = 0, coefficients(2) = 0
    type(restitution_curve_t) :: curve
    real(c_double) :: row(lane_coordinates) = 0, kick(lane_coordinates) = 0, cross(lane_joints) = 0
  end type structure_joint_t

  !> Mirrors `structure_machine` of structure_types.hpp.
  type, bind(c), public :: structure_machine_t
    real(c_double) :: coordinates = 0, joints = 0, pushes = 0, waves = 0, drive_frequency = 0, period = 0, domain = 0
    real(c_double) :: slowest = 0, chatter_share = 0, chatter_time = 0, burst_gap = 0, shortest = 0, misses = 0
    type(structure_joint_t) :: joint(lane_joints)
    type(structure_mode_t) :: mode(lane_structure_modes)
  end type structure_machine_t

  !> Mirrors `structure_region` of structure_types.hpp.
  type, bind(c), public :: structure_region_t
    real(c_double) :: attractor = 0, reach = 0, point(section) = 0, scaling(section) = 0, metric(metric_numbers) = 0
  end type structure_region_t

  !> Mirrors `structure_batch` of structure_types.hpp.
  type, bind(c), public :: structure_batch_t
    real(c_double), dimension(structure_lane_count, lane_coordinates) :: q = 0, v = 0
    real(c_double), dimension(structure_lane_count) :: time = 0, left = 0, rising = 0, burst = 0
    real(c_double), dimension(structure_lane_count, lane_joints) :: phase = 0
    real(c_double) :: start(structure_lane_count) = 0
    real(c_double), dimension(structure_lane_count, lane_terms) :: re = 0, im = 0
    real(c_double) :: held(structure_lane_count, lane_joints) = 0
    real(c_double), dimension(structure_lane_count, lane_drifts) :: position = 0, pace = 0
    real(c_double), dimension(structure_lane_count) :: found = 0, span = 0, joint = 0, side = 0
    real(c_double), dimension(structure_lane_count, lane_terms) :: end_re = 0, end_im = 0
    real(c_double), dimension(structure_lane_count, lane_functions) :: end_f = 0, end_f1 = 0
    real(c_double) :: sticks(structure_lane_count) = 0
    integer(c_int) :: regions = 0, complete = 1
    type(structure_region_t) :: region(structure_regions)
  end type structure_batch_t

end module structure_types
