! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What every command that computes shares: the case, the team, the log, the provenance.
module session
  use binding, only: report_binding
  use build_info, only: build_c_flags => c_flags, build_commit => commit, build_compiler => compiler, &
    build_flags => flags, build_mpi => mpi, build_version => version
  use case_echo, only: case_identity
  use case_reader, only: load_case
  use case_type, only: case_t
  use case_warnings, only: warn_about
  use command_line, only: command_t
  use command_table, only: command_number, command_row_t, rows
  use device_choice, only: choose_device, device_text
  use errors, only: error_t, fail
  use files, only: file_exists, give_lock, take_lock
  use h5, only: h5_read_alignment
  use journal, only: journal_t, json_text
  use lane_gpu, only: use_gpu
  use launched_team, only: start_launched_team
  use launcher, only: launched_ranks
  use map_schema, only: schema_t
  use output_check, only: check_create, check_result, check_resume, check_table, working_path
  use parallel, only: start_team
  use provenance, only: provenance_t, start_provenance
  use restoring_law, only: position_is_angle
  use signals, only: ignore_file_limit, install_signals, notice_stop, set_farewell, termination_asked
  use status, only: exit_cannot_create, exit_done, exit_io
  use stop_check, only: limit_time, nothing_kept
  use sketch, only: sketch_of
  use structure_file, only: read_structure_file
  use system, only: exit_program, sleep_microseconds
  use team, only: team_t
  use text, only: to_text
  implicit none
  private

  public :: open_session, describe_file, identity_of

  !> A signal to all ranks reaches them within this time, in microseconds.
  integer, parameter :: signal_spread_us = 20000
  !> Time for the other ranks to end.
  integer, parameter :: farewell_us = 200000

  type, public :: session_t
    type(command_t) :: command
    type(case_t) :: the_case
    class(team_t), allocatable :: team
    type(journal_t) :: journal
    type(provenance_t) :: provenance
    !> A process without others, for which MPI is started only when work begins.
    logical :: alone = .true.
    !> Ranks that compute on a GPU.
    integer :: gpus = 0
    !> Files are being written.
    logical :: writing = .false.
    !> On rank 0 of a run with a working file: its lock, and what holds it.
    character(len=:), allocatable, private :: lock_path
    integer, private :: lock = -1
  contains
    procedure :: begin
    procedure :: end_with
    procedure :: stop_if
    procedure :: abort_if
    procedure :: report_how_to_resume
  end type session_t

