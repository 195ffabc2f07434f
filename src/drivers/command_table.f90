! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The commands and their options: one row each. Parsing, refusals and the texts of `--help` take them from here.
module command_table
  use text, only: join
  implicit none
  private

  public :: help_text, belonging_to, command_number, option_number

  character(len=*), parameter :: nl = new_line('a')

  type, public :: command_row_t
    character(len=10) :: name
    !> What stands behind the name, and what it does, in a line.
    character(len=9) :: reads
    character(len=110) :: summary
    !> Its description in `--help`, before its options.
    character(len=900) :: help
    !> Stops early on a signal, with what can be resumed; others end at once, as they keep nothing.
    logical :: stops_early = .false.
    !> Many trajectories, which a GPU may fly.
    logical :: uses_device = .false.
  end type command_row_t

  type(command_row_t), parameter, public :: rows(11) = [ &
    command_row_t('basin', 'CASE', &
      'where every point of a grid of starts or parameters ends up', &
      'separatrix basin CASE [-o FILE]: where every point of a grid ends up'//nl// &
      '  The grid is the [[axis]] tables of the case: two or more of x0, v0, crank_angle, drive.ratio or any'//nl// &
      '  other parameter. Run it with mpirun to share the work.'//nl, &
      stops_early=.true., uses_device=.true.), &
    command_row_t('sweep', 'CASE', &
      'amplitude-frequency and bifurcation diagram, run up, run down and from many starts', &
      'separatrix sweep CASE [-o FILE]: amplitude-frequency and bifurcation diagram'//nl// &
      '  Runs a parameter up and down with state and crank angle carried over, starts many motions at every'//nl// &
      '  value, and brackets the limits between which impacts occur. The [sweep] table of the case defines them.'//nl, &
      stops_early=.true., uses_device=.true.), &
    command_row_t('branches', 'CASE', &
      'periodic orbits over a parameter, stable and unstable, with their bifurcations', &
      'separatrix branches CASE --parameter NAME [--from A] [--to B] [-o FILE]: periodic orbits'//nl// &
      '  Searches orbits, stable and unstable, at several values; follows each through folds and grazes.'//nl// &
      '  Without --from and --to the range is that of the sweep or the axis of this parameter in the case.'//nl// &
      '  A and B are numbers in SI units, or have a unit (--from "7 Hz").'//nl// &
      '  --searches N       values at which orbits are searched (default 12)'//nl// &
      '  --contacts         looks for homoclinic contacts and boundary crises of the saddles'//nl// &
      '  --free NAME        a second parameter, over which the labels found are followed as curves'//nl// &
      '  --free-from A, --free-to B   its range, without which it is that of the axis of this parameter'//nl), &
    command_row_t('boundary', 'MAP', &
      'the boundaries between the basins of a map, as curves', &
      'separatrix boundary MAP [-o FILE]: the boundaries between the basins of a finished map, as curves'//nl// &
      '  Every edge between neighbours of different attractors is halved until its boundary point is known to 1e-10'//nl// &
      '  of the map; the points are linked to curves. The pieces are named by what they lead to, and the stable and'//nl// &
      '  unstable sets of the saddles are grown (one body). Run it with mpirun to share the work.'//nl// &
      '  --grow F           grows these sets within F times the window of the map (default 1; 0: not at all)'//nl), &
    command_row_t('stability', 'CASE', &
      'Lyapunov exponents of one motion, and whether it is periodic, quasi-periodic or chaotic', &
      'separatrix stability CASE|MAP [--periods N]: Lyapunov exponents and the kind of a motion'//nl// &
      '  The motion from [start] after its transients: exponents with standard errors, their exact sum as a check,'//nl// &
      '  the 0-1 test, and what the motion is. Of a map: every attractor without a known period, but families of'//nl// &
      '  cycles (chaotic, quasi-periodic, long transient, period above the limit, not known). Writes no file.'//nl// &
      '  --periods N        drive periods watched, after a quarter as many (default 20000)'//nl), &
    command_row_t('trajectory', 'CASE', &
      'one motion with all its events', &
      'separatrix trajectory CASE [-o FILE] [--csv FILE] [--record FILE]: one motion with all its events'//nl// &
      '  --csv FILE      also write the events as a table'//nl// &
      '  --record FILE   also write the position as the sensor of the table [record] would measure it'//nl), &
    command_row_t('points', 'CASE', &
      'a list of starts', &
      'separatrix points CASE --list ICS.csv [-o FILE] [--csv FILE]: a list of starts'//nl// &
      '  --list FILE     table with the columns x0,v0, optionally ratio and starts of further bodies (body.NAME.x0);'//nl// &
      '                  replaces the grid of the case'//nl// &
      '  --csv FILE      also write x0,v0,ratio,x,v,impacts,last_impact_speed,reason at full precision'//nl, &
      stops_early=.true., uses_device=.true.), &
    command_row_t('merge', 'OUT SHARD', &
      'one file from the shares of a map', &
      'separatrix merge OUT SHARD...: one result file from the files that --shard I/N has written'//nl// &
      '  The shards must be all of one case: N files, each share once. They are kept.'//nl// &
      '  --csv FILE      of a list of starts also the table that points --csv writes'//nl), &
    command_row_t('laws', '', &
      'every law with parameters, units, bounds and source', &
      'separatrix laws [--json]: every law with parameters, units, bounds and source'//nl), &
    command_row_t('info', 'FILE', &
      'what a file holds', &
      'separatrix info FILE [--json]: what a file holds, with shares of regimes and attractors'//nl), &
    command_row_t('verify', 'FILE', &
      'checks a file and reruns a sample of it at higher precision', &
      'separatrix verify FILE [--sample N] [--seed N] [--max-changes P] [--json]: checks a file'//nl// &
      '  Reads everything back, checks sums and invariants, and reruns a random sample of the points in double'//nl// &
      '  precision (must agree to the bit) and in quadruple precision (label flips, largest deviation).'//nl// &
      '  Ends with code 77 if more labels would change than are allowed.'//nl// &
      '  --sample N      points rerun (default 200)'//nl// &
      '  --seed N        seed that chooses them (default 1)'//nl// &
      '  --max-changes P per cent of the labels rerun that may change (default 1)'//nl)]

  !> What `--device` can be.
  character(len=*), parameter, public :: devices(3) = [character(len=4) :: 'auto', 'cpu', 'gpu']

  character(len=*), parameter, public :: commands(size(rows)) = rows%name

  type, public :: option_row_t
    character(len=16) :: name
    character(len=2) :: short
    logical :: takes_value
    !> The commands that it belongs to; none are named of one that belongs to all.
    character(len=80) :: commands
    !> Its lines in the list of options; '' where its command describes it.
    character(len=130) :: help
  end type option_row_t

  type(option_row_t), parameter, public :: options(37) = [ &
    option_row_t('--output', '-o', .true., 'basin sweep branches boundary trajectory points', &
      '  -o, --output FILE  where to write (default: NAME.COMMAND.h5, NAME that of the case or map)'), &
    option_row_t('--set', '', .true., 'basin sweep branches stability trajectory points', &
      '  --set KEY=VALUE    replaces a value of the case, e.g. --set friction.damping=0.3; repeatable'), &
    option_row_t('--validate', '', .false., 'basin sweep branches boundary stability trajectory points', &
      '  --validate         checks the case and stops'), &
    option_row_t('--draw', '', .true., 'basin sweep branches stability trajectory points', &
      '  --draw FILE.svg    draws the machine as it was understood and stops'), &
    option_row_t('--dry-run', '', .false., 'basin sweep branches boundary stability trajectory points', &
      '  --dry-run          reports what would be done: points, tiles, bytes, estimated time'), &
    option_row_t('--force', '', .false., 'basin sweep branches boundary stability trajectory points merge', &
      '  --force            replaces an existing output'), &
    option_row_t('--resume', '', .false., 'basin sweep boundary points', &
      '  --resume           goes on with a run that was stopped or killed, begins one if there is none'), &
    option_row_t('--shard', '', .true., 'basin points', &
      '  --shard I/N        basin, points: only share I of N of the tiles, into OUT.shard-I-of-N.part; merge joins them'), &
    option_row_t('--catalogue', '', .true., 'basin', &
      '  --catalogue FILE   basin: takes the attractors from a share of the same map instead of searching them'), &
    option_row_t('--search-only', '', .false., 'basin', &
      '  --search-only      basin --shard: only makes the file of the share, from which all can take the attractors'), &
    option_row_t('--time-limit', '', .true., 'basin sweep boundary points', &
      '  --time-limit S     stops cleanly after S seconds, to be resumed (exit code 75)'), &
    option_row_t('--ranks-per-node', '', .true., 'basin sweep points', &
      '  --ranks-per-node N splits a host into nodes of N ranks (default: as the hosts are)'), &
    option_row_t('--device', '', .true., 'basin sweep points', &
      '  --device NAME      auto (the faster of processor and GPU, measured), cpu or gpu; the results are the same bits'), &
    option_row_t('--tile-times', '', .true., 'basin sweep points', &
      '  --tile-times FILE  table of the tiles: rank, begin and end in seconds, questions to rank 0'), &
    option_row_t('--progress', '', .true., 'basin sweep branches boundary stability trajectory points', &
      '  --progress S       progress every S seconds (default: in a log after 10 s, then ever less often)'), &
    option_row_t('--json', '', .false., '', &
      '  --json             log as JSON lines'), &
    option_row_t('--log', '', .true., 'basin sweep branches boundary stability trajectory points merge', &
      '  --log FILE         the log as JSON lines behind what is in FILE, beside the one on stdout'), &
    option_row_t('--quiet', '-q', .false., 'basin sweep branches boundary stability trajectory points merge verify', &
      '  -q, --quiet        errors only'), &
    option_row_t('--version', '', .false., '', &
      '  --version          version, commit, compilers, MPI, HDF5 and flags'), &
    option_row_t('--partial', '', .false., 'basin sweep branches boundary stability trajectory points merge verify', &
      '  --partial          code 0 also where every motion was given up (else 78)'), &
    option_row_t('--list', '', .true., 'points', &
      ''), &
    option_row_t('--csv', '', .true., 'points trajectory merge', &
      ''), &
    option_row_t('--record', '', .true., 'trajectory', &
      ''), &
    option_row_t('--parameter', '', .true., 'branches', &
      ''), &
    option_row_t('--from', '', .true., 'branches', &
      ''), &
    option_row_t('--to', '', .true., 'branches', &
      ''), &
    option_row_t('--searches', '', .true., 'branches', &
      ''), &
    option_row_t('--contacts', '', .false., 'branches', &
      ''), &
    option_row_t('--free', '', .true., 'branches', &
      ''), &
    option_row_t('--free-from', '', .true., 'branches', &
      ''), &
    option_row_t('--free-to', '', .true., 'branches', &
      ''), &
    option_row_t('--grow', '', .true., 'boundary', &
      ''), &
    option_row_t('--periods', '', .true., 'stability', &
      ''), &
    option_row_t('--sample', '', .true., 'verify', &
      ''), &
    option_row_t('--seed', '', .true., 'verify', &
      ''), &
    option_row_t('--max-changes', '', .true., 'verify', &
      ''), &
    option_row_t('--help', '-h', .false., '', &
      '')]

contains

  !> Row of a command, 0 if there is none.
  pure integer function command_number(name) result(number)
    character(len=*), intent(in) :: name
    number = findloc(commands == name, .true., 1)
  end function command_number

  !> Row of an option by its long or short name, 0 if there is none.
  pure integer function option_number(name) result(number)
    character(len=*), intent(in) :: name
    number = findloc(options%name == name .or. (options%short == name .and. len_trim(options%short) > 0), .true., 1)
  end function option_number

  !> 'the command basin', 'the commands basin, points': what an option belongs to; '' if it belongs to `command`.
  pure function belonging_to(option, command) result(words)
    type(option_row_t), intent(in) :: option
    character(len=*), intent(in) :: command
    character(len=:), allocatable :: words
    logical :: among(size(commands))
    integer :: k
    words = ''
    if (len_trim(option%commands) == 0) return
    among = [(index(' '//trim(option%commands)//' ', ' '//trim(commands(k))//' ') > 0, k=1, size(commands))]
    if (any(among .and. commands == command)) return
    words = 'the command'//trim(merge('s', ' ', count(among) > 1))//' '//join(pack(commands, among), ', ')
  end function belonging_to

  !> The text of `--help`: of one command, with the options that belong to it; or, with '', of the program, with all.
  pure function help_text(command) result(lines)
    character(len=*), intent(in) :: command
    character(len=:), allocatable :: lines
    character(len=16) :: called
    integer :: k
    k = findloc(commands == command, .true., 1)
    if (k > 0) then
      lines = trim(rows(k)%help)
    else
      lines = 'separatrix COMMAND FILE [OPTIONS]: where the motions of impacting and rubbing machines end up'//nl//nl
      do k = 1, size(rows)
        called = trim(rows(k)%name)//' '//rows(k)%reads
        lines = lines//'  '//called//' '//trim(rows(k)%summary)//nl
      end do
      lines = lines//nl//'See separatrix COMMAND --help. CASE is a TOML file, see docs/case-file.md.'//nl
    end if
    lines = lines//nl//'Options:'//nl
    do k = 1, size(options)
      if (len_trim(options(k)%help) == 0) cycle
      if (any(commands == command)) then
        if (len(belonging_to(options(k), command)) > 0) cycle
      end if
      lines = lines//trim(options(k)%help)//nl
    end do
    lines = lines//nl// &
      'Exit codes: 0 done, 64 usage, 65 bad case, 66 input missing, 70 internal, 73 cannot create, 74 I/O,'//nl// &
      '75 stopped early and resumable, 76 file belongs to another case, 77 too many labels would change, 78 motion given up.'//nl
  end function help_text

end module command_table
