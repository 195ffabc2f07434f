! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Computes a grid tile by tile on a team: working file, resumption, hand-out, progress, clean stop, final file.
module tiled_run
  use balance, only: report_balance
  use device_choice, only: report_trial
  use errors, only: error_t
  use files, only: file_exists
  use journal, only: duration_text
  use kinds, only: int64, wp
  use lane_gpu, only: seconds_waited
  use last_wait, only: last_wait_t
  use map_file, only: create_working, map_file_t, open_working, working_path
  use map_final, only: finalise
  use map_reader, only: open_final, reader_t
  use map_schema, only: schema_t
  use parallel, only: make_scheduler
  use point_work, only: compute_list, point_work_t, watch_t
  use refined_tile, only: refine_tile
  use resumption, only: inspect_interrupted
  use scheduler, only: scheduler_options_t, scheduler_t
  use session, only: session_t
  use shard, only: in_shard
  use spread_order, only: new_spread_order, spread_order_t
  use signals, only: end_time_limit, notice_stop, set_farewell
  use status, only: exit_resumable
  use system, only: monotonic_seconds
  use text, only: to_text
  use tile_times, only: write_tile_times
  use written_check, only: check_written
  implicit none
  private

  public :: point_work_t
  public :: open_tiles, run_tiles, finish_tiles, index_in_block

  !> Seconds between two looks at the name of the working file.
  real(wp), parameter :: check_interval = 10

  !> Checks for signals and the time limit between pieces of a tile, and reports how far the run is.
  type, extends(watch_t) :: tile_watch_t
    class(scheduler_t), pointer :: scheduler => null()
    type(session_t), pointer :: session => null()
    type(map_file_t), pointer :: file => null()
    !> When the name of the file was last looked up [s].
    real(wp) :: last_check = 0
    !> Points of the map, those done before this run, and the tiles that this run has to do.
    integer(int64) :: total = 0, before = 0
    integer :: unfinished = 0
  contains
    procedure :: look => look_at_run
  end type tile_watch_t