contains

  !> Starts the log and reads the case; under mpirun also starts the team. A check alone warns of the case here. Ends the program if
  !> the case is bad.
  subroutine open_session(command, session)
    type(command_t), intent(in) :: command
    type(session_t), intent(out) :: session
    type(command_row_t) :: row
    type(error_t), allocatable :: error
    integer :: bytes
    session%command = command
    session%alone = launched_ranks() == 1
    call start_launched_team(session%team)
    call session%journal%open(session%team%is_root(), command%json, command%quiet, command%progress)
    call session%journal%open_copy(command%log, error)
    call session%stop_if(error)
    row = rows(command_number(command%name))
    if (row%stops_early) call install_signals(error)
    call set_farewell('stopped within one long trajectory; '//nothing_kept)
    if (.not. allocated(error)) call limit_time(session%journal, command%time_limit, error)
    if (.not. allocated(error)) call ignore_file_limit(error)
    if (.not. allocated(error)) call h5_read_alignment(bytes, error)
    if (.not. allocated(error)) call load_case(command%path, command%overrides, session%the_case, error, &
                                                   needs_sweep=command%name == 'sweep', structure_file=read_structure_file)
    call session%stop_if(error)
    if (len(command%draw) > 0) call draw_machine(session)
    if (command%validate) call warn_about(command%name, session%the_case, session%journal)
    if (.not. row%uses_device) return
    ! What computes nothing, or a sample on one core, looks for a GPU only to refuse what would be refused.
    if ((command%validate .or. command%dry_run) .and. command%device /= 'gpu') return
    call choose_device(session%team, command, session%the_case, error)
    call session%stop_if(error)
    if (command%validate .or. command%dry_run) then
      call use_gpu(-1)
      return
    end if
    call device_text(session%team, session%the_case, session%provenance%device, session%gpus)
  end subroutine open_session

  !> Writes the sketch of the machine and ends the program. Code 73 if it cannot be created.
  subroutine draw_machine(session)
    type(session_t), intent(inout) :: session
    type(error_t), allocatable :: error
    integer :: unit, status
    character(len=256) :: reason
    if (session%team%is_root()) then
      call check_result(session%command%draw, session%command%force, error)
      if (.not. allocated(error)) then
        open (newunit=unit, file=session%command%draw, status='replace', action='write', iostat=status, iomsg=reason)
        if (status == 0) write (unit, '(a)', iostat=status, iomsg=reason) sketch_of(session%the_case)
        if (status == 0) close (unit, iostat=status, iomsg=reason)
        if (status /= 0) call fail(error, exit_cannot_create, session%command%draw//': cannot be written: '//trim(reason))
      end if
    end if
    call session%stop_if(error)
    call session%journal%line('written', 'wrote '//session%command%draw)
    call session%end_with(exit_done)
  end subroutine draw_machine

  !> Starts the team for the work that ends in the file `path`, and the record of it. Ends the program if an output
  !> cannot be created. `tiled`: the file is written over a working file.
  subroutine begin(self, path, tiled)
    class(session_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    logical, intent(in) :: tiled
    type(error_t), allocatable :: error
    if (self%team%is_root()) then
      call check_outputs(self%command, path, tiled, error)
      if (tiled) call lock_output(self, working_path(path), error)
    end if
    call self%stop_if(error)
    if (self%alone) call start_team(self%team)
    self%writing = .true.
    associate (record => self%provenance)
      record%version = build_version
      record%commit = build_commit
      record%compiler = build_compiler
      record%flags = build_flags
      record%c_flags = build_c_flags
      record%mpi = build_mpi
      call start_provenance(self%team, record)
    end associate
    call report_binding(self%team, self%journal)
    ! Plain text names the processor only where it was asked for.
    if (allocated(self%provenance%device)) call self%journal%line('device', 'computed by '//self%provenance%device, &
      '"device": '//json_text(self%provenance%device)//', "gpus": '//to_text(self%gpus), &
      plain=self%gpus > 0 .or. self%command%device /= 'auto')
    call warn_about(self%command%name, self%the_case, self%journal)
  end subroutine begin

  !> Takes the lock of the working file `part`. A living run is the reason of its own working file, instead of `error`.
  subroutine lock_output(session, part, error)
    type(session_t), intent(inout) :: session
    character(len=*), intent(in) :: part
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: held
    character(len=:), allocatable :: refusal
    logical :: begun
    begun = file_exists(part)
    if (allocated(error) .and. .not. begun) return
    session%lock_path = part//'.lock'
    call take_lock(session%lock_path, session%lock, refusal, held)
    if (allocated(held)) call move_alloc(held, error)
    if (allocated(refusal) .and. .not. allocated(error)) call session%journal%line('warning', "warning: '"//session%lock_path// &
      "' cannot be locked ("//refusal//'): nothing prevents a second run from writing the same file')
  end subroutine lock_output

  subroutine unlock(session)
    type(session_t), intent(inout) :: session
    if (session%lock >= 0) call give_lock(session%lock_path, session%lock)
    session%lock = -1
  end subroutine unlock

  subroutine check_outputs(command, path, tiled, error)
    type(command_t), intent(in) :: command
    character(len=*), intent(in) :: path
    logical, intent(in) :: tiled
    type(error_t), allocatable, intent(out) :: error
    if (tiled .and. command%resume) then
      call check_resume(path, error)
    else if (tiled) then
      call check_create(path, command%force, error, resumable=command%name /= 'merge')
    else
      call check_result(path, command%force, error)
    end if
    if (.not. allocated(error) .and. len(command%csv) > 0) call check_table(command%csv, command%force, error)
    if (.not. allocated(error) .and. len(command%record) > 0) call check_table(command%record, command%force, error)
    if (.not. allocated(error) .and. len(command%tile_times) > 0) then
      call check_table(command%tile_times, command%force .or. command%resume, error)
    end if
  end subroutine check_outputs

  !> Attributes and texts that every file carries. `inputs` stands for what besides the case decides the results.
  subroutine describe_file(session, kind, schema, inputs)
    type(session_t), intent(in) :: session
    character(len=*), intent(in) :: kind
    character(len=*), intent(in), optional :: inputs
    type(schema_t), intent(inout) :: schema
    character(len=:), allocatable :: identity
    schema%positions_are_angles = position_is_angle(session%the_case%laws)
    call session%provenance%describe(schema)
    call schema%add_attribute('', 'kind', kind)
    call schema%add_attribute('', 'title', session%the_case%title)
    call schema%add_attribute('', 'references', 'docs/theory.md of Separatrix lists equations and sources')
    identity = identity_of(session%the_case, kind)
    if (present(inputs)) identity = identity//' '//inputs
    call schema%add_attribute('provenance', 'case_identity', identity)
    call schema%add_attribute('provenance', 'case_text', session%the_case%raw_text)
    call schema%add_attribute('provenance', 'resolved_case', session%the_case%resolved_text)
  end subroutine describe_file

  !> What decides the results of the command `kind` for a case.
  function identity_of(the_case, kind) result(identity)
    type(case_t), intent(in) :: the_case
    character(len=*), intent(in) :: kind
    character(len=:), allocatable :: identity
    identity = kind//' '//case_identity(the_case, kind)
  end function identity_of

  !> Ends the program on all ranks. Rank 0 returns the code, and as the last: mpirun ends the other processes by force as soon
  !> as one has returned another code than 0. Code 74 where all went well but for the log.
  subroutine end_with(self, code)
    class(session_t), intent(inout) :: self
    integer, intent(in) :: code
    integer :: last
    logical :: first, others
    first = self%team%is_root()
    others = self%team%size() > 1
    last = code
    if (code == exit_done .and. self%journal%lost) then
      last = exit_io
      call self%journal%error('the run is complete, its log is not')
    end if
    call unlock(self)
    call self%team%close()
    if (.not. first) call exit_program(exit_done)
    if (others .and. last /= exit_done) call sleep_microseconds(farewell_us)
    call exit_program(last)
  end subroutine end_with

  !> Ends the program if any rank has an error. Collective.
  subroutine stop_if(self, error)
    class(session_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%team%agree(error)
    if (.not. allocated(error)) return
    ! Not only on the rank that has noticed it: the others may wait longer than their timers.
    call notice_stop()
    call self%journal%error(error%message)
    if (self%writing .and. (error%code == exit_io .or. error%code == exit_cannot_create)) then
      ! HDF5 cannot be shut down after a write of its own has failed. The barrier lets rank 0 speak first.
      call self%team%barrier()
      call unlock(self)
      call self%team%abort(error%code)
    end if
    call self%end_with(error%code)
  end subroutine stop_if

  !> After SIGTERM reports how to resume the run kept in `path`: mpirun ends its processes so when one of them has died, and leaves
  !> them no time for more. Two ranks report, because either may be the dead one.
  subroutine report_how_to_resume(self, path)
    class(session_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(journal_t) :: own
    logical :: asked
    if (self%team%size() == 1 .or. self%team%rank() > 1) return
    call sleep_microseconds(signal_spread_us)
    asked = termination_asked()
    if (.not. asked) return
    own = self%journal
    own%active = .true.
    call own%error('rank '//to_text(self%team%rank())//' was asked to end (SIGTERM); the tiles done are kept in '// &
                   path//'; the same command with --resume (without --force) goes on')
  end subroutine report_how_to_resume

  !> Ends the program at once because of an error of this rank alone.
  subroutine abort_if(self, error)
    class(session_t), intent(inout) :: self
    type(error_t), allocatable, intent(in) :: error
    if (.not. allocated(error)) return
    call notice_stop()
    self%journal%active = .true.
    call self%journal%error(error%message)
    call unlock(self)
    call self%team%abort(error%code)
  end subroutine abort_if

end module session
