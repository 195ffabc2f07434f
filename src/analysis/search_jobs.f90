! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The two parts of a search for branches that take its time: orbits at one value, and a branch one way. Neither depends on what
!> else was found, so other processes can do them, and the result is the same. The first process decides what is done.
module search_jobs
  use branch, only: join_ways, trace_branch, trace_one_way
  use branch_point, only: branch_t, point_t
  use errors, only: error_t
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use orbit_numbers, only: numbers_t
  use orbit_search, only: find_orbits, found_t
  use periodic_orbit, only: orbit_t
  use orbit_directions, only: depends_on_parameter
  use search_state, only: search_t, traced_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: search_values, trace, serve, dismiss

  integer, parameter :: search_at = 1, follow_way = 2

  !> Of a search the number of the value; of a branch its seed, and the way.
  type :: job_t
    integer :: kind = 0, number = 0
    type(orbit_t) :: seed
  end type job_t

contains

  !> Searches orbits at every value.
  subroutine search_values(search)
    type(search_t), intent(inout) :: search
    type(numbers_t), allocatable :: results(:)
    type(job_t) :: jobs(size(search%values))
    logical :: depends
    integer :: i, flag
    if (.not. has_workers(search)) then
      do i = 1, size(jobs)
        call search_value(search, i, search%found(i), depends)
        search%depends = search%depends .or. depends
      end do
      return
    end if
    do i = 1, size(jobs)
      jobs(i)%kind = search_at
      jobs(i)%number = i
    end do
    call share(search, jobs, results)
    do i = 1, size(jobs)
      call results(i)%take_found(search%found(i))
      call results(i)%take_integer(flag)
      search%depends = search%depends .or. flag == 1
    end do
  end subroutine search_values

  !> The branch through a seed. Other processes follow one way of it, and the seeds that are expected next.
  subroutine trace(search, seed, found)
    type(search_t), intent(inout) :: search
    type(orbit_t), intent(in) :: seed
    type(branch_t), intent(out) :: found
    type(traced_t) :: next
    type(job_t), allocatable :: jobs(:)
    type(numbers_t), allocatable :: results(:)
    integer :: i
    if (.not. has_workers(search)) then
      call trace_branch(search%family, search%plan, seed, found, search%watcher)
      return
    end if
    if (.not. allocated(search%traced)) allocate (search%traced(0))
    if (is_traced(search, seed, found)) return
    call add_ways(jobs, seed)
    do i = 1, size(search%expected)
      if (size(jobs) + 2 > search%workers%count()) exit
      if (.not. is_traced(search, search%expected(i), found)) call add_ways(jobs, search%expected(i))
    end do
    call share(search, jobs, results)
    do i = 3, size(jobs), 2
      next%seed = jobs(i)%seed
      call take_branch(search, results(i:i + 1), next%branch)
      search%traced = [search%traced, next]
    end do
    call take_branch(search, results(:2), found)
  end subroutine trace

  !> Does what the first process asks for, until it calls `dismiss`.
  subroutine serve(search)
    type(search_t), intent(inout) :: search
    type(job_t), allocatable :: jobs(:)
    real(wp), allocatable :: received(:)
    do
      call search%workers%exchange([real(wp) ::], received)
      call take_jobs(received, jobs)
      if (size(jobs) == 0) return
      call do_own(search, jobs, received)
    end do
  end subroutine serve

  !> The other processes are not needed any more. Called by the first.
  subroutine dismiss(search)
    type(search_t), intent(inout) :: search
    real(wp), allocatable :: ignored(:)
    if (has_workers(search)) call search%workers%exchange([0.0_wp], ignored)
  end subroutine dismiss

  logical function has_workers(search)
    type(search_t), intent(in) :: search
    has_workers = associated(search%workers)
    if (has_workers) has_workers = search%workers%count() > 1
  end function has_workers

  !> Has the jobs done, each by one process; `results` in the order of the jobs.
  subroutine share(search, jobs, results)
    type(search_t), intent(inout) :: search
    type(job_t), intent(in) :: jobs(:)
    type(numbers_t), allocatable, intent(out) :: results(:)
    type(numbers_t) :: numbers
    real(wp), allocatable :: received(:)
    integer :: i, from, job, length
    call numbers%put_integer(size(jobs))
    do i = 1, size(jobs)
      call numbers%put_integer(jobs(i)%kind)
      call numbers%put_integer(jobs(i)%number)
      if (jobs(i)%kind == follow_way) call numbers%put_orbit(jobs(i)%seed)
    end do
    call search%workers%exchange(numbers%values(:numbers%written), received)
    call do_own(search, jobs, received)
    allocate (results(size(jobs)))
    from = 1
    do i = 1, size(jobs)
      job = nint(received(from))
      length = nint(received(from + 1))
      call results(job)%put(received(from + 2:from + 1 + length))
      from = from + 2 + length
    end do
  end subroutine share

  subroutine take_jobs(received, jobs)
    real(wp), intent(in) :: received(:)
    type(job_t), allocatable, intent(out) :: jobs(:)
    type(numbers_t) :: numbers
    integer :: i, count
    call numbers%put(received)
    call numbers%take_integer(count)
    allocate (jobs(count))
    do i = 1, count
      call numbers%take_integer(jobs(i)%kind)
      call numbers%take_integer(jobs(i)%number)
      if (jobs(i)%kind == follow_way) call numbers%take_orbit(jobs(i)%seed)
    end do
  end subroutine take_jobs

  !> Does the jobs of this process; `received`: number of the job, length of its result, and the result, of all jobs in any order.
  subroutine do_own(search, jobs, received)
    type(search_t), intent(inout) :: search
    type(job_t), intent(in) :: jobs(:)
    real(wp), allocatable, intent(out) :: received(:)
    type(numbers_t) :: own, result
    integer :: i
    call own%put([real(wp) ::])
    do i = 1 + search%workers%own_number(), size(jobs), search%workers%count()
      call do_job(search, jobs(i), result)
      call own%put_integer(i)
      call own%put_integer(result%written)
      call own%put(result%values(:result%written))
    end do
    call search%workers%exchange(own%values(:own%written), received)
  end subroutine do_own

  subroutine do_job(search, job, result)
    type(search_t), intent(inout) :: search
    type(job_t), intent(in) :: job
    type(numbers_t), intent(out) :: result
    type(found_t) :: found
    type(point_t), allocatable :: points(:)
    logical :: depends
    integer :: ending
    if (job%kind == search_at) then
      call search_value(search, job%number, found, depends)
      call result%put_found(found)
      call result%put_integer(merge(1, 0, depends))
    else
      call trace_one_way(search%family, search%plan, job%seed, job%number, points, ending, search%watcher)
      call result%put_points(points)
      call result%put_integer(ending)
    end if
  end subroutine do_job

  !> Searches orbits at the value number `i`. `depends`: whether one depends on the parameter.
  subroutine search_value(search, i, found, depends)
    type(search_t), intent(in) :: search
    integer, intent(in) :: i
    type(found_t), intent(out) :: found
    logical, intent(out) :: depends
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    integer :: k
    allocate (found%orbits(0))
    depends = .false.
    call machine_neighbourhood(search%family, search%values(i), machines, error)
    if (allocated(error)) return
    call find_orbits(search%family, machines, search%values(i), search%starts, search%longest, found, search%watcher)
    do k = 1, size(found%orbits)
      depends = depends .or. depends_on_parameter(machines, found%orbits(k))
    end do
  end subroutine search_value

  !> Both ways from a seed.
  subroutine add_ways(jobs, seed)
    type(job_t), allocatable, intent(inout) :: jobs(:)
    type(orbit_t), intent(in) :: seed
    if (.not. allocated(jobs)) allocate (jobs(0))
    jobs = [jobs, job_t(follow_way, -1, seed), job_t(follow_way, 1, seed)]
  end subroutine add_ways

  subroutine take_branch(search, results, found)
    type(search_t), intent(in) :: search
    type(numbers_t), intent(inout) :: results(2)
    type(branch_t), intent(out) :: found
    type(point_t), allocatable :: back(:), further(:)
    integer :: ending(2)
    call results(1)%take_points(back)
    call results(1)%take_integer(ending(1))
    call results(2)%take_points(further)
    call results(2)%take_integer(ending(2))
    call join_ways(search%family, back, further, ending, found)
  end subroutine take_branch

  !> Whether a seed has been followed, and its branch.
  logical function is_traced(search, seed, found)
    type(search_t), intent(in) :: search
    type(orbit_t), intent(in) :: seed
    type(branch_t), intent(out) :: found
    integer :: i
    is_traced = .false.
    do i = 1, size(search%traced)
      is_traced = is_same(search%traced(i)%seed, seed)
      if (.not. is_traced) cycle
      found = search%traced(i)%branch
      return
    end do
  end function is_traced

  !> Whether two orbits are the same to the bit.
  pure logical function is_same(one, other)
    type(orbit_t), intent(in) :: one, other
    is_same = one%periods == other%periods .and. size(one%y) == size(other%y) .and. .not. abs(one%parameter - other%parameter) > 0
    if (is_same) is_same = .not. any(abs(one%y - other%y) > 0)
  end function is_same

end module search_jobs
