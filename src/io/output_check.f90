! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether an output can be created, asked before any work is done for it.
module output_check
  use errors, only: error_t, fail
  use files, only: check_folder, file_exists, is_special
  use status, only: exit_cannot_create
  implicit none
  private

  public :: check_result, check_table, check_create, check_resume, working_path, is_folder

contains

  !> Code 73 if `path` is a folder, exists and is not to be replaced, or its folder is missing or not writable.
  subroutine check_output(path, replace, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: replace
    type(error_t), allocatable, intent(out) :: error
    if (is_folder(path)) then
      call fail(error, exit_cannot_create, "cannot create '"//path//"': it is a folder")
    else if (file_exists(path) .and. .not. replace) then
      call fail(error, exit_cannot_create, "'"//path//"' exists; --force replaces it")
    else
      call check_folder(path, error)
    end if
  end subroutine check_output

  !> The same for a result file, which replaces what has its name: that must be a regular file.
  subroutine check_result(path, replace, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: replace
    type(error_t), allocatable, intent(out) :: error
    call check_regular(path, error)
    if (.not. allocated(error)) call check_output(path, replace, error)
  end subroutine check_result

  !> Code 73 if there is something else than a regular file.
  subroutine check_regular(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    if (is_folder(path)) then
      call fail(error, exit_cannot_create, "cannot create '"//path//"': it is a folder")
    else if (is_special(path)) then
      call fail(error, exit_cannot_create, "cannot create '"//path//"': it is not a regular file")
    end if
  end subroutine check_regular

  !> The same for a table, which is written in place.
  subroutine check_table(path, replace, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: replace
    type(error_t), allocatable, intent(out) :: error
    integer :: unit, status
    character(len=256) :: message
    call check_output(path, replace, error)
    if (allocated(error)) return
    if (.not. file_exists(path)) return
    open (newunit=unit, file=path, status='old', action='write', position='append', iostat=status, iomsg=message)
    if (status == 0) then
      close (unit)
    else
      call fail(error, exit_cannot_create, "cannot write '"//path//"': "//trim(message))
    end if
  end subroutine check_table

  !> Code 73 unless the working file of `path` and then `path` can be created; without `force` neither may exist.
  !> `resumable`: the command has --resume, which is the default.
  subroutine check_create(path, force, error, resumable)
    character(len=*), intent(in) :: path
    logical, intent(in) :: force
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: resumable
    character(len=:), allocatable :: advice
    advice = '--resume continues it, --force begins again'
    if (present(resumable)) then
      if (.not. resumable) advice = '--force begins again'
    end if
    call check_result(path, force, error)
    if (allocated(error)) return
    call check_regular(working_path(path), error)
    if (allocated(error) .or. force) return
    if (file_exists(working_path(path))) call fail(error, exit_cannot_create, ''''//working_path(path)// &
      ''' of an interrupted run exists; '//advice)
  end subroutine check_create

  !> Code 73 unless the working file of `path` can be written, and then `path`. Without a working file to go on with a run
  !> begins anew.
  subroutine check_resume(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    if (.not. file_exists(working_path(path))) then
      call check_result(path, .false., error)
      return
    end if
    call check_regular(working_path(path), error)
    if (.not. allocated(error)) call check_table(working_path(path), .true., error)
  end subroutine check_resume

  !> The name of the working file of the final file `path`.
  pure function working_path(path) result(part)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: part
    part = path//'.part'
  end function working_path

  !> Whether the path is a folder.
  logical function is_folder(path)
    character(len=*), intent(in) :: path
    inquire (file=path//'/.', exist=is_folder)
  end function is_folder

end module output_check
