! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What must hold between the values of a case, here and for every combination of its axes.
module case_check
  use axis, only: axis_t
  use build_jointed, only: is_jointed, jointed_of
  use build_motion, only: machine_of
  use case_parameters, only: is_start, parameter_value, set_parameter
  use case_source, only: case_source_t, report
  use case_type, only: case_t, contact_law, drive_law, friction_law, restoring_law
  use effect_check, only: refuse_effects
  use errors, only: error_t, fail
  use jointed, only: jointed_t
  use jointed_section, only: start_of_jointed
  use jointed_state, only: jointed_state_t
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, value_of
  use lever_reach, only: check_assembly
  use motion, only: motion_t
  use motion_state, only: options_t
  use oscillator, only: refuse_pair
  use pair, only: build_pair, is_pair, pair_t
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

  !> Notes every violated condition of a case whose single values are good.
  subroutine check_case(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    integer :: before
    associate (run => the_case%run)
      if (run%window > run%duration) then
        call report(source, 'run.window', 'found '//to_text(run%window)//' s, allowed at most the duration '// &
                    to_text(run%duration)//' s')
      end if
    end associate
    associate (refine => the_case%refine)
      if (modulo(refine%block, refine%step) /= 0) then
        call report(source, 'refine.block', 'found '//to_text(refine%block)//', allowed a multiple of the step '// &
                    to_text(refine%step))
      end if
    end associate
    before = size(source%problems)
    call check_laws(source, the_case%laws, '')
    if (size(source%problems) > before) return
    call check_combinations(source, the_case, the_case%axes)
    if (the_case%sweep%present) call check_combinations(source, the_case, [the_case%sweep%swept])
    call check_axis_order(source, the_case%axes)
    call check_tiles(source, the_case)
    call check_starts(source, the_case)
  end subroutine check_case

  !> The conditions within one choice of laws; `at` names the combination of axis values.
  subroutine check_laws(source, laws, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: at
    real(wp) :: static, kinetic, tension
    kinetic = parameter_value(laws, 'friction.kinetic_coefficient', 0.0_wp)
    static = parameter_value(laws, 'friction.static_coefficient', kinetic)
    if (static < kinetic) then
      call report(source, 'friction.static_coefficient', 'found '//to_text(static)// &
                  ', allowed at least the kinetic_coefficient '//to_text(kinetic)//at)
    end if
    if (laws(contact_law)%name /= 'none') call check_barriers(source, laws(contact_law), at)
    tension = parameter_value(laws, 'contact.tension', 1.0_wp)
    if (tension > 0 .and. tension < 1) call report(source, 'contact.tension', 'found '//to_text(tension)//', allowed 0 or 1'//at)
    call check_bodies(source, laws, at)
    if (needs_spring(laws(drive_law)%name) .and. laws(restoring_law)%name /= 'linear') then
      call report(source, 'drive.ratio', 'found with restoring.law = "'//trim(laws(restoring_law)%name)// &
                  '", allowed with "linear": the ratio refers to its natural frequency')
    end if
    select case (laws(drive_law)%name)
    case ('fourier')
      call check_series(source, laws(drive_law))
    case ('crank_lever_rod')
      call check_lever(source, laws(drive_law), at)
    case ('measured_force')
      if (size(list_of(laws(drive_law), 'force')) < 2) then
        call report(source, 'drive.force', 'found '//to_text(size(list_of(laws(drive_law), 'force')))// &
                    ' samples, allowed two or more')
      end if
    end select
  end subroutine check_laws

  pure logical function needs_spring(drive)
    character(len=*), intent(in) :: drive
    needs_spring = drive == 'harmonic' .or. drive == 'fourier' .or. drive == 'crank_lever_rod'
  end function needs_spring

  !> One body and two have laws of their own, and effects laws that they belong to.
  subroutine check_bodies(source, laws, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: at
    type(pair_t) :: pair
    type(jointed_t) :: jointed
    type(error_t), allocatable :: error
    if (is_jointed(laws)) then
      call jointed_of(laws, jointed, error)
    else if (is_pair(laws)) then
      call build_pair(laws, pair, error)
    else
      call refuse_pair(laws, error)
      if (.not. allocated(error)) call refuse_effects(laws, error)
    end if
    if (.not. allocated(error)) return
    call report(source, error%message(:index(error%message, ':') - 1), error%message(index(error%message, ':') + 2:)//at)
  end subroutine check_bodies

  subroutine check_barriers(source, contact, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: contact
    character(len=*), intent(in) :: at
    real(wp) :: upper, lower
    upper = value_of(contact, 'upper')
    lower = value_of(contact, 'lower')
    if (upper >= huge(upper) .and. lower <= -huge(lower)) then
      call report(source, 'contact.law', 'found "'//trim(contact%name)//'" without a barrier, allowed with upper, lower or both')
    else if (lower > upper) then
      call report(source, 'contact.lower', 'found '//to_text(lower)//' m, allowed at most upper = '// &
                  to_text(upper)//' m'//at)
    end if
  end subroutine check_barriers

  subroutine check_series(source, drive)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: drive
    integer :: cosines, sines
    cosines = size(list_of(drive, 'cosine'))
    sines = size(list_of(drive, 'sine'))
    if (sines /= cosines) then
      call report(source, 'drive.sine', 'found '//to_text(sines)//' numbers, allowed as many as cosine has: '// &
                  to_text(cosines))
    end if
  end subroutine check_series

  subroutine check_lever(source, drive, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: drive
    character(len=*), intent(in) :: at
    character(len=:), allocatable :: problem
    real(wp) :: side
    side = value_of(drive, 'side')
    if (abs(side) /= 1) call report(source, 'drive.side', 'found '//to_text(side)//', allowed +1 or -1'//at)
    if (value_of(drive, 'crank') >= value_of(drive, 'pivot_distance')) then
      call report(source, 'drive.crank', 'found '//to_text(value_of(drive, 'crank'))// &
                  ' m, allowed less than pivot_distance = '//to_text(value_of(drive, 'pivot_distance'))//' m'//at)
    else
      problem = check_assembly(drive)
      if (len(problem) > 0) call report(source, 'drive.rod', problem//at)
    end if
  end subroutine check_lever

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
      of_law(i) = .not. is_start(trim(axes(i)%name))
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

  !> No start lies beyond a barrier of the case, its axes or its sweep.
  subroutine check_starts(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable :: problem
    integer :: i, j
    logical :: is_axis
    if (is_jointed(the_case%laws)) then
      call check_bodies_at_start(source, the_case)
      return
    end if
    is_axis = .false.
    do i = 1, size(the_case%axes)
      if (the_case%axes(i)%name /= 'x0') cycle
      is_axis = .true.
      do j = 1, size(the_case%axes(i)%values)
        problem = beyond(the_case, the_case%axes, the_case%axes(i)%values(j))
        if (len(problem) == 0) cycle
        call report(source, 'axis['//to_text(i)//']', problem)
        exit
      end do
    end do
    if (.not. is_axis) then
      problem = beyond(the_case, the_case%axes, the_case%start%x0)
      if (len(problem) > 0) call report(source, 'start.x0', problem)
    end if
    if (the_case%sweep%present) call check_sweep_starts(source, the_case, is_axis .or. len(problem) > 0)
  end subroutine check_starts

  !> No bodies overlap at the start, at all corners of the axes (gaps are linear in positions and stops).
  subroutine check_bodies_at_start(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    type(law_choice_t) :: laws(size(the_case%laws))
    type(motion_t) :: moving
    type(jointed_state_t) :: state
    type(error_t), allocatable :: error
    character(len=:), allocatable :: at
    real(wp) :: start(3), value
    integer :: corner, i
    do corner = 0, 2**min(size(the_case%axes), most_corner_axes) - 1
      laws = the_case%laws
      start = [the_case%start%x0, the_case%start%v0, the_case%start%crank_angle]
      at = ''
      do i = 1, size(the_case%axes)
        associate (values => the_case%axes(i)%values)
          value = values(merge(size(values), 1, btest(corner, i - 1)))
        end associate
        at = at//' '//trim(the_case%axes(i)%name)//' = '//to_text(value)
        select case (the_case%axes(i)%name)
        case ('x0')
          start(1) = value
        case ('v0')
          start(2) = value
        case ('crank_angle')
          start(3) = value
        case default
          call set_parameter(laws, trim(the_case%axes(i)%name), value, error)
        end select
      end do
      call machine_of(laws, options_t(), moving, error)
      if (allocated(error)) return
      state = start_of_jointed(moving%jointed, start(1), start(2), start(3))
      if (.not. any(state%q /= state%q)) cycle
      if (len(at) > 0) at = ' (at'//at//')'
      call report(source, 'start.x0', 'found bodies beyond a stop of a [contact.NAME] at the start, allowed within all of '// &
                  'them'//at)
      return
    end do
  end subroutine check_bodies_at_start

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

  !> How a position violates the tightest barriers of the case with these axes; '' if it does not.
  pure function beyond(the_case, axes, x) result(problem)
    type(case_t), intent(in) :: the_case
    type(axis_t), intent(in) :: axes(:)
    real(wp), intent(in) :: x
    character(len=:), allocatable :: problem, upper_key, lower_key
    character(len=*), parameter :: second_key = 'effect.second_barrier.position'
    real(wp) :: upper, lower, second, driver
    integer :: i
    driver = 0
    if (the_case%laws(1)%name == 'backlash_pair') driver = parameter_value(the_case%laws, 'body.driver_x0', 0.0_wp)
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
    problem = ''
    if (x - driver > upper) problem = 'found x0 = '//to_text(x)//' m, allowed at most the barrier '//upper_key//' = '// &
                                      to_text(upper)//' m'
    if (x - driver < lower) problem = 'found x0 = '//to_text(x)//' m, allowed at least the barrier '//lower_key//' = '// &
                                      to_text(lower)//' m'
  end function beyond

  !> A basin needs two axes or more. Code 65.
  subroutine require_axes(the_case, error)
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    if (size(the_case%axes) < 2) then
      call fail(error, exit_bad_case, the_case%path//': a basin needs two or more tables [[axis]], found '// &
                to_text(size(the_case%axes)))
    end if
  end subroutine require_axes

  !> A sweep needs its table and a start that the barriers allow, swept ones too. Code 65.
  subroutine require_sweep(the_case, error)
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    if (.not. the_case%sweep%present) then
      call fail(error, exit_bad_case, the_case%path//': a sweep needs a table [sweep]')
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
    if (len(problem) > 0) call fail(error, exit_bad_case, the_case%path//': key ''start.x0'': '//problem)
  end subroutine allow_start

end module case_check
