! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body whose equations are a tape, made ready to fly in lanes: the tape as a list of instructions, and boxes of its variables
!> with the longest step for which the remainder is proven there.
module tape_preparation
  use elementary, only: exponential, logarithm
  use intervals, only: interval_t
  use kinds, only: wp
  use lane_types, only: lane_flow_t
  use operations, only: op_variable
  use tape_body, only: tape_body_t
  use tape_bounds, only: bound_coefficients
  use tape_lane_types, only: lane_tape_order, most_tape_nodes, most_tape_variables, tape_levels, tape_machine_t, tape_speeds
  use tape_nodes, only: set_nodes
  use tape_parts, only: needed
  use tape_program, only: set_program
  use tape_series, only: prepare_series, series_t
  use tape_sums, only: find_sums, tape_sum_t
  implicit none
  private

  public :: prepare_tape_lanes

  !> From box to box: of the speed of the phase, of the other variables; share of a box that a remainder may have; last term of a
  !> step, as a share of the state.
  real(wp), parameter :: speed_growth = 1.3_wp, level_growth = 1.5_wp, margin = 1e-8_wp, &
    tolerance = 1e-12_wp

contains

  !> `flow%available` if a body with a tape can fly in lanes.
  pure subroutine prepare_tape_lanes(body, flow)
    type(tape_body_t), intent(in) :: body
    type(lane_flow_t), intent(inout) :: flow
    type(tape_body_t) :: summed
    type(tape_sum_t), allocatable :: sums(:)
    logical, allocatable :: is_used(:)
    integer, allocatable :: wanted(:), sum_of(:)
    integer :: extra(3)
    flow%available = .false.
    if (size(body%rates) > most_tape_variables) return
    extra = [body%held_by, body%throws, body%bounce]
    wanted = [body%rates, body%hold, pack(extra, extra > 0)]
    is_used = needed(body%tape, wanted)
    where (body%tape%nodes(:body%tape%count)%operation == op_variable) is_used = .true.
    summed = body
    call find_sums(summed%tape, wanted, is_used, sums, sum_of)
    if (summed%tape%is_full .or. count(is_used) > most_tape_nodes) return
    allocate (flow%tape)
    call set_constants(body, flow%tape)
    call set_nodes(summed, is_used, sums, sum_of, flow%tape, flow%available)
    if (flow%available) call set_program(flow%tape)
    if (flow%available) call set_boxes(body, flow%tape)
    if (flow%available) flow%resumes = .true.
    if (.not. flow%available) deallocate (flow%tape)
  end subroutine prepare_tape_lanes

  pure subroutine set_constants(body, machine)
    type(tape_body_t), intent(in) :: body
    type(tape_machine_t), intent(inout) :: machine
    machine%variables = size(body%rates)
    machine%unit = scale(1.0_wp, exponent(body%time))
    machine%tolerance = tolerance
    machine%sizes(:size(body%sizes)) = body%sizes
    machine%upper = body%upper
    machine%lower = body%lower
    machine%restitution = body%restitution
    machine%hold_level = body%level
    machine%friction = body%friction
    machine%damping = body%damping
    machine%stiffness = body%stiffness
    machine%mass = body%mass
    machine%length = body%length
    machine%throw_factor = body%throw_factor
    if (body%clock) machine%clock = merge(2, 1, body%goes_on)
    machine%proves = merge(1, 0, body%proves)
    machine%turns_freely = merge(1, 0, body%turns_freely)
    machine%passes = merge(1, 0, body%passes)
    machine%period = body%period
    machine%phase_speed = body%phase_speed
    machine%longest_rest = body%longest_rest
    machine%domain = body%domain
  end subroutine set_constants

  !> Boxes of every speed of the phase at every level of the other variables, and the longest step with a proven remainder in
  !> each; 0 where none is proven: there, and with branches everywhere, lanes bound the range of their own motion.
  pure subroutine set_boxes(body, machine)
    type(tape_body_t), intent(in) :: body
    type(tape_machine_t), intent(inout) :: machine
    real(wp) :: half(size(body%rates)), rates(size(body%rates)), least
    integer :: level, speed, i, n, box
    logical :: is_bounded
    n = size(body%rates)
    machine%longest = 0
    machine%box(:n) = body%sizes
    machine%speed = [(speed_growth**i, i=1, tape_speeds)]
    machine%level_size = [(2*level_growth**i, i=0, tape_levels - 1)]
    if (size(body%tape%switches) > 0 .or. body%goes_on .or. .not. body%proves) return
    do speed = 1, merge(1, tape_speeds, body%clock)
      do level = 1, tape_levels
        box = (speed - 1)*tape_levels + level
        half = body%sizes*machine%level_size(level)
        if (.not. body%clock) half(2) = body%sizes(2)*machine%speed(speed)
        call bound_rates(body, half, machine%unit, rates, is_bounded)
        if (.not. is_bounded) cycle
        least = 1e30_wp
        do i = 1, n
          if (rates(i) > 0) least = min(least, margin*half(i)/rates(i))
        end do
        machine%longest(box) = exponential(logarithm(least)/(lane_tape_order + 1))
        machine%remainder(:n, box) = rates*least
      end do
    end do
  end subroutine set_boxes

  !> Bounds of the first coefficients that the series leave out, in a unit of time, all over a box of half widths `half`.
  pure subroutine bound_rates(body, half, unit, rates, is_bounded)
    type(tape_body_t), intent(in) :: body
    real(wp), intent(in) :: half(:), unit
    real(wp), intent(out) :: rates(:)
    logical, intent(out) :: is_bounded
    type(interval_t) :: box(size(half))
    type(series_t) :: series
    real(wp) :: parameters(size(body%parameters))
    integer :: slip, fault
    real(wp), parameter :: turns = 12.6_wp, above = 1.01_wp
    box%low = -half
    box%high = half
    ! Any angle; any time between two sections.
    box(1) = interval_t(-turns, turns)
    if (body%clock) box(:2) = [interval_t(0.0_wp, 2*body%period), interval_t(0.0_wp, turns)]
    rates = 0
    is_bounded = .false.
    parameters = body%parameters
    call prepare_series(body%tape, lane_tape_order, body%rates, [integer ::], [integer ::], series)
    series%unit = unit
    do slip = -1, 1, 2
      if (body%slip > 0) parameters(body%slip) = slip
      call bound_coefficients(body%tape, box, parameters, series, fault)
      if (fault /= 0) return
      rates = max(rates, above*unit*series%c(lane_tape_order, body%rates)/(lane_tape_order + 1))
    end do
    is_bounded = .true.
  end subroutine bound_rates

end module tape_preparation
