! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What every command that computes shares: the case, the team, the log, the provenance.
module session
  use build_info, only: build_commit => commit, build_compiler => compiler, build_flags => flags, &
    build_mpi => mpi, build_version => version
  use case_echo, only: case_identity
  use case_reader, only: load_case
  use case_type, only: case_t
  use command_line, only: command_t
  use errors, only: error_t
  use journal, only: journal_t
  use map_schema, only: schema_t
  use parallel, only: start_team
  use provenance, only: provenance_t, start_provenance
  use signals, only: install_signals
  use system, only: exit_program
  use team, only: team_t
  implicit none
  private

  public :: open_session, describe_file

  type, public :: session_t
    type(command_t) :: command
    type(case_t) :: the_case
    class(team_t), allocatable :: team
    type(journal_t) :: journal
    type(provenance_t) :: provenance
  contains
    procedure :: end_with
    procedure :: stop_if
    procedure :: abort_if
  end type session_t

contains

  !> Starts the team and the log and reads the case. Ends the program if the case is bad.
  subroutine open_session(command, session)
    type(command_t), intent(in) :: command
    type(session_t), intent(out) :: session
    type(error_t), allocatable :: error
    session%command = command
    call start_team(session%team)
    call session%journal%open(session%team%is_root(), command%json, command%quiet)
    call install_signals(error)
    if (.not. allocated(error)) call load_case(command%path, command%overrides, session%the_case, error)
    call session%stop_if(error)
    associate (record => session%provenance)
      record%version = build_version
      record%commit = build_commit
      record%compiler = build_compiler
      record%flags = build_flags
      record%mpi = build_mpi
      call start_provenance(session%team, record)
    end associate
  end subroutine open_session

  !> Attributes and texts that every file carries.
  subroutine describe_file(session, kind, schema)
    type(session_t), intent(in) :: session
    character(len=*), intent(in) :: kind
    type(schema_t), intent(inout) :: schema
    call session%provenance%describe(schema)
    call schema%add_attribute('', 'kind', kind)
    call schema%add_attribute('', 'title', session%the_case%title)
    call schema%add_attribute('', 'references', 'docs/theory.md of Separatrix lists equations and sources')
    call schema%add_attribute('provenance', 'case_identity', kind//' '//case_identity(session%the_case))
    call schema%add_text('provenance', 'case_text', session%the_case%raw_text)
    call schema%add_text('provenance', 'resolved_case', session%the_case%resolved_text)
  end subroutine describe_file

  !> Ends the program on all ranks alike.
  subroutine end_with(self, code)
    class(session_t), intent(inout) :: self
    integer, intent(in) :: code
    call self%team%close()
    call exit_program(code)
  end subroutine end_with

  !> Ends the program if any rank has an error. Collective.
  subroutine stop_if(self, error)
    class(session_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%team%agree(error)
    if (.not. allocated(error)) return
    call self%journal%error(error%message)
    call self%end_with(error%code)
  end subroutine stop_if

  !> Ends the program at once because of an error of this rank alone.
  subroutine abort_if(self, error)
    class(session_t), intent(inout) :: self
    type(error_t), allocatable, intent(in) :: error
    if (.not. allocated(error)) return
    self%journal%active = .true.
    call self%journal%error(error%message)
    call self%team%abort(error%code)
  end subroutine abort_if

end module session
