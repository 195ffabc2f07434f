! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix stability MAP`: what the entries of a map's catalogue are that have no period.
module stability_of_map
  use body_family, only: family_t
  use case_type, only: case_t
  use command_line, only: command_t
  use ending_text, only: why_json, why_not_known
  use endings, only: assess_given_up
  use errors, only: error_t, fail
  use exponents, only: most_points, motion_chaotic, motion_contracting, motion_neutral, motion_not_known, &
    motion_transient, period_of_section, spectrum_t, type_of_motion, zero_one_test
  use grid, only: grid_t, point_laws, point_start
  use journal, only: journal_t, json_number, json_text
  use kinds, only: int64, wp
  use launched_team, only: start_launched_team
  use machine_family, only: machine_neighbourhood
  use map_entries, only: entry_t, read_entries
  use more_periods, only: periods_needed, test_is_open
  use status, only: exit_usage, is_given_up
  use structure_exponents, only: exponents_of_machine
  use team, only: team_t
  use text, only: replace_all, to_text
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: needed_text, run_stability_of_map, seen_text

  !> Points on the section are the same within this share of their range.
  real(wp), parameter :: same = 1e-7_wp
  !> Logarithm of the contraction over a period from which on points that are the same identify a cycle.
  real(wp), parameter :: contracts = 1e-2_wp

  integer, parameter :: not_known = 0, chaotic = 1, quasi_periodic = 2, long_transient = 3, above_limit = 4
  character(len=*), parameter :: type_names(0:4) = [character(len=22) :: 'not_known', 'chaotic', 'quasi_periodic', &
    'long_transient', 'period_above_the_limit']

  !> What was found of an entry.
  type :: finding_t
    type(spectrum_t) :: spectrum
    real(wp) :: zero_one = 0
    integer :: type = not_known, period = 0
    logical :: has_clock = .true.
  end type finding_t

contains

  !> Reports the type of every entry of period 0 with its exponents; the ranks share the entries. Code 65 for a file that is no map
  !> of attractors.
  subroutine run_stability_of_map(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    class(team_t), allocatable :: team
    type(journal_t) :: journal
    type(case_t) :: the_case
    type(grid_t) :: grid
    type(entry_t), allocatable :: entries(:)
    integer :: total
    if (size(command%overrides) > 0) call fail(error, exit_usage, '--set belongs to a case: stability takes that of its map')
    if (len(command%draw) > 0) call fail(error, exit_usage, '--draw belongs to a case: stability MAP draws none')
    if (allocated(error)) return
    call start_launched_team(team)
    call journal%open(team%is_root(), command%json, command%quiet)
    call journal%open_copy(command%log, error)
    call team%agree(error)
    if (.not. allocated(error)) call read_entries(command%path, team, the_case, grid, entries, total, error)
    if (.not. allocated(error)) then
      call journal%line('entries', to_text(size(entries))//' of '//to_text(total)//' entries of the catalogue have no known '// &
                        'period', '"without_period": '//to_text(size(entries))//', "attractors": '//to_text(total))
      if (.not. (command%validate .or. command%dry_run)) call report_entries(team, journal, grid, the_case, entries, command, error)
    end if
    call team%close()
  end subroutine run_stability_of_map

  !> Entries in turn, one for each rank at a time; the lines come in the order of the entries.
  subroutine report_entries(team, journal, grid, the_case, entries, command, error)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(case_t), intent(in) :: the_case
    type(entry_t), intent(in) :: entries(:)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: words, data, others_words, others_data
    integer(int64) :: given_up(1)
    integer :: first, mine, rank
    given_up = 0
    do first = 1, size(entries), team%size()
      words = ''
      data = ''
      mine = first + team%rank()
      if (mine <= size(entries)) call describe(grid, the_case, entries(mine), command%periods, words, data, given_up(1))
      do rank = 0, min(team%size(), size(entries) - first + 1) - 1
        others_words = words
        others_data = data
        call team%broadcast_text(others_words, rank)
        call team%broadcast_text(others_data, rank)
        call journal%line('entry', others_words, others_data)
      end do
    end do
    call team%sum(given_up)
    call assess_given_up(journal, given_up(1), size(entries, kind=int64), 'entries', command%partial, error)
  end subroutine report_entries

  !> Computes what an entry is, as `words` and as `data` of JSON; counts those whose motion was given up.
  subroutine describe(grid, the_case, entry, periods, words, data, given_up)
    type(grid_t), intent(in) :: grid
    type(case_t), intent(in) :: the_case
    type(entry_t), intent(in) :: entry
    integer, intent(in) :: periods
    character(len=:), allocatable, intent(out) :: words, data
    integer(int64), intent(inout) :: given_up
    type(finding_t) :: found
    type(error_t), allocatable :: error
    character(len=:), allocatable :: name
    name = 'attractor '//to_text(entry%label)
    if (grid%slices > 1) name = name//' of slice '//to_text(entry%slice)
    data = '"attractor": '//to_text(entry%label)//', "slice": '//to_text(entry%slice)
    if (.not. allocated(entry%index)) then
      words = name//': not known: no point of the map was captured by it'
      data = data//', "type": "not_known"'
      return
    end if
    call examine(grid, entry%index, periods, the_case%attractors%max_period, found, error)
    if (allocated(error)) then
      words = name//': not known: '//error%message
      data = data//', "type": "not_known"'
      return
    end if
    if (is_given_up(found%spectrum%reason)) given_up = given_up + 1
    words = name//': '//replace_all(trim(type_names(found%type)), '_', merge('-', ' ', found%type == quasi_periodic))
    data = data//', "type": '//json_text(trim(type_names(found%type)))
    if (found%period > 0) then
      words = words//', settles on period '//to_text(found%period)
      data = data//', "period": '//to_text(found%period)
    end if
    if (.not. found%spectrum%known) then
      words = words//': '//why_not_known(found%spectrum, the_case%laws)
      data = data//why_json(found%spectrum)
    else
      call add_numbers(found, words, data)
      if (found%type == not_known) then
        words = words//needed_text(found%spectrum, found%zero_one)
        data = data//', "periods_needed": '//to_text(periods_needed(found%spectrum, found%zero_one))
      end if
    end if
  end subroutine describe

  !> What was seen of a motion: how long it was followed, or the cycle whose multipliers give its exponents.
  pure function seen_text(spectrum, has_clock) result(text)
    type(spectrum_t), intent(in) :: spectrum
    logical, intent(in) :: has_clock
    character(len=:), allocatable :: text
    text = to_text(spectrum%periods)//trim(merge(' drive period', ' return      ', has_clock))
    if (spectrum%periods /= 1) text = text//'s'
    text = trim(merge('on a cycle of', 'by           ', spectrum%by_multipliers))//' '//text//' with '// &
           to_text(spectrum%impacts)//' impact'
    if (spectrum%impacts /= 1) text = text//'s'
  end function seen_text

  !> What more periods would do for a motion that is not known, by the 0-1 test `k`; '' if that is not known either.
  pure function needed_text(spectrum, k) result(text)
    type(spectrum_t), intent(in) :: spectrum
    real(wp), intent(in) :: k
    character(len=:), allocatable :: text
    integer :: periods
    text = ''
    periods = periods_needed(spectrum, k)
    if (periods > 0) text = '; its errors need about '//to_text(periods)//' periods (--periods '//to_text(periods)//')'
    if (test_is_open(spectrum, k) .and. spectrum%periods < most_points) text = '; the 0-1 test decides here, and takes up '// &
      'to '//to_text(most_points)//' periods into account (--periods '//to_text(most_points)//')'
  end function needed_text

  !> Exponents with standard errors, their sum, the 0-1 test and what they are from.
  subroutine add_numbers(found, words, data)
    type(finding_t), intent(in) :: found
    character(len=:), allocatable, intent(inout) :: words, data
    character(len=:), allocatable :: values, errors
    integer :: i
    words = words//'; exponents'
    values = ''
    errors = ''
    do i = 1, size(found%spectrum%exponents)
      associate (value => found%spectrum%exponents(i), error => found%spectrum%errors(i))
        if (i > 1) then
          words = words//trim(merge(' and', ',   ', i == size(found%spectrum%exponents)))
          values = values//', '
          errors = errors//', '
        end if
        if (value < -huge(1.0_wp)/2) then
          words = words//' -inf'
          values = values//'null'
          errors = errors//'null'
        else
          words = words//' '//to_text(value, 6)
          if (.not. found%spectrum%by_multipliers) words = words//' +- '//to_text(error, 2)
          values = values//json_number(value)
          errors = errors//json_number(error)
        end if
      end associate
    end do
    words = words//' 1/s'
    data = data//', "exponents": ['//values//'], "errors": ['//errors//']'
    if (found%spectrum%has_sum) then
      words = words//', sum '//to_text(found%spectrum%sum_found, 10)//' (exact '//to_text(found%spectrum%sum_exact, 10)//')'
      data = data//', "sum": '//json_number(found%spectrum%sum_found)//', "exact_sum": '//json_number(found%spectrum%sum_exact)
    end if
    words = words//'; 0-1 test '//to_text(found%zero_one, 3)//'; '// &
            seen_text(found%spectrum, found%has_clock)
    data = data//', "zero_one": '//json_number(found%zero_one)//', "periods": '//to_text(found%spectrum%periods)// &
           ', "impacts": '//to_text(found%spectrum%impacts)
  end subroutine add_numbers

  !> Exponents and 0-1 test of the motion from a point of the grid, over `periods` after a quarter as many, and its type. A
  !> period up to `limit` would have been found by the map if the motion had settled. Code 65 where variations are not known.
  subroutine examine(grid, index, periods, limit, found, error)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: index(:), periods, limit
    type(finding_t), intent(out) :: found
    type(error_t), allocatable, intent(out) :: error
    type(family_t) :: family
    type(neighbourhood_t) :: machines
    real(wp) :: section(min(most_points, periods)), start(3 + size(grid%others))
    family%laws = point_laws(grid, index)
    family%options = grid%options
    call machine_neighbourhood(family, 0.0_wp, machines, error)
    if (allocated(error)) return
    found%has_clock = machines%centre%has_clock
    start = point_start(grid, index)
    call exponents_of_machine(machines, start, periods/4, periods, found%spectrum, section)
    if (.not. found%spectrum%known) return
    found%zero_one = zero_one_test(section)
    select case (type_of_motion(found%spectrum, found%zero_one))
    case (motion_chaotic)
      found%type = chaotic
    case (motion_neutral)
      found%type = quasi_periodic
    case (motion_transient)
      found%type = long_transient
    case (motion_contracting, motion_not_known)
      found%type = not_known
    end select
    if (found%type == chaotic .or. found%type == quasi_periodic) return
    ! A cycle contracts, and comes back to the same points.
    found%period = found%spectrum%cycle
    if (found%period == 0 .and. found%spectrum%exponents(1) < 0) then
      ! What comes back so near by slowness alone may be of any period.
      found%period = period_of_section(section, same)
      if (found%spectrum%exponents(1)*found%period*found%spectrum%mean_period > -contracts) found%period = 0
    end if
    if (found%period > 0) found%type = merge(above_limit, long_transient, found%period > limit)
  end subroutine examine

end module stability_of_map
