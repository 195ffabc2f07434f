! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The command line: what was asked.
module command_line
  use command_table, only: belonging_to, commands, devices, option_number, options
  use errors, only: error_t, fail
  use kinds, only: wp
  use status, only: exit_usage
  use text, only: join, parse_integer, parse_number, starts_with, to_text
  implicit none
  private

  public :: read_command_line

  integer, parameter :: longest_argument = 4096
  !> Each costs seconds.
  integer, parameter :: most_searches = 10000

  type, public :: command_t
    character(len=:), allocatable :: name
    !> The case, the file of `info` and `verify`, or the output of `merge`.
    character(len=:), allocatable :: path
    !> The files that `merge` reads.
    character(len=longest_argument), allocatable :: shards(:)
    !> Which share of the tiles to compute, and of how many; 0 = all.
    integer :: shard = 0, shard_count = 0
    character(len=:), allocatable :: output, list, csv, record, log, tile_times
    !> Where the sketch of the machine goes.
    character(len=:), allocatable :: draw
    !> The share of a map from which to take the attractors.
    character(len=:), allocatable :: catalogue
    !> `--set` arguments.
    character(len=longest_argument), allocatable :: overrides(:)
    logical :: help = .false., partial = .false., version = .false., validate = .false., dry_run = .false.
    logical :: force = .false., resume = .false., json = .false., quiet = .false., search_only = .false.
    real(wp) :: time_limit = 0
    !> Seconds between lines of progress; 0 = as the journal thinks fit.
    real(wp) :: progress = 0
    integer :: ranks_per_node = 0
    character(len=4) :: device = 'auto'
    !> `branches`: the parameter, its range, and at how many values orbits are searched.
    character(len=:), allocatable :: parameter
    !> The range as it was written, '' if it was not.
    character(len=32) :: from = '', to = ''
    integer :: searches = 12
    !> A second parameter, over which its labels are followed, and its range.
    character(len=:), allocatable :: free
    character(len=32) :: free_from = '', free_to = ''
    !> Homoclinic contacts are looked for.
    logical :: contacts = .false.
    !> `boundary`: invariant sets are grown within so many times the window of the map; 0 = none.
    real(wp) :: grow = 1
    !> `stability`: drive periods that are watched.
    integer :: periods = 20000
    !> `verify`: points rerun, and the seed that chooses them.
    integer :: sample = 200, seed = 1
    !> `verify`: share of the labels that may change, in per cent.
    real(wp) :: max_changes = 1
    !> Options that were given.
    logical :: given(size(options)) = .false.
  end type command_t

