! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A finished map as the beginning of other work: its case, its attractors, and planes of its labels.
module stored_map
  use basin, only: catalogue_t
  use case_reader, only: load_case_text
  use case_setup, only: span_of
  use case_type, only: case_t
  use catalogue_search, only: search_catalogues
  use command_line, only: command_t
  use errors, only: error_t, fail
  use grid, only: grid_t
  use h5, only: h5_read_alignment
  use journal, only: journal_t
  use kinds, only: int64, wp
  use launched_team, only: start_launched_team
  use launcher, only: launched_ranks
  use map_reader, only: open_final, reader_t
  use map_verify, only: probe_file, verify_file, verify_plain
  use refinement, only: origin_contradicted
  use second_look, only: recall_second_look
  use session, only: session_t
  use signals, only: ignore_file_limit, set_farewell
  use start_label, only: label_left_domain
  use status, only: exit_bad_case, exit_io, exit_resumable, reason_left_domain
  use stop_check, only: limit_time, nothing_kept
  use team, only: team_t
  implicit none
  private

  public :: open_map_session, restore_catalogues, read_labels

contains

  !> A session on the case of a finished map, whose checksums have been verified. Ends the program with code 65 if the file is no
  !> map, 66 if there is none, 74 if it is damaged, 75 if it is not complete. The reader is open on every rank.
  subroutine open_map_session(command, session, reader)
    type(command_t), intent(in) :: command
    type(session_t), intent(out) :: session
    type(reader_t), intent(out) :: reader
    type(error_t), allocatable :: error
    character(len=:), allocatable :: resolved, raw
    integer :: bytes
    character(len=128) :: no_overrides(0)
    session%command = command
    session%alone = launched_ranks() == 1
    call start_launched_team(session%team)
    call session%journal%open(session%team%is_root(), command%json, command%quiet, command%progress)
    call session%journal%open_copy(command%log, error)
    if (.not. allocated(error)) call ignore_file_limit(error)
    if (.not. allocated(error)) call h5_read_alignment(bytes, error)
    call set_farewell('stopped while the map was read; '//nothing_kept)
    if (.not. allocated(error)) call limit_time(session%journal, command%time_limit, error)
    call session%stop_if(error)
    if (session%team%is_root()) call check_map_file(command%path, session%alone, error)
    call session%stop_if(error)
    call open_final(command%path, reader, error)
    if (.not. allocated(error)) call reader%read_text('/provenance/resolved_case', resolved, error)
    if (.not. allocated(error)) call reader%read_text('/provenance/case_text', raw, error)
    if (.not. allocated(error)) call load_case_text(resolved, command%path//' (resolved case)', no_overrides, session%the_case, &
                                                    error)
    call session%stop_if(error)
    session%the_case%raw_text = raw
  end subroutine open_map_session

  !> Whether a file is a finished map whose checksums agree. `alone`: a trial in another process can be made.
  subroutine check_map_file(path, alone, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: alone
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(reader_t) :: reader
    character(len=:), allocatable :: kind
    real(wp) :: complete
    integer :: datasets
    if (alone) call probe_file(path, error)
    if (.not. allocated(error)) call open_final(path, reader, error)
    if (allocated(error)) return
    complete = 0
    call reader%text_attribute('/', 'kind', kind, error)
    if (.not. allocated(error)) call reader%number_attribute('/', 'complete', complete, error)
    call reader%close(ignored)
    ! A damaged attribute is no kind of file.
    if (.not. allocated(error) .and. (kind /= 'basin' .or. nint(complete) /= 1)) call verify_plain(path, error)
    if (allocated(error)) return
    if (kind /= 'basin') then
      call fail(error, exit_bad_case, "'"//path//"': found a file of the kind '"//kind//"', allowed a map that basin wrote")
    else if (nint(complete) /= 1) then
      call fail(error, exit_resumable, "'"//path//"' is not complete: go on with the run that writes it")
    else
      call verify_file(path, error, datasets)
    end if
  end subroutine check_map_file

  !> The attractors of a map, searched again as its run did, with those of its second look.
  subroutine restore_catalogues(reader, team, journal, grid, the_case, catalogues, error)
    type(reader_t), intent(in) :: reader
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(case_t), intent(in) :: the_case
    type(catalogue_t), allocatable, intent(out) :: catalogues(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:)
    integer(int64), allocatable :: lengths(:)
    call search_catalogues(team, journal, grid, span_of(the_case), the_case%attractors, 0.0_wp, catalogues, error)
    if (allocated(error)) return
    if (.not. reader%has('/second_look/start')) return
    call reader%read_values('/second_look/start', values, error)
    if (.not. allocated(error)) call reader%lengths('/second_look/start', lengths, error)
    if (allocated(error)) return
    call recall_second_look(team, journal, grid, span_of(the_case), the_case%attractors%max_period, values, int(lengths(2)), &
                            catalogues, error)
  end subroutine restore_catalogues

  !> Labels of the plane over two axes (the first of them before the second) through the point `index`, as module `bisection` has
  !> them; `inferred`: which were not computed. Code 74 if the file has not the points that its case asks for.
  subroutine read_labels(reader, shape, axes, index, labels, inferred, error)
    type(reader_t), intent(in) :: reader
    integer, intent(in) :: shape(:), axes(2), index(:)
    integer, allocatable, intent(out) :: labels(:, :)
    logical, allocatable, intent(out) :: inferred(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:), reasons(:), origins(:)
    integer(int64), allocatable :: lengths(:)
    integer(int64) :: lower(size(shape)), extent(size(shape))
    integer :: i, j, k
    call reader%lengths('/attractor', lengths, error)
    if (allocated(error)) return
    if (size(lengths) /= size(shape)) then
      call fail(error, exit_io, "'"//reader%path//"' has not the points that its case asks for")
    else if (any(lengths /= shape)) then
      call fail(error, exit_io, "'"//reader%path//"' has not the points that its case asks for")
    end if
    if (allocated(error)) return
    lower = index - 1
    lower(axes) = 0
    extent = 1
    extent(axes) = shape(axes)
    call reader%read_block('/attractor', lower, extent, values, error)
    if (.not. allocated(error)) call reader%read_block('/reason', lower, extent, reasons, error)
    if (allocated(error)) return
    if (reader%has('/origin')) call reader%read_block('/origin', lower, extent, origins, error)
    if (allocated(error)) return
    allocate (labels(shape(axes(1)), shape(axes(2))), inferred(shape(axes(1)), shape(axes(2))))
    inferred = .false.
    do i = 1, size(labels, 1)
      do j = 1, size(labels, 2)
        k = (i - 1)*size(labels, 2) + j
        labels(i, j) = nint(values(k))
        if (labels(i, j) == 0 .and. nint(reasons(k)) == reason_left_domain) labels(i, j) = label_left_domain
        if (allocated(origins)) inferred(i, j) = nint(origins(k)) > origin_contradicted
      end do
    end do
  end subroutine read_labels

end module stored_map
