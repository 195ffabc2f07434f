! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the environment of mpirun or srun shows before MPI is started, and without it.
module launcher
  implicit none
  private

  public :: launched_ranks, launched_rank, with_component

contains

  !> The number of processes started together; 1 if there is no sign of others.
  integer function launched_ranks()
    launched_ranks = max(1, number_in([character(len=20) :: 'OMPI_COMM_WORLD_SIZE', 'PMI_SIZE', &
                                       'SLURM_STEP_NUM_TASKS'], 1))
  end function launched_ranks

  !> The number of this process among them, from 0.
  integer function launched_rank()
    launched_rank = 0
    if (launched_ranks() > 1) launched_rank = number_in([character(len=20) :: 'OMPI_COMM_WORLD_RANK', 'PMI_RANK', &
                                                         'SLURM_PROCID'], 0)
  end function launched_rank

  !> OpenMPI's list of `components` of a framework such that `needed` may be chosen; the others keep their precedence. A
  !> list that begins with ^ names those that may not; '' = the default, all of them.
  pure function with_component(components, needed) result(list)
    character(len=*), intent(in) :: components, needed
    character(len=:), allocatable :: list
    integer :: comma
    logical :: excludes
    list = ''
    if (components == '') return
    excludes = components(1:1) == '^'
    list = ','//components(merge(2, 1, excludes):)//','
    comma = index(list, ','//needed//',')
    if (excludes .and. comma > 0) list = list(:comma)//list(comma + len(needed) + 2:)
    if (.not. excludes .and. comma == 0) list = list//needed//','
    list = list(2:len(list) - 1)
    if (excludes .and. len(list) > 0) list = '^'//list
  end function with_component

  !> The first of the environment variables that holds a number.
  integer function number_in(names, default)
    character(len=*), intent(in) :: names(:)
    integer, intent(in) :: default
    character(len=16) :: text
    integer :: i, number, length, status
    number_in = default
    do i = 1, size(names)
      call get_environment_variable(trim(names(i)), text, length, status)
      if (status /= 0 .or. length == 0 .or. verify(trim(text), '0123456789') /= 0) cycle
      read (text, *, iostat=status) number
      if (status /= 0) cycle
      number_in = number
      return
    end do
  end function number_in

end module launcher