contains

  !> Opens the working file: with --resume that of the interrupted run if there is one, else a new one. Ends the program
  !> on errors. `open_shape`: the tiles of an interrupted run may have another shape, which is kept.
  subroutine open_tiles(session, path, schema, grid, tile_shape, file, open_shape)
    type(session_t), intent(inout) :: session
    character(len=*), intent(in) :: path
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: grid(:)
    integer, intent(in) :: tile_shape(:)
    type(map_file_t), intent(out) :: file
    logical, intent(in), optional :: open_shape
    type(error_t), allocatable :: error
    integer(int64) :: shape_of_tiles(size(tile_shape))
    integer :: found
    ! A rank that dies takes the others with it, perhaps before they can report this.
    if (session%team%size() > 1) call session%journal%line('kept', 'the tiles done are kept in '//working_path(path)// &
      '; after an interruption the same command with --resume (without --force) goes on')
    ! Rank 0 decides, before it creates what the others would see.
    shape_of_tiles = tile_shape
    found = 0
    if (file_exists(working_path(path))) found = 1
    call session%team%broadcast(found)
    if (session%command%resume .and. found == 1) then
      call inspect_interrupted(session, path, schema, error)
      call session%stop_if(error)
      if (present(open_shape)) then
        if (open_shape .and. session%team%is_root()) call read_tile_shape(working_path(path), shape_of_tiles, error)
        call session%stop_if(error)
        call session%team%broadcast_integers(shape_of_tiles)
      end if
      call open_working(path, schema, grid, shape_of_tiles, session%team, file, error)
    else
      call create_working(path, schema, grid, shape_of_tiles, session%command%force, session%team, file, error)
    end if
    call session%stop_if(error)
    call set_farewell('stopped within one long trajectory; the tiles done are kept in '//working_path(path)// &
                      '; the same command with --resume (without --force) goes on')
  end subroutine open_tiles

  !> The shape of the tiles of an interrupted run, if it has as many axes.
  subroutine read_tile_shape(part, tile_shape, error)
    character(len=*), intent(in) :: part
    integer(int64), intent(inout) :: tile_shape(:)
    type(error_t), allocatable, intent(out) :: error
    type(reader_t) :: reader
    real(wp), allocatable :: found(:)
    call open_final(part, reader, error)
    if (.not. allocated(error)) call reader%read_values('/tiles/tile_shape', found, error)
    if (.not. allocated(error)) call reader%close(error)
    if (allocated(error)) return
    if (size(found) == size(tile_shape)) tile_shape = nint(found, int64)
  end subroutine read_tile_shape

  !> Computes every tile that is not yet done. `complete` is false after a stop.
  subroutine run_tiles(session, file, work, complete)
    type(session_t), intent(inout), target :: session
    type(map_file_t), intent(inout), target :: file
    class(point_work_t), intent(inout) :: work
    logical, intent(out) :: complete
    class(scheduler_t), allocatable, target :: scheduler
    type(tile_watch_t) :: watch
    type(last_wait_t) :: last_wait
    type(error_t), allocatable :: error
    integer, allocatable :: mine(:), unfinished(:)
    integer(int64) :: computed(1)
    real(wp) :: busy, waited, begun
    integer :: tile, position
    logical :: whole
    mine = pack([(tile, tile=1, file%tile_count())], &
                [(in_shard(tile, session%command%shard, session%command%shard_count), tile=1, file%tile_count())])
    unfinished = in_order_of_file(file, pack(mine, [(.not. file%tile_done(mine(tile)), tile=1, size(mine))]))
    watch%total = sum([(file%tiling%points(mine(tile)), tile=1, size(mine))])
    watch%before = note_earlier(session, file, work)
    watch%unfinished = size(unfinished)
    if (session%command%resume .and. .not. work%again) call session%journal%line('resumed', &
      to_text(size(mine) - size(unfinished))//' of '//to_text(size(mine))//' tiles were done before')
    call last_wait%begin(working_path(file%path), work%again, session%team)
    call make_scheduler(session%team, scheduler_options_t(time_left(session), session%command%ranks_per_node, &
                        len(session%command%tile_times) > 0), scheduler, error)
    if (.not. allocated(error)) call scheduler%start(size(unfinished), error)
    call session%stop_if(error)
    watch%scheduler => scheduler
    watch%session => session
    watch%file => file
    watch%last_check = monotonic_seconds()
    computed = 0
    busy = 0
    waited = seconds_waited()
    call session%journal%begin('points', watch%total, watch%before)
    do
      call scheduler%next(position)
      if (position == 0) exit
      begun = monotonic_seconds()
      call run_tile(session, file, work, unfinished(position), watch, whole)
      busy = busy + (monotonic_seconds() - begun)
      if (.not. whole) exit
      computed = computed + 1
    end do
    call end_time_limit()
    if (scheduler%stop_requested()) call notice_stop()
    call file%flush(error)
    call session%abort_if(error)
    if (scheduler%stop_requested()) call session%report_how_to_resume(working_path(file%path))
    call last_wait%wait(session%team, scheduler, file%store, unfinished, error)
    call session%abort_if(error)
    begun = scheduler%started
    call scheduler%finish()
    call write_tile_times(session, scheduler, unfinished)
    call report_balance(session%team, session%journal, busy, seconds_waited() - waited, monotonic_seconds() - begun, &
                        session%gpus)
    call report_trial(session%team, session%journal)
    call session%team%sum(computed)
    complete = computed(1) == size(unfinished)
  end subroutine run_tiles

  !> Tiles as a list that the scheduler hands out in the order in which they lie in the file.
  pure function in_order_of_file(file, tiles) result(list)
    type(map_file_t), intent(in) :: file
    integer, intent(in) :: tiles(:)
    integer :: list(size(tiles)), slot, tile, number
    logical :: wanted(file%tile_count())
    type(spread_order_t) :: order
    order = new_spread_order(size(tiles))
    wanted = .false.
    wanted(tiles) = .true.
    number = 0
    do slot = 1, file%tile_count()
      tile = file%store%order%tile_at(slot)
      if (.not. wanted(tile)) cycle
      number = number + 1
      list(order%item(number)) = tile
    end do
  end function in_order_of_file

  !> What the start, the catalogue and the sweep have left of the time limit; 0 = no limit.
  real(wp) function time_left(session)
    type(session_t), intent(in) :: session
    time_left = session%command%time_limit
    if (time_left > 0) time_left = max(tiny(time_left), time_left - (monotonic_seconds() - session%journal%started))
  end function time_left

  !> One tile; left unwritten if a stop is requested on the way.
  subroutine run_tile(session, file, work, tile, watch, whole)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    class(point_work_t), intent(inout) :: work
    integer, intent(in) :: tile
    type(tile_watch_t), intent(inout) :: watch
    logical, intent(out) :: whole
    type(error_t), allocatable :: error
    real(wp), allocatable :: values(:, :)
    integer, allocatable :: index(:, :)
    integer :: point, points
    integer(int64) :: lower(size(file%tiling%lengths)), extent(size(file%tiling%lengths))
    call file%tiling%block_of(tile, lower, extent)
    points = int(product(extent))
    allocate (index(size(lower), points))
    do point = 1, points
      index(:, point) = index_in_block(lower, extent, point)
    end do
    if (work%again .and. .not. work%refine%active) then
      call compute_again(file, work, tile, index, values, watch, whole, error)
    else if (work%refine%active) then
      allocate (values(points, work%marks + 1))
      call refine_tile(work, int(file%tiling%lengths), int(lower), int(extent), values, whole, error, watch)
    else
      allocate (values(points, work%variables))
      call compute_list(work, index, values, whole, error, watch)
    end if
    if (allocated(error)) then
      if (error%code == exit_resumable) error%message = error%message//'; the tiles done are kept in '// &
        working_path(file%path)//'; the same command with --resume (without --force) goes on, with --device cpu without a GPU'
    end if
    call session%abort_if(error)
    if (.not. whole) return
    call file%write_tile(tile, values, error)
    call session%abort_if(error)
    session%journal%written = session%journal%written + file%tile_bytes(tile)
    do point = 1, points
      call work%note(index(:, point), values(point, :))
    end do
  end subroutine run_tile

  !> The values of a tile that was done, with those points computed again that do not stand.
  subroutine compute_again(file, work, tile, index, values, watch, whole, error)
    type(map_file_t), intent(inout) :: file
    class(point_work_t), intent(inout) :: work
    integer, intent(in) :: tile, index(:, :)
    real(wp), allocatable, intent(out) :: values(:, :)
    type(tile_watch_t), intent(inout) :: watch
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: new(:, :)
    integer, allocatable :: left(:)
    integer :: i
    call file%read_tile(tile, values, error)
    if (allocated(error)) return
    left = pack([(i, i=1, size(values, 1))], [(.not. work%stands(values(i, :)), i=1, size(values, 1))])
    allocate (new(size(left), work%variables))
    call compute_list(work, index(:, left), new, whole, error, watch)
    if (allocated(error)) return
    if (whole) values(left, :) = new
  end subroutine compute_again

  subroutine look_at_run(self, stop_now)
    class(tile_watch_t), intent(inout) :: self
    logical, intent(out) :: stop_now
    type(error_t), allocatable :: error
    real(wp) :: now
    call self%scheduler%poll()
    call self%file%flush(error, only_due=.true.)
    call self%session%abort_if(error)
    now = monotonic_seconds()
    if (self%session%team%is_root() .and. now - self%last_check > check_interval) then
      self%last_check = now
      call self%file%check(error)
      call self%session%abort_if(error)
    end if
    stop_now = self%scheduler%stop_requested()
    if (stop_now .or. .not. self%session%journal%active) return
    call self%session%journal%progress(self%before + nint(real(self%total - self%before, wp) &
      *self%scheduler%done_count()/max(self%unfinished, 1), int64))
  end subroutine look_at_run

  !> Counts the points of tiles that an interrupted run had done, shared among the ranks; returns their number.
  integer(int64) function note_earlier(session, file, work) result(points)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    class(point_work_t), intent(inout) :: work
    type(error_t), allocatable :: error
    real(wp), allocatable :: values(:, :)
    integer(int64) :: lower(size(file%tiling%lengths)), extent(size(file%tiling%lengths))
    integer :: tile, seen, point
    points = 0
    seen = 0
    do tile = 1, file%tile_count()
      if (.not. file%tile_done(tile)) cycle
      call file%tiling%block_of(tile, lower, extent)
      points = points + product(extent)
      seen = seen + 1
      if (modulo(seen, session%team%size()) /= session%team%rank()) cycle
      call file%read_tile(tile, values, error)
      call session%abort_if(error)
      do point = 1, size(values, 1)
        call work%note(index_in_block(lower, extent, point), values(point, :))
      end do
    end do
  end function note_earlier

  !> Index (from 1 along each axis) of a point of a block, last axis fastest.
  pure function index_in_block(lower, extent, point) result(index)
    integer(int64), intent(in) :: lower(:), extent(:)
    integer, intent(in) :: point
    integer :: index(size(lower)), rest, i
    rest = point - 1
    do i = size(lower), 1, -1
      index(i) = int(lower(i)) + modulo(rest, int(extent(i))) + 1
      rest = rest/int(extent(i))
    end do
  end function index_in_block

  !> The final file, or after a stop the word how to go on and code 75.
  subroutine finish_tiles(session, file, complete, extra)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    logical, intent(in) :: complete
    type(schema_t), intent(inout) :: extra
    type(error_t), allocatable :: error
    real(wp) :: begun, alone
    call end_time_limit()
    if (.not. complete) then
      call file%close(session%team, error)
      call session%stop_if(error)
      call session%journal%line('stopped', 'stopped early; the tiles done are kept in '// &
        working_path(file%path)//'; the same command with --resume (without --force) goes on')
      call session%end_with(exit_resumable)
    end if
    call session%provenance%finish(extra)
    begun = monotonic_seconds()
    call finalise(file, session%team, extra, error, alone)
    call session%stop_if(error)
    if (session%team%size() > 1) call session%journal%line('packed', 'checked and packed in '// &
      duration_text(monotonic_seconds() - begun)//', '//duration_text(alone)//' of it by rank 0 alone')
    call check_written(session, file%path)
    call session%journal%line('written', 'wrote '//file%path//' in '// &
      duration_text(monotonic_seconds() - session%journal%started))
  end subroutine finish_tiles

end module tiled_run
