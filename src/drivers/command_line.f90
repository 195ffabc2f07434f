! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The command line: what was asked, and the texts of `--help`.
module command_line
  use errors, only: error_t, fail
  use kinds, only: wp
  use status, only: exit_usage
  use text, only: join, read_number, starts_with, to_text
  implicit none
  private

  public :: read_command_line, help_text

  integer, parameter :: longest_argument = 4096

  character(len=*), parameter, public :: commands(11) = [character(len=10) :: 'basin', 'sweep', &
    'branches', 'boundary', 'stability', 'trajectory', 'points', 'merge', 'laws', 'info', 'verify']

  !> The commands that keep what is done when they are stopped.
  character(len=*), parameter :: resumable(3) = [character(len=10) :: 'basin', 'sweep', 'points']

  !> The commands that write a table besides.
  character(len=*), parameter :: tabulated(3) = [character(len=10) :: 'points', 'trajectory', 'merge']

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
    logical :: help = .false., version = .false., validate = .false., dry_run = .false.
    logical :: force = .false., resume = .false., json = .false., quiet = .false., search_only = .false.
    real(wp) :: time_limit = 0
    !> Seconds between lines of progress; 0 = as the journal thinks fit.
    real(wp) :: progress = 0
    integer :: ranks_per_node = 0
    !> `branches`: the parameter, its range, and at how many values orbits are searched.
    character(len=:), allocatable :: parameter
    real(wp) :: from = 0, to = 0
    logical :: has_from = .false., has_to = .false.
    integer :: searches = 12
    !> A second parameter, over which its labels are followed, and its range.
    character(len=:), allocatable :: free
    real(wp) :: free_from = 0, free_to = 0
    logical :: has_free_from = .false., has_free_to = .false.
    !> `stability`: drive periods that are watched.
    integer :: periods = 20000
    !> `verify`: points rerun, and the seed that chooses them.
    integer :: sample = 200, seed = 1
    !> `verify`: share of the labels that may change, in per cent.
    real(wp) :: max_changes = 1
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
          "'; the commands are "//join(commands, ', '))
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
    call check_command(command, error)
  end subroutine read_command_line

  subroutine check_command(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    if (len(command%name) == 0) then
      call fail(error, exit_usage, 'a command is missing; the commands are '//join(commands, ', ')// &
                ' (see separatrix --help)')
    else if (len(command%path) == 0 .and. command%name /= 'laws') then
      call fail(error, exit_usage, command%name//': the file is missing (see separatrix '//command%name// &
                ' --help)')
    else if (len(command%path) > 0 .and. command%name == 'laws') then
      call fail(error, exit_usage, "laws takes no file; found '"//command%path//"'")
    else if (command%name == 'merge' .and. size(command%shards) == 0) then
      call fail(error, exit_usage, 'merge: the shards are missing (see separatrix merge --help)')
    else if (command%shard > 0 .and. command%name /= 'basin' .and. command%name /= 'points') then
      call fail(error, exit_usage, '--shard belongs to the commands basin and points')
    else if (command%shard > 0 .and. len(command%csv) > 0) then
      call fail(error, exit_usage, '--csv needs the whole list: give it to merge')
    else if (len(command%catalogue) > 0 .and. command%name /= 'basin') then
      call fail(error, exit_usage, '--catalogue belongs to the command basin')
    else if (command%search_only .and. (command%name /= 'basin' .or. command%shard == 0)) then
      call fail(error, exit_usage, '--search-only belongs to basin --shard I/N')
    else if (command%search_only .and. len(command%catalogue) > 0) then
      call fail(error, exit_usage, '--search-only searches, --catalogue takes what was found: choose one')
    else if (command%name == 'points' .and. len(command%list) == 0) then
      call fail(error, exit_usage, 'points: --list ICS.csv is missing')
    else if (command%name == 'stability' .and. len(command%output) > 0) then
      call fail(error, exit_usage, 'stability writes no file: -o does not belong to it (--log FILE keeps its report)')
    else if (command%name == 'stability' .and. command%periods < 64) then
      call fail(error, exit_usage, '--periods: found '//to_text(command%periods)//', allowed is a whole number from 64')
    else if (command%name == 'branches' .and. len(command%parameter) == 0) then
      call fail(error, exit_usage, 'branches: --parameter NAME is missing, e.g. --parameter drive.ratio')
    else if (command%name /= 'branches' .and. (len(command%parameter) > 0 .or. command%has_from .or. command%has_to)) then
      call fail(error, exit_usage, '--parameter, --from and --to belong to the command branches')
    else if (command%name /= 'branches' .and. len(command%free) > 0) then
      call fail(error, exit_usage, '--free belongs to the command branches')
    else if (len(command%free) == 0 .and. (command%has_free_from .or. command%has_free_to)) then
      call fail(error, exit_usage, '--free-from and --free-to are the range of --free NAME, which is missing')
    else if (command%name /= 'points' .and. len(command%list) > 0) then
      call fail(error, exit_usage, '--list belongs to the command points')
    else if (len(command%csv) > 0 .and. .not. any(command%name == tabulated)) then
      call fail(error, exit_usage, '--csv belongs to the commands '//join(tabulated, ', '))
    else if (len(command%record) > 0 .and. command%name /= 'trajectory') then
      call fail(error, exit_usage, '--record belongs to the command trajectory')
    else if (len(command%tile_times) > 0 .and. .not. any(command%name == resumable)) then
      call fail(error, exit_usage, '--tile-times belongs to the commands '//join(resumable, ', '))
    else if (len(command%draw) > 0 .and. any(command%name == [character(len=10) :: 'merge', 'boundary', 'laws', 'info', &
                                                                               'verify'])) then
      call fail(error, exit_usage, '--draw belongs to the commands that read a case')
    else if (size(command%overrides) > 0 .and. command%name == 'boundary') then
      call fail(error, exit_usage, '--set belongs to the commands that read a case: boundary takes that of its map')
    else if (command%resume .and. .not. any(command%name == resumable)) then
      call fail(error, exit_usage, '--resume belongs to the commands '//join(resumable, ', '))
    else if (command%time_limit > 0 .and. .not. any(command%name == resumable)) then
      call fail(error, exit_usage, '--time-limit belongs to the commands '//join(resumable, ', '))
    else if (command%force .and. command%resume) then
      call fail(error, exit_usage, '--force starts anew and --resume goes on: choose one')
    else
      call check_outputs(command, error)
    end if
  end subroutine check_command

  !> Nothing that is read may be replaced, and no output by another.
  subroutine check_outputs(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    if (len(command%output) > 0 .and. (command%output == command%path .or. command%output == command%list)) then
      call fail(error, exit_usage, "-o '"//command%output//"' would replace what is read")
    else if (len(command%log) > 0 .and. any(command%name == [character(len=10) :: 'laws', 'info', 'verify'])) then
      call fail(error, exit_usage, '--log belongs to the commands that compute')
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
    integer :: equals
    name = argument
    equals = index(argument, '=')
    if (starts_with(argument, '--') .and. equals > 0) name = argument(:equals - 1)
    select case (name)
    case ('-h', '--help')
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
    case ('--json')
      command%json = .true.
    case ('-q', '--quiet')
      command%quiet = .true.
    case ('-o', '--output', '--set', '--list', '--csv', '--record', '--log', '--tile-times', '--shard', '--catalogue', &
          '--draw', '--parameter', '--from', '--to', '--searches', '--free', '--free-from', '--free-to', '--periods', &
          '--time-limit', '--progress', '--ranks-per-node', '--sample', '--seed', '--max-changes')
      if (equals > 0 .and. starts_with(argument, '--')) then
        value = argument(equals + 1:)
      else if (position < command_argument_count()) then
        position = position + 1
        value = argument_at(position)
      else
        call fail(error, exit_usage, name//' needs a value')
        return
      end if
      call take_value(name, value, command, error)
    case default
      call fail(error, exit_usage, "unknown option '"//argument//"' (see separatrix --help)")
    end select
    if (equals > 0 .and. .not. allocated(value) .and. .not. allocated(error)) then
      call fail(error, exit_usage, name//' takes no value')
    end if
  end subroutine read_option

  subroutine take_value(name, value, command, error)
    character(len=*), intent(in) :: name, value
    type(command_t), intent(inout) :: command
    type(error_t), allocatable, intent(out) :: error
    character(len=longest_argument) :: padded
    select case (name)
    case ('-o', '--output', '--list', '--csv', '--record', '--log', '--tile-times', '--catalogue', '--draw')
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
    case ('--ranks-per-node')
      call read_integer(name, value, 1, command%ranks_per_node, error)
    case ('--sample')
      call read_integer(name, value, 1, command%sample, error)
    case ('--seed')
      call read_integer(name, value, 0, command%seed, error)
    case ('--parameter')
      command%parameter = value
    case ('--from')
      command%has_from = .true.
      call read_number_in(name, value, -huge(1.0_wp), huge(1.0_wp), 'the parameter', command%from, error)
    case ('--to')
      command%has_to = .true.
      call read_number_in(name, value, -huge(1.0_wp), huge(1.0_wp), 'the parameter', command%to, error)
    case ('--free')
      command%free = value
    case ('--free-from')
      command%has_free_from = .true.
      call read_number_in(name, value, -huge(1.0_wp), huge(1.0_wp), 'the second parameter', command%free_from, error)
    case ('--free-to')
      command%has_free_to = .true.
      call read_number_in(name, value, -huge(1.0_wp), huge(1.0_wp), 'the second parameter', command%free_to, error)
    case ('--searches')
      call read_integer(name, value, 1, command%searches, error)
    case ('--periods')
      call read_integer(name, value, 1, command%periods, error)
    case ('--max-changes')
      call read_number_in(name, value, 0.0_wp, 100.0_wp, 'per cent', command%max_changes, error)
    end select
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
      call fail(error, exit_usage, "--shard: found '"//value//"', allowed is I/N with whole numbers from 1/1 to N/N")
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
    number = 0
    status = verify(value, '0123456789.eE+-')
    if (status == 0) call read_number(value, number, status)
    if (status == 0 .and. number >= lowest .and. number <= highest) return
    range = 'from '//to_text(lowest)//' to '//to_text(highest)
    if (highest >= huge(highest)) range = 'above 0'
    call fail(error, exit_usage, name//": found '"//value//"', allowed is a number of "//unit//' '//range)
  end subroutine read_number_in

  subroutine read_integer(name, value, least, number, error)
    character(len=*), intent(in) :: name, value
    integer, intent(in) :: least
    integer, intent(out) :: number
    type(error_t), allocatable, intent(out) :: error
    integer :: status
    number = least - 1
    status = verify(value, '0123456789')
    if (status == 0) read (value, *, iostat=status) number
    if (status /= 0 .or. number < least) then
      call fail(error, exit_usage, name//": found '"//value//"', allowed is a whole number"// &
                trim(merge(' from 1', ' from 0', least > 0)))
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

  !> The text of `--help`, of one command or, with '', of the program.
  pure function help_text(command) result(lines)
    character(len=*), intent(in) :: command
    character(len=:), allocatable :: lines
    character(len=*), parameter :: nl = new_line('a')
    select case (command)
    case ('basin')
      lines = 'separatrix basin CASE [-o FILE]: where every point of a grid ends up'//nl// &
        '  The grid is the [[axis]] tables of the case: two or more of x0, v0, crank_angle, drive.ratio or any'//nl// &
        '  other parameter. Run it with mpirun to share the work.'//nl
    case ('sweep')
      lines = 'separatrix sweep CASE [-o FILE]: amplitude-frequency and bifurcation diagram'//nl// &
        '  Runs a parameter up and down with state and crank angle carried over, starts many motions at every'//nl// &
        '  value, and brackets the limits between which impacts occur. The [sweep] table of the case says how.'//nl
    case ('branches')
      lines = 'separatrix branches CASE --parameter NAME [--from A] [--to B] [-o FILE]: periodic orbits'//nl// &
        '  Searches orbits, stable and unstable, at several values; follows each through folds and grazes.'//nl// &
        '  One body. Without --from and --to the range is that of the sweep or the axis of this parameter in the case.'//nl// &
        '  --searches N       values at which orbits are searched (default 12)'//nl// &
        '  --free NAME        a second parameter, over which the labels found are followed as curves'//nl// &
        '  --free-from A, --free-to B   its range, without which it is that of the axis of this parameter'//nl
    case ('boundary')
      lines = 'separatrix boundary MAP [-o FILE]: the boundaries between the basins of a finished map, as curves'//nl// &
        '  Every edge between neighbours of different attractors is halved until its boundary point is known to 1e-10'//nl// &
        '  of the map; the points are linked to curves. Run it with mpirun to share the work. Nothing to resume: it'//nl// &
        '  takes a small part of the time of the map.'//nl
    case ('stability')
      lines = 'separatrix stability CASE|MAP [--periods N]: Lyapunov exponents and the kind of a motion'//nl// &
        '  The motion from [start] after its transients: exponents with standard errors, their exact sum as a check,'//nl// &
        '  the 0-1 test, and what the motion is. Of a map: every attractor without a known period (chaotic, quasi-periodic,'//nl// &
        '  long transient, period above the limit, not known). One body. Writes no file.'//nl// &
        '  --periods N        drive periods watched, after a quarter as many (default 20000)'//nl
    case ('trajectory')
      lines = 'separatrix trajectory CASE [-o FILE] [--csv FILE] [--record FILE]: one motion with all its events'//nl// &
        '  --csv FILE      also write the events as a table'//nl// &
        '  --record FILE   also write the position as the sensor of the table [record] would measure it'//nl
    case ('points')
      lines = 'separatrix points CASE --list ICS.csv [-o FILE] [--csv FILE]: a list of starts'//nl// &
        '  --list FILE     table with the columns x0,v0 and optionally ratio; replaces the grid of the case'//nl// &
        '  --csv FILE      also write x0,v0,ratio,x,v,impacts,last_impact_speed,reason at full precision'//nl
    case ('merge')
      lines = 'separatrix merge OUT SHARD...: one result file from the files that --shard I/N has written'//nl// &
        '  The shards must be all of one case: N files, each share once. They are kept.'//nl// &
        '  --csv FILE      of a list of starts also the table that points --csv writes'//nl// &
        '  --force         replaces an existing OUT'//nl// &
        '  --json, --quiet, --log FILE  as for the other commands'//nl
      return
    case ('laws')
      lines = 'separatrix laws [--json]: every law with parameters, units, bounds and source'//nl
      return
    case ('info')
      lines = 'separatrix info FILE [--json]: what a file holds, with shares of regimes and attractors'//nl
      return
    case ('verify')
      lines = 'separatrix verify FILE [--sample N] [--seed N] [--max-changes P] [--json]: checks a file'//nl// &
        '  Reads everything back, checks sums and invariants, and reruns a random sample of the points in double'//nl// &
        '  precision (must agree to the bit) and in quadruple precision (label flips, largest deviation).'//nl// &
        '  Ends with code 77 if more labels would change than are allowed.'//nl// &
        '  --sample N      points rerun (default 200)'//nl// &
        '  --seed N        seed that chooses them (default 1)'//nl// &
        '  --max-changes P per cent of the labels rerun that may change (default 1)'//nl
      return
    case default
      lines = 'separatrix COMMAND FILE [OPTIONS]: where the motions of impacting and rubbing machines end up'//nl//nl// &
        '  basin CASE       where every point of a grid of starts or parameters ends up'//nl// &
        '  sweep CASE       amplitude-frequency and bifurcation diagram, run up, run down and from many starts'//nl// &
        '  branches CASE    periodic orbits over a parameter, stable and unstable, with their bifurcations'//nl// &
        '  boundary MAP     the boundaries between the basins of a map, as curves'//nl// &
        '  stability CASE   Lyapunov exponents of one motion, and whether it is periodic, quasi-periodic or chaotic'//nl// &
        '  trajectory CASE  one motion with all its events'//nl// &
        '  points CASE      a list of starts'//nl// &
        '  merge OUT SHARD  one file from the shares of a map'//nl// &
        '  laws             every law with parameters, units, bounds and source'//nl// &
        '  info FILE        what a file holds'//nl// &
        '  verify FILE      checks a file and reruns a sample of it at higher precision'//nl//nl// &
        'separatrix COMMAND --help tells more. CASE is a TOML file, see docs/case-file.md.'//nl
    end select
    lines = lines//nl//'Options:'//nl// &
      '  -o, --output FILE  where to write (default: NAME.COMMAND.h5, NAME that of the case or map)'//nl// &
      '  --set KEY=VALUE    replaces a value of the case, e.g. --set friction.damping=0.3; repeatable'//nl// &
      '  --validate         checks the case and stops'//nl// &
      '  --draw FILE.svg    draws the machine as it was understood and stops'//nl// &
      '  --dry-run          says what would be done: points, tiles, bytes, estimated time'//nl// &
      '  --force            replaces an existing output'//nl// &
      '  --resume           goes on with a run that was stopped or killed, begins one if there is none'//nl// &
      '  --shard I/N        basin, points: only share I of N of the tiles, into OUT.shard-I-of-N.part; merge joins them'//nl// &
      '  --catalogue FILE   basin: takes the attractors from a share of the same map instead of searching them'//nl// &
      '  --search-only      basin --shard: only makes the file of the share, from which all can take the attractors'//nl// &
      '  --time-limit S     stops cleanly after S seconds, to be resumed (exit code 75)'//nl// &
      '  --ranks-per-node N splits a host into nodes of N ranks (default: as the hosts are)'//nl// &
      '  --tile-times FILE  table of the tiles: rank, begin and end in seconds, questions to rank 0'//nl// &
      '  --progress S       progress every S seconds (default: in a log after 10 s, then ever less often)'//nl// &
      '  --json             log as JSON lines'//nl// &
      '  --log FILE         the log as JSON lines behind what is in FILE, beside the one on stdout'//nl// &
      '  -q, --quiet        errors only'//nl// &
      '  --version          version, commit, compilers, MPI, HDF5 and flags'//nl//nl// &
      'Exit codes: 0 done, 64 usage, 65 bad case, 66 input missing, 70 internal, 73 cannot create, 74 I/O,'//nl// &
      '75 stopped early and resumable, 76 file belongs to another case, 77 too many labels would change.'//nl
  end function help_text

end module command_line