contains

  !> Reads the arguments; code 64 for what is not understood.
  subroutine read_command_line(command, error)
    type(command_t), intent(out) :: command
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: argument
    character(len=longest_argument) :: padded
    integer :: position
    command%name = ''
    command%path = ''
    command%output = ''
    command%list = ''
    command%parameter = ''
    command%free = ''
    command%csv = ''
    command%record = ''
    command%tile_times = ''
    command%log = ''
    command%catalogue = ''
    command%draw = ''
    allocate (command%overrides(0), command%shards(0))
    position = 0
    do while (position < command_argument_count())
      position = position + 1
      argument = argument_at(position)
      if (starts_with(argument, '-') .and. len(argument) > 1) then
        call read_option(argument, position, command, error)
      else if (len(command%name) == 0) then
        command%name = argument
        if (.not. any(commands == argument)) call fail(error, exit_usage, "unknown command '"//argument// &
          "'; the commands are "//join(commands, ', ')//'; see separatrix --help')
      else if (len(command%path) == 0) then
        command%path = argument
      else if (command%name == 'merge') then
        padded = argument
        command%shards = [character(len=longest_argument) :: command%shards, padded]
      else
        call fail(error, exit_usage, "unexpected argument '"//argument//"' after '"//command%path//"'")
      end if
      if (allocated(error)) return
    end do
    if (command%help .or. command%version) return
    if (any(commands == command%name)) call check_options(command, error)
    if (.not. allocated(error)) call check_command(command, error)
  end subroutine read_command_line

  subroutine check_command(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    if (len(command%name) == 0) then
      call fail(error, exit_usage, 'a command is missing; the commands are '//join(commands, ', ')// &
                ' (see separatrix --help)')
    else if (len(command%path) == 0 .and. command%name /= 'laws') then
      call fail(error, exit_usage, command%name//': the file is missing (see separatrix '//command%name//' --help)')
    else if (len(command%path) > 0 .and. command%name == 'laws') then
      call fail(error, exit_usage, "laws takes no file; found '"//command%path//"'")
    else if (command%name == 'merge' .and. size(command%shards) == 0) then
      call fail(error, exit_usage, 'merge: the shards are missing (see separatrix merge --help)')
    else if (command%shard > 0 .and. len(command%csv) > 0) then
      call fail(error, exit_usage, '--csv needs the whole list: give it to merge')
    else if (command%search_only .and. (command%name /= 'basin' .or. command%shard == 0)) then
      call fail(error, exit_usage, '--search-only belongs to basin --shard I/N')
    else if (command%search_only .and. len(command%catalogue) > 0) then
      call fail(error, exit_usage, '--search-only searches, --catalogue takes what was found: choose one')
    else if (command%name == 'points' .and. len(command%list) == 0) then
      call fail(error, exit_usage, 'points: --list ICS.csv is missing')
    else if (command%name == 'stability' .and. command%periods < 64) then
      call fail(error, exit_usage, '--periods: found '//to_text(command%periods)//', allowed a whole number from 64')
    else if (command%name == 'branches' .and. len(command%parameter) == 0) then
      call fail(error, exit_usage, 'branches: --parameter NAME is missing, e.g. --parameter drive.ratio')
    else if (len(command%free) == 0 .and. len_trim(command%free_from//command%free_to) > 0) then
      call fail(error, exit_usage, '--free-from and --free-to are the range of --free NAME, which is missing')
    else if (command%force .and. command%resume) then
      call fail(error, exit_usage, '--force starts anew and --resume goes on: choose one')
    else
      call check_outputs(command, error)
    end if
  end subroutine check_command

  !> Every option that was given belongs to the command.
  subroutine check_options(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: words
    integer :: k
    do k = 1, size(options)
      if (.not. command%given(k) .or. allocated(error)) cycle
      words = belonging_to(options(k), command%name)
      if (len(words) > 0) call fail(error, exit_usage, trim(options(k)%name)//' belongs to '//words)
    end do
  end subroutine check_options

  !> Nothing that is read may be replaced, and no output by another.
  subroutine check_outputs(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    if (len(command%output) > 0 .and. (command%output == command%path .or. command%output == command%list)) then
      call fail(error, exit_usage, "-o '"//command%output//"' would replace what is read")
    else if (len(command%log) > 0 .and. any([command%path == command%log, command%list == command%log, &
                                             command%output == command%log, command%csv == command%log, &
                                             command%record == command%log, command%tile_times == command%log])) then
      call fail(error, exit_usage, "--log '"//command%log//"' is the name of another file of the run")
    else if (len(command%draw) > 0 .and. any([command%path == command%draw, command%list == command%draw, &
                                              command%log == command%draw])) then
      call fail(error, exit_usage, "--draw '"//command%draw//"' is the name of another file of the run")
    else if (len(command%csv) > 0 .and. (command%csv == command%path .or. command%csv == command%list)) then
      call fail(error, exit_usage, "--csv '"//command%csv//"' would replace what is read")
    else if (len(command%csv) > 0 .and. command%csv == command%output) then
      call fail(error, exit_usage, "--csv '"//command%csv//"' is the file of -o")
    else if (len(command%record) > 0 .and. (command%record == command%path .or. command%record == command%output .or. &
                                            command%record == command%csv)) then
      call fail(error, exit_usage, "--record '"//command%record//"' would replace another file of the command")
    else if (len(command%tile_times) > 0 .and. any([command%path == command%tile_times, command%list == command%tile_times, &
                                                    command%output == command%tile_times, command%csv == command%tile_times])) then
      call fail(error, exit_usage, "--tile-times '"//command%tile_times//"' is another file of the run")
    end if
  end subroutine check_outputs

  !> One option, with its value taken from the next argument or after '='.
  subroutine read_option(argument, position, command, error)
    character(len=*), intent(in) :: argument
    integer, intent(inout) :: position
    type(command_t), intent(inout) :: command
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: name, value
    integer :: equals, number
    name = argument
    equals = index(argument, '=')
    if (starts_with(argument, '--') .and. equals > 0) name = argument(:equals - 1)
    number = option_number(name)
    if (number == 0) then
      call fail(error, exit_usage, "unknown option '"//argument//"' (see separatrix --help)")
      return
    end if
    command%given(number) = .true.
    if (.not. options(number)%takes_value) then
      if (len(name) < len(argument)) then
        call fail(error, exit_usage, name//' takes no value')
      else
        call switch_on(trim(options(number)%name), command)
      end if
      return
    end if
    if (len(name) < len(argument)) then
      value = argument(equals + 1:)
    else if (position < command_argument_count()) then
      position = position + 1
      value = argument_at(position)
    else
      call fail(error, exit_usage, name//' needs a value')
      return
    end if
    call take_value(trim(options(number)%name), value, command, error)
  end subroutine read_option

  !> An option without a value.
  pure subroutine switch_on(name, command)
    character(len=*), intent(in) :: name
    type(command_t), intent(inout) :: command
    select case (name)
    case ('--help')
      command%help = .true.
    case ('--version')
      command%version = .true.
    case ('--validate')
      command%validate = .true.
    case ('--dry-run')
      command%dry_run = .true.
    case ('--force')
      command%force = .true.
    case ('--resume')
      command%resume = .true.
    case ('--search-only')
      command%search_only = .true.
    case ('--partial')
      command%partial = .true.
    case ('--contacts')
      command%contacts = .true.
    case ('--json')
      command%json = .true.
    case ('--quiet')
      command%quiet = .true.
    end select
  end subroutine switch_on

  subroutine take_value(name, value, command, error)
    character(len=*), intent(in) :: name, value
    type(command_t), intent(inout) :: command
    type(error_t), allocatable, intent(out) :: error
    character(len=longest_argument) :: padded
    select case (name)
    case ('--output', '--list', '--csv', '--record', '--log', '--tile-times', '--catalogue', '--draw')
      call take_path(name, value, command, error)
    case ('--set')
      padded = value
      command%overrides = [character(len=longest_argument) :: command%overrides, padded]
    case ('--shard')
      call read_shard(value, command, error)
    case ('--time-limit')
      call read_number_in(name, value, tiny(1.0_wp), huge(1.0_wp), 'seconds', command%time_limit, error)
    case ('--progress')
      call read_number_in(name, value, tiny(1.0_wp), huge(1.0_wp), 'seconds', command%progress, error)
    case ('--device')
      command%device = value
      if (.not. any(devices == value)) call fail(error, exit_usage, name//": found '"//value//"', allowed "//join(devices, ', '))
    case ('--ranks-per-node')
      call read_integer(name, value, 1, command%ranks_per_node, error)
    case ('--sample')
      call read_integer(name, value, 1, command%sample, error)
    case ('--seed')
      call read_integer(name, value, 0, command%seed, error)
    case ('--parameter')
      command%parameter = value
    case ('--from')
      call take_end(command%from)
    case ('--to')
      call take_end(command%to)
    case ('--free')
      command%free = value
    case ('--free-from')
      call take_end(command%free_from)
    case ('--free-to')
      call take_end(command%free_to)
    case ('--grow')
      call read_number_in(name, value, 0.0_wp, 1000.0_wp, 'windows', command%grow, error)
    case ('--searches')
      call read_integer(name, value, 1, command%searches, error, most_searches)
    case ('--periods')
      call read_integer(name, value, 1, command%periods, error)
    case ('--max-changes')
      call read_number_in(name, value, 0.0_wp, 100.0_wp, 'per cent', command%max_changes, error)
    end select

  contains

    !> One end of a range; which units it may have is known with the case.
    subroutine take_end(text)
      character(len=32), intent(out) :: text
      text = value
      if (len_trim(value) == 0 .or. len(value) > len(text)) then
        call fail(error, exit_usage, name//": found '"//value//"', allowed a number, or one with a unit")
      end if
    end subroutine take_end

  end subroutine take_value

  !> 'I/N', share I of N.
  subroutine read_shard(value, command, error)
    character(len=*), intent(in) :: value
    type(command_t), intent(inout) :: command
    type(error_t), allocatable, intent(out) :: error
    integer :: slash
    slash = index(value, '/')
    if (slash > 0) call read_integer('--shard', value(:slash - 1), 1, command%shard, error)
    if (slash > 0 .and. .not. allocated(error)) call read_integer('--shard', value(slash + 1:), 1, command%shard_count, error)
    if (slash == 0 .or. allocated(error) .or. command%shard > command%shard_count) then
      call fail(error, exit_usage, "--shard: found '"//value//"', allowed I/N with whole numbers from 1/1 to N/N")
    end if
  end subroutine read_shard

  subroutine take_path(name, value, command, error)
    character(len=*), intent(in) :: name, value
    type(command_t), intent(inout) :: command
    type(error_t), allocatable, intent(out) :: error
    if (len(value) == 0) call fail(error, exit_usage, name//' needs the name of a file')
    select case (name)
    case ('--list')
      command%list = value
    case ('--tile-times')
      command%tile_times = value
    case ('--catalogue')
      command%catalogue = value
    case ('--draw')
      command%draw = value
    case ('--csv')
      command%csv = value
    case ('--log')
      command%log = value
    case ('--record')
      command%record = value
    case default
      command%output = value
    end select
  end subroutine take_path

  !> A number of `unit` from `lowest`, where tiny stands for above 0, to `highest`, where huge stands for any.
  subroutine read_number_in(name, value, lowest, highest, unit, number, error)
    character(len=*), intent(in) :: name, value, unit
    real(wp), intent(in) :: lowest, highest
    real(wp), intent(out) :: number
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: range
    integer :: status
    call parse_number(value, number, status)
    if (status == 0 .and. number >= lowest .and. number <= highest) return
    range = ' from '//to_text(lowest)//' to '//to_text(highest)
    if (highest >= huge(highest)) range = ' above 0'
    if (lowest <= -huge(lowest)) range = ''
    call fail(error, exit_usage, name//": found '"//value//"', allowed a number of "//unit//range)
  end subroutine read_number_in

  subroutine read_integer(name, value, least, number, error, most)
    character(len=*), intent(in) :: name, value
    integer, intent(in) :: least
    integer, intent(out) :: number
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in), optional :: most
    character(len=:), allocatable :: range
    integer :: status, largest
    largest = huge(largest)
    range = ' from '//to_text(least)
    if (present(most)) then
      largest = most
      range = range//' to '//to_text(most)
    end if
    call parse_integer(value, number, status)
    if (status /= 0 .or. number < least .or. number > largest) then
      call fail(error, exit_usage, name//": found '"//value//"', allowed a whole number"//range)
    end if
  end subroutine read_integer

  function argument_at(position) result(argument)
    integer, intent(in) :: position
    character(len=:), allocatable :: argument
    integer :: length
    call get_command_argument(position, length=length)
    allocate (character(len=length) :: argument)
    call get_command_argument(position, argument)
  end function argument_at

end module command_line
