! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The results of a long work part by part, kept in its working file in the order in which they are found: after an interruption
!> the same work takes them from there. What a part is must not depend on the number of ranks.
module checkpoint
  use byte_file, only: byte_file_t
  use checksum, only: crc32, crc32_text
  use errors, only: error_t, fail
  use files, only: file_exists, remove_file
  use kinds, only: int64, int8, wp
  use output_check, only: check_result, working_path
  use session, only: session_t
  use signals, only: set_farewell
  use status, only: exit_cannot_create, exit_other_case
  use stop_check, only: check_stop
  use text, only: to_text
  implicit none
  private

  !> A record is the number of its values, their checksum, and the values, all of eight bytes. The first has the mark and the
  !> checksum of what decides the work.
  integer, parameter :: word = 8, head = 2*word
  integer(int64), parameter :: mark = int(z'5345504152415458', int64)

  type, public :: checkpoint_t
    !> What goes on after an interruption, in words.
    character(len=:), allocatable :: doing
    !> Parts that were taken from the file.
    integer :: recalled = 0
    !> The working file of an earlier run was taken up: it was allowed to replace a result that was there. On rank 0.
    logical :: taken_up = .false.
    character(len=:), allocatable, private :: path
    type(byte_file_t), private :: file
    integer(int64), private :: offset = 0
    logical, private :: reading = .false.
  contains
    procedure :: open => open_checkpoint
    procedure :: recall
    procedure :: keep
    procedure :: remove => remove_checkpoint
  end type checkpoint_t

contains

  !> Opens the working file of the result `path`: with --resume the one that is there, else a new one. `identity` decides the
  !> work. Code 76 if the file is of another one, 73 if it is damaged from its beginning and the result is there. Collective.
  subroutine open_checkpoint(self, session, path, identity, doing, error)
    class(checkpoint_t), intent(inout) :: self
    class(session_t), intent(inout) :: session
    character(len=*), intent(in) :: path, identity, doing
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: first(2)
    self%doing = doing
    self%path = working_path(path)
    if (session%team%is_root()) then
      self%reading = session%command%resume
      if (self%reading) self%reading = file_exists(self%path)
      if (.not. self%reading) call make_empty(self%path, error)
      if (.not. allocated(error)) call self%file%open(self%path, .true., error)
      if (self%reading .and. .not. allocated(error)) then
        call read_words(self%file, 0_int64, first, self%reading)
        if (first(1) /= mark) self%reading = .false.
        if (.not. self%reading) then
          call session%journal%line('damaged', "'"//self%path//"' is damaged from its beginning: nothing of it is used")
          call check_result(path, .false., error)
          ! Whole parts behind the damage may be of other work.
          if (.not. allocated(error)) call self%file%close(error)
          if (.not. allocated(error)) call make_empty(self%path, error)
          if (.not. allocated(error)) call self%file%open(self%path, .true., error)
        else if (first(2) /= crc32_text(identity, 0_int64)) then
          call fail(error, exit_other_case, "'"//self%path//"' belongs to another map, other options or another version; "// &
                    '--force begins again')
        end if
      end if
      self%taken_up = self%reading
      first = [mark, crc32_text(identity, 0_int64)]
      if (.not. allocated(error) .and. .not. self%reading) call self%file%write(transfer(first, [0_int8]), 0_int64, error)
      self%offset = head
    end if
    call set_farewell('stopped within one long trajectory; the parts done are kept in '//self%path// &
                      '; the same command with --resume goes on')
    call session%team%agree(error)
  end subroutine open_checkpoint

  !> The values of the next part if the file has them. Collective.
  subroutine recall(self, session, values, found)
    class(checkpoint_t), intent(inout) :: self
    class(session_t), intent(inout) :: session
    real(wp), allocatable, intent(out) :: values(:)
    logical, intent(out) :: found
    real(wp), allocatable :: own(:)
    logical :: sound
    integer(int64) :: bytes_on_disk
    allocate (own(0))
    sound = .false.
    if (self%reading) then
      call read_part(self, own, sound)
      inquire (file=self%path, size=bytes_on_disk)
      if (.not. sound .and. bytes_on_disk > self%offset) call session%journal%line('damaged', "'"//self%path// &
        "' is damaged behind "//to_text(self%recalled)//' sound parts: what follows is computed again')
    end if
    self%reading = sound
    found = session%team%any(self%reading)
    if (.not. found) return
    self%recalled = self%recalled + 1
    call session%team%allgather(own, values)
  end subroutine recall

  !> Keeps the values of a part that was computed, the same on all ranks. Ends the program with code 75 if it is to stop.
  subroutine keep(self, session, values)
    class(checkpoint_t), intent(inout) :: self
    class(session_t), intent(inout) :: session
    real(wp), intent(in) :: values(:)
    type(error_t), allocatable :: error
    integer(int8), allocatable :: bytes(:)
    if (session%team%is_root()) then
      bytes = transfer(values, [0_int8])
      call self%file%write([transfer([size(values, kind=int64), crc32(bytes, 0_int64)], [0_int8]), bytes], self%offset, error)
      self%offset = self%offset + head + size(bytes)
    end if
    call session%stop_if(error)
    call check_stop(session%journal, session%command%time_limit, self%doing, error, resumable=.true.)
    call session%stop_if(error)
  end subroutine keep

  !> Closes and removes the file, when the result is there.
  subroutine remove_checkpoint(self, error)
    class(checkpoint_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    call self%file%close(error)
    if (.not. allocated(error)) call remove_file(self%path, error)
  end subroutine remove_checkpoint

  !> The part at the offset of the file, which moves on; `found` is false behind the last sound one.
  subroutine read_part(self, values, found)
    class(checkpoint_t), intent(inout) :: self
    real(wp), allocatable, intent(inout) :: values(:)
    logical, intent(out) :: found
    integer(int64) :: first(2), bytes_on_disk
    integer(int8), allocatable :: bytes(:)
    type(error_t), allocatable :: error
    call read_words(self%file, self%offset, first, found)
    if (.not. found) return
    inquire (file=self%path, size=bytes_on_disk)
    found = first(1) >= 0 .and. first(1) <= (bytes_on_disk - self%offset - head)/word
    if (.not. found) return
    allocate (bytes(word*first(1)))
    call self%file%read(bytes, self%offset + head, error)
    found = .not. allocated(error)
    if (found) found = crc32(bytes, 0_int64) == first(2)
    if (.not. found) return
    values = transfer(bytes, values, int(first(1)))
    self%offset = self%offset + head + size(bytes)
  end subroutine read_part

  subroutine read_words(file, offset, words, found)
    type(byte_file_t), intent(in) :: file
    integer(int64), intent(in) :: offset
    integer(int64), intent(out) :: words(2)
    logical, intent(out) :: found
    integer(int8) :: bytes(head)
    type(error_t), allocatable :: error
    call file%read(bytes, offset, error)
    found = .not. allocated(error)
    words = 0
    if (found) words = transfer(bytes, words)
  end subroutine read_words

  subroutine make_empty(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    character(len=256) :: reason
    integer :: unit, status
    open (newunit=unit, file=path, status='replace', action='write', access='stream', iostat=status, iomsg=reason)
    if (status == 0) close (unit, iostat=status, iomsg=reason)
    if (status /= 0) call fail(error, exit_cannot_create, "cannot create '"//path//"': "//trim(reason))
  end subroutine make_empty

end module checkpoint
