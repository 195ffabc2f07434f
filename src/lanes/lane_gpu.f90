! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Bodies on a GPU, a thread each (`lane_gpu.hpp`): the batches of `lane_types`, many at once, in two halves. While one half flies,
!> the other can be served. What comes out is that of `fly_lanes`, to the bit.
module lane_gpu
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use lane_types, only: lane_batch_t, machine_t, regions_t
  use status, only: exit_resumable
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_int64_t, c_null_char, c_ptr
  implicit none
  private

  public :: gpu_is_built, count_gpus, gpu_number, gpu_name, use_gpu, gpu_in_use, gpu_threads, open_gpu, send_half, await_half, &
    seconds_waited

  integer, parameter :: message_size = 256

  !> One half of the pool.
  type, public :: gpu_half_t
    type(lane_batch_t), pointer :: batches(:) => null()
  end type gpu_half_t

  !> The GPU of this process, -1 = none.
  integer, protected :: gpu_in_use = -1

  !> Threads of this process that serve its bodies.
  integer, protected :: gpu_threads = 1

  interface
    integer(c_int) function separatrix_gpu_built() bind(c)
      import :: c_int
    end function separatrix_gpu_built

    integer(c_int) function separatrix_gpu_count(message, size) bind(c)
      import :: c_char, c_int
      integer(c_int), value :: size
      character(kind=c_char), intent(out) :: message(size)
    end function separatrix_gpu_count

    integer(c_int) function separatrix_gpu_number(index) bind(c)
      import :: c_int
      integer(c_int), value :: index
    end function separatrix_gpu_number

    subroutine separatrix_gpu_name(device, text, size) bind(c)
      import :: c_char, c_int
      integer(c_int), value :: device, size
      character(kind=c_char), intent(out) :: text(size)
    end subroutine separatrix_gpu_name

    integer(c_int) function separatrix_gpu_open(device, wanted, halves, batches, message, size) bind(c)
      import :: c_char, c_int, c_int64_t, c_ptr
      integer(c_int), value :: device, size
      integer(c_int64_t), value :: wanted
      type(c_ptr), intent(out) :: halves(2)
      integer(c_int64_t), intent(out) :: batches
      character(kind=c_char), intent(inout) :: message(size)
    end function separatrix_gpu_open

    integer(c_int) function separatrix_gpu_send(half, batches, machine, regions, message, size) bind(c)
      import :: c_char, c_int, c_int64_t, machine_t, regions_t
      integer(c_int), value :: half, size
      integer(c_int64_t), value :: batches
      type(machine_t), intent(in) :: machine
      type(regions_t), intent(in) :: regions
      character(kind=c_char), intent(inout) :: message(size)
    end function separatrix_gpu_send

    integer(c_int) function separatrix_gpu_wait(half, message, size) bind(c)
      import :: c_char, c_int
      integer(c_int), value :: half, size
      character(kind=c_char), intent(inout) :: message(size)
    end function separatrix_gpu_wait

    real(c_double) function separatrix_gpu_waited() bind(c)
      import :: c_double
    end function separatrix_gpu_waited
  end interface

contains

  !> Whether this build can use a GPU.
  logical function gpu_is_built()
    gpu_is_built = separatrix_gpu_built() /= 0
  end function gpu_is_built

  !> GPUs that this process sees and has code for; `why`: what CUDA reports where it sees none.
  subroutine count_gpus(number, why)
    integer, intent(out) :: number
    character(len=:), allocatable, intent(out) :: why
    character(kind=c_char) :: message(message_size)
    number = separatrix_gpu_count(message, int(message_size, c_int))
    why = text_of(message)
  end subroutine count_gpus

  !> The number that CUDA gives to the GPU at `index` of those counted, from 0; the others take it.
  integer function gpu_number(index)
    integer, intent(in) :: index
    gpu_number = separatrix_gpu_number(int(index, c_int))
  end function gpu_number

  !> What its maker calls a GPU.
  function gpu_name(device) result(name)
    integer, intent(in) :: device
    character(len=:), allocatable :: name
    character(kind=c_char) :: text(message_size)
    call separatrix_gpu_name(int(device, c_int), text, int(message_size, c_int))
    name = text_of(text)
  end function gpu_name

  !> From here on machines are made ready for this GPU, or with -1 for the processor's vectors; so many `threads` serve it.
  subroutine use_gpu(device, threads)
    integer, intent(in) :: device
    integer, intent(in), optional :: threads
    gpu_in_use = device
    if (present(threads)) gpu_threads = max(1, threads)
  end subroutine use_gpu

  !> Both halves of the pool, of as many batches as are `wanted`, or as the GPU has room for. Code 75 if it fails, here and
  !> below: what was computed before stays.
  subroutine open_gpu(device, wanted, halves, error)
    integer, intent(in) :: device, wanted
    type(gpu_half_t), intent(out) :: halves(2)
    type(error_t), allocatable, intent(out) :: error
    character(kind=c_char) :: message(message_size)
    type(c_ptr) :: pointers(2)
    integer(c_int64_t) :: batches
    integer :: i
    if (separatrix_gpu_open(int(device, c_int), int(wanted, c_int64_t), pointers, batches, message, &
                            int(message_size, c_int)) /= 0) then
      call fail(error, exit_resumable, text_of(message))
      return
    end if
    do i = 1, 2
      call c_f_pointer(pointers(i), halves(i)%batches, [int(batches, int64)])
    end do
  end subroutine open_gpu

  !> Sends the first `batches` of half 1 or 2 to fly. They are not to be touched until they are awaited.
  subroutine send_half(half, batches, machine, regions, error)
    integer, intent(in) :: half, batches
    type(machine_t), intent(in) :: machine
    type(regions_t), intent(in) :: regions
    type(error_t), allocatable, intent(out) :: error
    character(kind=c_char) :: message(message_size)
    if (separatrix_gpu_send(int(half - 1, c_int), int(batches, c_int64_t), machine, regions, message, &
                            int(message_size, c_int)) /= 0) call fail(error, exit_resumable, text_of(message))
  end subroutine send_half

  !> Waits until a half has been flown.
  subroutine await_half(half, error)
    integer, intent(in) :: half
    type(error_t), allocatable, intent(out) :: error
    character(kind=c_char) :: message(message_size)
    if (separatrix_gpu_wait(int(half - 1, c_int), message, int(message_size, c_int)) /= 0) then
      call fail(error, exit_resumable, text_of(message))
    end if
  end subroutine await_half

  !> How long this process has waited for its GPU so far [s].
  real(wp) function seconds_waited()
    seconds_waited = separatrix_gpu_waited()
  end function seconds_waited

  pure function text_of(message) result(text)
    character(kind=c_char), intent(in) :: message(message_size)
    character(len=:), allocatable :: text
    integer :: length, i
    length = findloc(message, c_null_char, dim=1) - 1
    allocate (character(len=length) :: text)
    do i = 1, length
      text(i:i) = message(i)
    end do
  end function text_of

end module lane_gpu
