! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What must hold between the values of a case, here and for every combination of its axes.
module case_check
  use angle_units, only: unit_of
  use axis, only: axis_t
  use build_multibody, only: is_multibody
  use build_motion, only: machine_of
  use case_parameters, only: is_start, parameter_value, set_parameter
  use case_source, only: case_source_t, report
  use case_type, only: case_t
  use contact_law, only: barriers_are_soft
  use errors, only: error_t, fail
  use grid, only: sample_axis
  use kinds, only: wp
  use law_check, only: check_laws, is_good
  use law_table, only: added_families, effect_family, families, force_family, law_choice_t, state_family
  use motor_choices, only: has_ramp
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use restoring_law, only: position_is_angle
  use status, only: exit_bad_case
  use text, only: to_text
  implicit none
  private

  public :: beyond, check_case, require_axes, require_sweep, require_start

  !> Combinations of axis values that are checked one by one; of more, the corners.
  integer, parameter :: most_combinations = 4096

  !> Axes whose corners are looked at for bodies that overlap.
  integer, parameter :: most_corner_axes = 6

  !> Most points of a tile.
  integer, parameter :: most_tile_points = 2**24

contains

  !> Notes every violated condition between values that are good themselves: whatever can be checked, so that all problems of a
  !> case are reported at once.
  subroutine check_case(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    logical :: of_laws, of_axes, of_sweep
    associate (run => the_case%run)
      if (is_good(source, ['run']) .and. run%window > run%duration) then
        call report(source, 'run.window', 'found '//to_text(run%window)//' s, allowed at most the duration '// &
                    to_text(run%duration)//' s')
      end if
    end associate
    associate (refine => the_case%refine)
      if (is_good(source, ['refine']) .and. modulo(refine%block, refine%step) /= 0) then
        call report(source, 'refine.block', 'found '//to_text(refine%block)//', allowed a multiple of the step '// &
                    to_text(refine%step))
      end if
    end associate
    of_axes = is_good(source, ['axis'])
    of_sweep = the_case%sweep%present .and. the_case%sweep%wanted .and. is_good(source, ['sweep'])
    if (of_axes) call check_axis_order(source, the_case%axes)
    if (of_axes .and. is_good(source, ['grid'])) call check_tiles(source, the_case)
    if (of_axes .and. is_good(source, ['body   ', 'contact', 'effect ', 'start  '])) call check_starts(source, the_case, of_sweep)
    call check_laws(source, the_case%laws, '')
    of_laws = is_good(source, [character(len=len(families)) :: families, effect_family, added_families, force_family, state_family])
    if (of_laws .and. of_axes) call check_combinations(source, the_case, the_case%axes)
    if (of_laws .and. of_sweep) call check_combinations(source, the_case, [the_case%sweep%swept])
  end subroutine check_case

  !> check_laws for the combinations of the values of the law axes, up to the first that fails.
  subroutine check_combinations(source, the_case, axes)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    type(axis_t), intent(in) :: axes(:)
    type(axis_t), allocatable :: varied(:)
    type(law_choice_t) :: laws(size(the_case%laws))
    type(error_t), allocatable :: error
    character(len=:), allocatable :: at
    integer :: digits(size(axes)), i, before
    varied = law_axes(axes)
    if (size(varied) == 0) return
    digits = 1
    before = size(source%problems)
    do
      laws = the_case%laws
      at = ' (at'
      do i = 1, size(varied)
        call set_parameter(laws, trim(varied(i)%name), varied(i)%values(digits(i)), error)
        at = at//' '//trim(varied(i)%name)//' = '//to_text(varied(i)%values(digits(i)))
      end do
      call check_laws(source, laws, at//')')
      if (size(source%problems) > before) return
      ! The next combination, counting like an odometer.
      do i = size(varied), 1, -1
        digits(i) = digits(i) + 1
        if (digits(i) <= size(varied(i)%values)) exit
        digits(i) = 1
      end do
      if (i == 0) return
    end do
  end subroutine check_combinations

  !> The axes over parameters of laws; only their ends if there are too many combinations.
  pure function law_axes(axes) result(varied)
    type(axis_t), intent(in) :: axes(:)
    type(axis_t), allocatable :: varied(:)
    logical :: of_law(size(axes))
    real(wp) :: combinations
    integer :: i
    combinations = 1
    do i = 1, size(axes)
      of_law(i) = .not. is_start(trim(axes(i)%name)) .and. axes(i)%name /= sample_axis
      if (of_law(i)) combinations = combinations*size(axes(i)%values)
    end do
    varied = pack(axes, of_law)
    if (combinations <= most_combinations) return
    do i = 1, size(varied)
      associate (values => varied(i)%values)
        if (size(values) > 2) varied(i)%values = [values(1), values(size(values))]
      end associate
    end do
  end function law_axes

  !> The static coefficient follows the kinetic one (set_parameter), so it has to be set after it.
  subroutine check_axis_order(source, axes)
    type(case_source_t), intent(inout) :: source
    type(axis_t), intent(in) :: axes(:)
    integer :: i
    logical :: static_seen
    static_seen = .false.
    do i = 1, size(axes)
      if (axes(i)%name == 'friction.static_coefficient') static_seen = .true.
      if (axes(i)%name == 'friction.kinetic_coefficient' .and. static_seen) then
        call report(source, 'axis['//to_text(i)//'].name', 'found after the axis friction.static_coefficient, '// &
                    'allowed before it')
      end if
    end do
  end subroutine check_axis_order

  !> Tiles are counted by a default integer, and each is held in memory. Axes without a tile length
  !> are cut later, into pieces of moderate size.
  subroutine check_tiles(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    real(wp) :: tiles, points, length
    integer :: i
    tiles = 1
    points = 1
    do i = 1, size(the_case%axes)
      if (the_case%tile(i) == 0) cycle
      length = size(the_case%axes(i)%values)
      tiles = tiles*ceiling(length/the_case%tile(i))
      points = points*min(length, real(the_case%tile(i), wp))
    end do
    if (tiles > huge(1)) then
      call report(source, 'grid.tile', 'found '//to_text(tiles)//' tiles, allowed at most '//to_text(huge(1)))
    end if
    if (points > most_tile_points) then
      call report(source, 'grid.tile', 'found tiles of '//to_text(points)//' points, allowed at most '// &
                  to_text(most_tile_points))
    end if
  end subroutine check_tiles

  !> No start lies beyond a barrier of the case, its axes or, `of_sweep`, its sweep.
  subroutine check_starts(source, the_case, of_sweep)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    logical, intent(in) :: of_sweep
    character(len=:), allocatable :: problem
    integer :: i, j
    logical :: is_axis
    if (is_multibody(the_case%laws)) then
      if (is_good(source, ['spring  ', 'friction', 'drive   ', 'watch   '])) call check_bodies_at_start(source, the_case)
      return
    end if
    call check_drawn(source, the_case)
    is_axis = any(the_case%sample%names == 'x0')
    do i = 1, size(the_case%axes)
      if (the_case%axes(i)%name /= 'x0') cycle
      is_axis = .true.
      ! An axis may have many values: one of its ends is beyond if any value is.
      associate (values => the_case%axes(i)%values)
        do j = 1, 2
          problem = beyond(the_case, the_case%axes, merge(minval(values), maxval(values), j == 1))
          if (len(problem) == 0) cycle
          call report(source, 'axis['//to_text(i)//']', problem)
          exit
        end do
      end associate
    end do
    if (.not. is_axis) then
      problem = beyond(the_case, the_case%axes, the_case%start%x0)
      if (len(problem) > 0) call report(source, 'start.x0', problem)
    end if
    if (of_sweep) call check_sweep_starts(source, the_case, is_axis .or. len(problem) > 0)
  end subroutine check_starts

  !> No bodies overlap at the start, at all corners of the axes (gaps are linear in positions and stops).
  subroutine check_bodies_at_start(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    type(law_choice_t) :: laws(size(the_case%laws))
    type(axis_t), allocatable :: axes(:)
    class(machine_t), allocatable :: moving
    type(error_t), allocatable :: error
    character(len=:), allocatable :: at
    real(wp) :: start(3), value
    integer :: corner, i
    axes = with_ranges(the_case)
    do corner = 0, 2**min(size(axes), most_corner_axes) - 1
      laws = the_case%laws
      start = [the_case%start%x0, the_case%start%v0, the_case%start%crank_angle]
      at = ''
      do i = 1, size(axes)
        associate (values => axes(i)%values)
          value = values(merge(size(values), 1, btest(corner, i - 1)))
        end associate
        at = at//' '//trim(axes(i)%name)//' = '//to_text(value)
        select case (axes(i)%name)
        case ('x0')
          start(1) = value
        case ('v0')
          start(2) = value
        case ('crank_angle')
          start(3) = value
        case default
          call set_parameter(laws, trim(axes(i)%name), value, error)
        end select
      end do
      call machine_of(laws, options_t(), moving, error)
      if (allocated(error)) return
      if (moving%allows(start)) cycle
      if (len(at) > 0) at = ' (at'//at//')'
      call report(source, 'start.x0', 'found bodies beyond a stop of a [contact.NAME] at the start, allowed within all of '// &
                  'them'//at)
      return
    end do
  end subroutine check_bodies_at_start

  !> The axes, with the ranges of the starts that are drawn in place of the axis that counts them.
  pure function with_ranges(the_case) result(axes)
    type(case_t), intent(in) :: the_case
    type(axis_t), allocatable :: axes(:)
    type(axis_t) :: range
    integer :: i
    axes = pack(the_case%axes, the_case%axes%name /= sample_axis)
    if (size(axes) == size(the_case%axes)) return
    do i = 1, size(the_case%sample%names)
      range%name = the_case%sample%names(i)
      range%unit = trim(the_case%sample%units(i))
      range%values = [minval(the_case%sample%drawn(i, :)), maxval(the_case%sample%drawn(i, :))]
      axes = [axes, range]
    end do
  end function with_ranges

  !> No start that is drawn lies beyond a barrier.
  subroutine check_drawn(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable :: problem
    integer :: i, k
    do i = 1, size(the_case%sample%names)
      if (the_case%sample%names(i) /= 'x0' .or. .not. allocated(the_case%sample%drawn)) cycle
      do k = 1, 2
        associate (values => the_case%sample%drawn(i, :))
          problem = beyond(the_case, the_case%axes, merge(minval(values), maxval(values), k == 1))
        end associate
        if (len(problem) > 0) call report(source, 'sample['//to_text(i)//']', problem)
      end do
    end do
  end subroutine check_drawn

  !> The same for the starts of the sweep; `skip_start`: do not look at start.x0.
  subroutine check_sweep_starts(source, the_case, skip_start)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    logical, intent(in) :: skip_start
    character(len=:), allocatable :: problem
    integer :: i
    problem = beyond(the_case, [the_case%sweep%swept], the_case%start%x0)
    if (len(problem) > 0 .and. .not. skip_start) call report(source, 'start.x0', problem)
    if (all(the_case%sweep%starts == 0)) return
    do i = 1, 2
      problem = beyond(the_case, [the_case%axes, the_case%sweep%swept], the_case%sweep%x0(i))
      if (len(problem) > 0) call report(source, 'sweep.x0', problem)
    end do
  end subroutine check_sweep_starts

  !> How a position violates the tightest rigid barriers of the case with these axes; '' if it does not.
  pure function beyond(the_case, axes, x) result(problem)
    type(case_t), intent(in) :: the_case
    type(axis_t), intent(in) :: axes(:)
    real(wp), intent(in) :: x
    character(len=:), allocatable :: problem, upper_key, lower_key
    character(len=*), parameter :: second_key = 'effect.second_barrier.position'
    character(len=*), parameter :: driver_key = 'body.driver_x0'
    character(len=:), allocatable :: from_driver, unit
    real(wp) :: upper, lower, second, driver(2)
    integer :: i
    problem = ''
    if (barriers_are_soft(the_case%laws)) return
    ! Stops on a driving body: its least and its largest position.
    driver = 0
    from_driver = ''
    if (the_case%laws(1)%name == 'backlash_pair') then
      driver = parameter_value(the_case%laws, driver_key, 0.0_wp)
      do i = 1, size(axes)
        if (axes(i)%name == driver_key) driver = [minval(axes(i)%values), maxval(axes(i)%values)]
      end do
      if (any(abs(driver) > 0)) from_driver = ', measured from '//driver_key
    end if
    upper = parameter_value(the_case%laws, 'contact.upper', huge(1.0_wp))
    lower = parameter_value(the_case%laws, 'contact.lower', -huge(1.0_wp))
    upper_key = 'contact.upper'
    lower_key = 'contact.lower'
    second = parameter_value(the_case%laws, second_key, huge(1.0_wp))
    do i = 1, size(axes)
      if (axes(i)%name == 'contact.upper') upper = minval(axes(i)%values)
      if (axes(i)%name == 'contact.lower') lower = maxval(axes(i)%values)
      if (axes(i)%name == second_key) second = merge(maxval(axes(i)%values), minval(axes(i)%values), upper < huge(upper))
    end do
    if (second < huge(second) .and. upper < huge(upper)) then
      lower = second
      lower_key = second_key
    else if (second < huge(second)) then
      upper = second
      upper_key = second_key
    end if
    unit = ' '//unit_of('m', position_is_angle(the_case%laws))
    if (x - driver(1) > upper) problem = 'found x0 = '//to_text(x)//unit//', allowed at most the barrier '//upper_key//' = '// &
                                         to_text(upper)//unit//from_driver
    if (x - driver(2) < lower) problem = 'found x0 = '//to_text(x)//unit//', allowed at least the barrier '//lower_key//' = '// &
                                         to_text(lower)//unit//from_driver
  end function beyond

  !> A basin needs two axes or more. Code 65.
  subroutine require_axes(the_case, error)
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    if (size(the_case%axes) < 2 .and. .not. any(the_case%axes%name == sample_axis)) then
      call fail(error, exit_bad_case, the_case%path//': a basin needs two or more tables [[axis]], or [[sample]], found '// &
                to_text(size(the_case%axes)))
    end if
  end subroutine require_axes

  !> A sweep needs its table and a start that the barriers allow, swept ones too. Code 65.
  subroutine require_sweep(the_case, error)
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    if (.not. the_case%sweep%present) then
      call fail(error, exit_bad_case, the_case%path//': a sweep needs a table [sweep]')
    else if (has_ramp(the_case%laws)) then
      call fail(error, exit_bad_case, the_case%path//': key ''motor.ramp_time'': found with a sweep, allowed with trajectory '// &
                'and basin: a sweep changes its parameter itself')
    else
      call allow_start(the_case, [the_case%sweep%swept], error)
    end if
  end subroutine require_sweep

  !> What runs from [start] needs an x0 that the barriers allow; load_case does not look at it when
  !> x0 is an axis. Code 65.
  subroutine require_start(the_case, error)
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    call allow_start(the_case, the_case%axes, error)
  end subroutine require_start

  subroutine allow_start(the_case, axes, error)
    type(case_t), intent(in) :: the_case
    type(axis_t), intent(in) :: axes(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    problem = beyond(the_case, axes, the_case%start%x0)
    if (len(problem) > 0) call fail(error, exit_bad_case, the_case%start%origin//': key ''start.x0'': '//problem)
  end subroutine allow_start

end module case_check
