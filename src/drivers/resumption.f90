! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What an interrupted run was made from and by, beside what goes on with it.
module resumption
  use case_difference, only: case_differences
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use map_file, only: working_path
  use map_reader, only: open_final, reader_t
  use map_repair, only: restore_length
  use map_schema, only: format_version, schema_t
  use session, only: session_t
  use status, only: exit_other_case
  use text, only: to_text
  implicit none
  private

  public :: inspect_interrupted, read_builder, builder_of

  !> What is kept of the run that began, beside the same of the run that ends.
  character(len=*), parameter :: kept(6) = [character(len=12) :: 'version', 'commit', 'compiler', 'flags', 'c_flags', &
    'command_line']

contains

  !> Looks at the working file of `path` before it is opened: gives a cut file its length back, names the keys in which
  !> the cases differ, and takes over who began the run. Code 76 if the case is another or the file has another version.
  !> Collective.
  subroutine inspect_interrupted(session, path, schema, error)
    type(session_t), intent(inout) :: session
    character(len=*), intent(in) :: path
    type(schema_t), intent(inout) :: schema
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: missing
    if (session%team%is_root()) then
      call restore_length(working_path(path), missing, error)
      if (missing > 0 .and. .not. allocated(error)) call session%journal%line('restored', working_path(path)//' lacked '// &
        to_text(missing)//' bytes at its end; the tiles in them are computed again', '"bytes": '//to_text(missing))
      if (.not. allocated(error)) call compare(session, working_path(path), schema, error)
    end if
    call session%team%agree(error)
  end subroutine inspect_interrupted

  subroutine compare(session, part, schema, error)
    type(session_t), intent(inout) :: session
    character(len=*), intent(in) :: part
    type(schema_t), intent(inout) :: schema
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(reader_t) :: reader
    character(len=:), allocatable :: resolved, keys, identity, version, builder
    real(wp) :: format
    call open_final(part, reader, error)
    if (.not. allocated(error)) call reader%text_attribute('/provenance', 'case_identity', identity, error)
    if (.not. allocated(error)) call reader%text_attribute('/provenance', 'version', version, error)
    if (.not. allocated(error)) call reader%number_attribute('/', 'format_version', format, error)
    if (.not. allocated(error)) call read_builder(reader, builder, error)
    if (.not. allocated(error)) call reader%read_text('/provenance/resolved_case', resolved, error)
    if (allocated(error)) then
      error%message = error%message//'; what describes the run is damaged, --force begins again'
      return
    end if
    keys = case_differences(resolved, session%the_case%resolved_text)
    if (identity /= schema%find_text_attribute('provenance', 'case_identity')) then
      if (keys == '') keys = 'another command or another list'
      call fail(error, exit_other_case, ''''//part//''' belongs to another case ('//keys//'); --force begins again')
    else if (version /= session%provenance%version) then
      call fail(error, exit_other_case, ''''//part//''' was begun by version '//version//', this is '// &
                session%provenance%version//'; --force begins again')
    else if (nint(format) /= format_version) then
      call fail(error, exit_other_case, ''''//part//''' was begun in format version '//to_text(nint(format))// &
                ', this program writes '//to_text(format_version)//': the program that began it finishes it, --force begins again')
    else
      if (keys /= '') call session%journal%line('differs', 'the case differs in what does not matter: '//keys)
      if (builder /= builder_of(session)) call session%journal%line('build', 'begun by another build: '//builder// &
        '; the file keeps both')
      call take_over(reader, schema, error)
    end if
    call reader%close(ignored)
  end subroutine compare

  !> The program that made a file, as `builder_of`.
  subroutine read_builder(reader, builder, error)
    type(reader_t), intent(in) :: reader
    character(len=:), allocatable, intent(out) :: builder
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: commit, compiler, flags, c_flags
    call reader%text_attribute('/provenance', 'commit', commit, error)
    if (.not. allocated(error)) call reader%text_attribute('/provenance', 'compiler', compiler, error)
    if (.not. allocated(error)) call reader%text_attribute('/provenance', 'flags', flags, error)
    if (.not. allocated(error)) call reader%text_attribute('/provenance', 'c_flags', c_flags, error)
    if (.not. allocated(error)) builder = 'commit '//commit//', compiler '//compiler//', flags '//flags//', '//c_flags
  end subroutine read_builder

  !> This program in words: commit, compiler, flags.
  function builder_of(session) result(builder)
    type(session_t), intent(in) :: session
    character(len=:), allocatable :: builder
    associate (record => session%provenance)
      builder = 'commit '//record%commit//', compiler '//record%compiler//', flags '//record%flags//', '//record%c_flags
    end associate
  end function builder_of

  subroutine take_over(reader, schema, error)
    type(reader_t), intent(in) :: reader
    type(schema_t), intent(inout) :: schema
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: text
    integer :: i
    do i = 1, size(kept)
      call reader%text_attribute('/provenance', trim(kept(i)), text, error)
      if (allocated(error)) return
      call schema%add_attribute('provenance', 'begun_'//trim(kept(i)), text)
    end do
    call reader%text_attribute('/', 'history', text, error)
    if (allocated(error)) return
    call schema%add_attribute('', 'history', text//new_line('a')//schema%find_text_attribute('', 'history'))
  end subroutine take_over

end module resumption
