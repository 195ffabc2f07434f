! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What `separatrix branches` searches: the range of the parameter, and the starts.
module branches_setup
  use search_state, only: search_t
  use case_parameters, only: canonical_name, is_start, parameter_bounds, parameter_names
  use case_setup, only: options_of
  use case_type, only: case_t
  use case_values, only: allowed_range, bounds_t
  use command_line, only: command_t
  use constants, only: two_pi
  use errors, only: error_t, fail
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use machine_family, only: machine_of_family
  use status, only: exit_bad_case
  use text, only: parse_number, to_text
  use units, only: allowed_units, read_quantity
  implicit none
  private

  public :: read_end, set_range, set_starts

  !> Starts at each value at which orbits are searched, and those nearer to rest; over which share of the range these are.
  integer, parameter :: starts = 48, near_starts = 16
  real(wp), parameter :: nearer = 0.25_wp
  !> Powers of 1/p for the root p of p^3 = p + 1 (Roberts 2018).
  real(wp), parameter :: irrational(2) = [0.7548776662466927_wp, 0.5698402909980532_wp]

contains

  !> The parameter and its range: as asked, else those of the sweep or the axis of this parameter. Code 65 for what the machine
  !> does not have.
  subroutine set_range(command, the_case, search, bounds, error)
    type(command_t), intent(in) :: command
    type(case_t), intent(in) :: the_case
    type(search_t), intent(inout) :: search
    type(bounds_t), intent(out) :: bounds
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: name, problem
    real(wp) :: range(2)
    logical :: found, given(2)
    integer :: i
    name = canonical_name(command%parameter)
    call parameter_bounds(the_case%laws, name, bounds, found)
    if (.not. found .or. is_start(name)) then
      call fail(error, exit_bad_case, "--parameter: found '"//name//"', allowed "//parameter_names(the_case%laws))
      return
    end if
    given = .false.
    range = 0
    if (the_case%sweep%present) then
      if (the_case%sweep%swept%name == name) call take(the_case%sweep%swept%values)
    end if
    do i = 1, size(the_case%axes)
      if (the_case%axes(i)%name == name) call take(the_case%axes(i)%values)
    end do
    call read_end('--from', command%from, bounds, range(1), given(1), error)
    if (.not. allocated(error)) call read_end('--to', command%to, bounds, range(2), given(2), error)
    if (allocated(error)) return
    if (.not. all(given)) then
      call fail(error, exit_bad_case, '--from and --to are needed: the case has no sweep or axis of '//name)
      return
    end if
    do i = 1, 2
      problem = allowed_range(range(i), bounds)
      if (len(problem) == 0) cycle
      call fail(error, exit_bad_case, trim(merge('--from', '--to  ', i == 1))//': '//problem)
      return
    end do
    if (.not. range(1) < range(2)) then
      call fail(error, exit_bad_case, '--from, --to: found '//to_text(range(1))//' and '//to_text(range(2))// &
                ', allowed a range that rises')
      return
    end if
    search%plan%lowest = range(1)
    search%plan%highest = range(2)
    search%family%laws = the_case%laws
    search%family%path = name
    search%family%options = options_of(the_case)
    search%family%lowest = merge(bounds%lower + merge(tiny(1.0_wp), 0.0_wp, bounds%lower_open), -huge(1.0_wp), &
                                 bounds%lower > -huge(1.0_wp))
    search%family%highest = bounds%upper

  contains

    subroutine take(values)
      real(wp), intent(in) :: values(:)
      range = [minval(values), maxval(values)]
      given = .true.
    end subroutine take

  end subroutine set_range

  !> An end of the range of a parameter: a number in its SI unit, or a text with a unit. Nothing is changed where `text` is ''.
  subroutine read_end(option, text, bounds, value, given, error)
    character(len=*), intent(in) :: option, text
    type(bounds_t), intent(in) :: bounds
    real(wp), intent(inout) :: value
    logical, intent(inout) :: given
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    integer :: status
    if (len_trim(text) == 0) return
    given = .true.
    call parse_number(trim(adjustl(text)), value, status)
    if (status == 0) return
    call read_quantity(text, trim(bounds%unit), value, problem)
    if (allocated(problem)) call fail(error, exit_bad_case, option//": found '"//trim(text)//"', allowed "// &
                                      allowed_units(trim(bounds%unit)))
  end subroutine read_end

  !> Starts over the ranges that the case has for x0 and v0, else over twice the size of the motion that the drive brings about;
  !> where it has none for either some within a quarter of that, too, and its own start, taken on to the section where that is at
  !> another crank angle: basins may be small.
  subroutine set_starts(the_case, search, error)
    type(case_t), intent(in) :: the_case
    type(search_t), intent(inout) :: search
    type(error_t), allocatable, intent(out) :: error
    class(hybrid_t), allocatable :: machine
    type(event_t), allocatable :: events(:)
    real(wp) :: low(2), high(2), watched(2, starts + near_starts + 1), spread(starts + near_starts + 1)
    real(wp), allocatable :: own(:)
    integer :: i, k, last
    logical :: ok
    character(len=2), parameter :: names(2) = ['x0', 'v0']
    last = size(watched, 2)
    high = 2*search%family%sizes
    low = -high
    do k = 1, 2
      do i = 1, size(the_case%axes)
        if (the_case%axes(i)%name /= names(k)) cycle
        low(k) = minval(the_case%axes(i)%values)
        high(k) = maxval(the_case%axes(i)%values)
        last = starts
      end do
    end do
    call machine_of_family(search%family, (search%plan%lowest + search%plan%highest)/2, machine, error)
    if (allocated(error)) return
    spread = 1
    spread(starts + 1:) = nearer
    do i = 1, starts + near_starts
      watched(:, i) = spread(i)*(low + (high - low)*modulo(0.5_wp + i*irrational, 1.0_wp))
    end do
    watched(:, starts + near_starts + 1) = [the_case%start%x0, the_case%start%v0]
    search%starts = machine%starts_of_section(watched(:, :last), spread(:last))
    if (last == starts) return
    ! By itself, so that the other coordinates are those of the machine.
    search%starts(:, last:) = machine%starts_of_section(watched(:, last:))
    if (.not. (machine%has_clock .and. modulo(the_case%start%crank_angle, two_pi) > 0)) return
    allocate (own(machine%n))
    call machine%fly_to_section([the_case%start%x0, the_case%start%v0, the_case%start%crank_angle], own, events, ok)
    if (ok) search%starts(:, last) = own
  end subroutine set_starts

end module branches_setup
