! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix merge`: the shares of a map or of a list of starts become the file that one run would have written.
module merge_driver
  use basin_map, only: describe_basin, end_basin, prepare_basin
  use basin_work, only: basin_work_t, prepare_counts
  use case_reader, only: load_case_text
  use catalogue_search, only: unpack_catalogues
  use command_line, only: command_t
  use errors, only: error_t, fail
  use files, only: is_same_file
  use kinds, only: int64
  use map_file, only: map_file_t
  use map_schema, only: name_length, schema_t
  use list_work, only: describe_list, end_points, list_work_t, points_per_tile, read_list
  use output_check, only: working_path
  use second_look, only: look_again
  use serial_team, only: serial_team_t
  use session, only: session_t
  use share_files, only: join_shares, note_builds, read_shares, shares_t
  use signals, only: install_signals
  use status, only: exit_io, exit_usage
  implicit none
  private

  public :: run_merge

contains

  !> Runs the command; ends the program with the exit code on errors. Code 64 if the output would replace a share, 65 for a
  !> file that is no share or is given twice, 66 for a share that is missing, 74 for a damaged one, 75 for one that is not
  !> done, 76 for one of another case.
  subroutine run_merge(command)
    type(command_t), intent(in) :: command
    type(session_t) :: session
    type(shares_t) :: shares
    type(error_t), allocatable :: error
    character(len=128) :: no_overrides(0)
    session%command = command
    allocate (serial_team_t :: session%team)
    call session%journal%open(.true., command%json, command%quiet)
    call session%journal%open_copy(command%log, error)
    if (.not. allocated(error)) call install_signals(error)
    if (.not. allocated(error)) call read_shares(command%shards, shares, error)
    if (.not. allocated(error)) call check_names(command, error)
    if (.not. allocated(error)) call load_case_text(shares%resolved_case, trim(command%shards(1))//' (resolved case)', &
                                                    no_overrides, session%the_case, error)
    call session%stop_if(error)
    session%the_case%raw_text = shares%case_text
    select case (shares%kind)
    case ('basin')
      call merge_map(session, shares)
    case ('points')
      call merge_list(session, shares)
    case default
      call fail(error, exit_io, "'"//trim(command%shards(1))//"' is damaged: it is a share of the kind '"//shares%kind//"'")
      call session%stop_if(error)
    end select
  end subroutine run_merge

  !> Code 64 if the output or its working file would replace a share.
  subroutine check_names(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: share
    logical :: replaces(2)
    integer :: i
    do i = 1, size(command%shards)
      share = trim(command%shards(i))
      replaces = [is_same_file(command%path, share), is_same_file(working_path(command%path), share)]
      if (.not. any(replaces)) cycle
      call fail(error, exit_usage, "the output '"//command%path//"' would replace the share '"//share// &
                "': the first name after 'merge' is that of the new file")
      return
    end do
  end subroutine check_names

  subroutine merge_map(session, shares)
    type(session_t), intent(inout) :: session
    type(shares_t), intent(in) :: shares
    type(basin_work_t) :: work
    type(map_file_t) :: file
    type(schema_t) :: schema
    type(error_t), allocatable :: error
    character(len=name_length), allocatable :: dimensions(:)
    integer, allocatable :: tile(:)
    logical :: complete
    if (len(session%command%csv) > 0) call fail(error, exit_usage, '--csv belongs to the shares of a list of starts')
    call session%stop_if(error)
    call prepare_basin(session%the_case, work, tile, ranks=1, gpus=0)
    call take_catalogues(shares, work, error)
    call session%stop_if(error)
    call session%begin(session%command%path, tiled=.true.)
    call describe_basin(session, work, schema, dimensions)
    call note_builds(session, shares, schema, error)
    call session%stop_if(error)
    call join_shares(session, shares, session%command%path, schema, dimensions, tile, work, file)
    call look_again(session, file, work, complete)
    call end_basin(session, work, file, complete)
  end subroutine merge_map

  subroutine merge_list(session, shares)
    type(session_t), intent(inout) :: session
    type(shares_t), intent(in) :: shares
    type(list_work_t) :: work
    type(map_file_t) :: file
    type(schema_t) :: schema
    type(error_t), allocatable :: error
    call read_list(trim(shares%files(1)), work%list, error)
    call session%stop_if(error)
    call session%begin(session%command%path, tiled=.true.)
    call describe_list(session, work%list, schema)
    call note_builds(session, shares, schema, error)
    call session%stop_if(error)
    call join_shares(session, shares, session%command%path, schema, ['point'], [points_per_tile], work, file)
    call end_points(session, work, file, complete=.true.)
  end subroutine merge_list

  subroutine take_catalogues(shares, work, error)
    type(shares_t), intent(in) :: shares
    type(basin_work_t), intent(inout) :: work
    type(error_t), allocatable, intent(out) :: error
    allocate (work%catalogues(merge(work%grid%slices, 0_int64, any(work%grid%start_axis > 0))))
    call unpack_catalogues(shares%catalogue, work%catalogues, error)
    if (allocated(error)) return
    call prepare_counts(work)
  end subroutine take_catalogues

end module merge_driver
