! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Branches of equilibria of a machine without a clock over a parameter, with their folds, Hopf points, and ends where a stop is
!> touched or let go.
module equilibrium_branch
  use body_family, only: family_t
  use branch_point, only: label_be, label_bp, label_hb, label_not_known, label_range, label_sn, no_label, plan_t
  use continuation, only: continuation_t
  use equilibrium, only: correct_equilibrium, count_unstable, equilibrium_t, is_isolated, lasts, tangent_of_equilibrium
  use errors, only: error_t
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use rest_modes, only: is_linear, modes_of_rest, without_speeds
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: find_equilibria

  !> Equilibria at one value that are nearer than this, in natural sizes, are one.
  real(wp), parameter :: same = 1e-7_wp
  !> Smallest step, as a share of the largest; halvings that locate what is passed.
  real(wp), parameter :: smallest_step = 1e-6_wp
  integer, parameter :: halvings = 60
  !> Starts at one value over all modes, and for each at least.
  integer, parameter :: most_tries = 400, least_starts = 4
  !> Where the parameter stands still, steps are longer by one over this.
  real(wp), parameter :: along_the_state = 0.05_wp
  !> How far beyond a stop that is touched or let go the other mode is looked for, as a share of the range.
  real(wp), parameter :: beyond = 1e-6_wp

  !> Points in order from one end to the other; `ending` labels the last.
  type, public :: equilibria_t
    type(equilibrium_t), allocatable :: points(:)
    integer :: ending(2) = no_label
  end type equilibria_t

  !> One way along a branch: where it is with its machines, and the neighbour that was tried.
  type, extends(continuation_t) :: equilibrium_way_t
    type(family_t) :: family
    type(plan_t) :: plan
    type(neighbourhood_t) :: machines
    type(equilibrium_t) :: now, next
    type(equilibrium_t), allocatable :: points(:)
  contains
    procedure :: points_found, try_step, take_step, give_up
  end type equilibrium_way_t

contains

  !> The branches of equilibria through those that Newton's method finds at `values`, in all modes, from `starts` (columns).
  subroutine find_equilibria(family, plan, values, starts, branches)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    real(wp), intent(in) :: values(:), starts(:, :)
    type(equilibria_t), allocatable, intent(out) :: branches(:)
    type(neighbourhood_t) :: machines, own
    type(error_t), allocatable :: error
    type(equilibrium_t) :: seed
    integer, allocatable :: modes(:)
    integer :: i, k, m
    logical :: ok
    allocate (branches(0))
    do i = 1, size(values)
      call machine_neighbourhood(family, values(i), machines, error)
      if (allocated(error)) cycle
      modes = modes_of_rest(machines%centre)
      do m = 1, size(modes)
        do k = 1, starts_tried(machines%centre, size(modes), size(starts, 2))
          own = machines
          seed = equilibrium_t(mode=modes(m), parameter=values(i), y=without_speeds(machines%centre, starts(:, k)))
          call correct_equilibrium(family, own, seed, along_parameter(seed, 1), ok)
          if (ok) ok = is_isolated(machines%centre, seed) .and. lasts(seed)
          if (ok) ok = .not. is_on(branches, family, machines%centre, seed)
          if (ok) call follow(family, plan, seed, branches)
        end do
      end do
    end do
  end subroutine find_equilibria

  !> Starts for each of so many modes: a linear one has one equilibrium; of many modes fewer starts are tried.
  pure integer function starts_tried(machine, modes, given) result(tried)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: modes, given
    tried = min(given, max(least_starts, most_tries/modes))
    if (is_linear(machine)) tried = 1
  end function starts_tried

  pure function along_parameter(point, way) result(direction)
    type(equilibrium_t), intent(in) :: point
    integer, intent(in) :: way
    real(wp) :: direction(size(point%y) + 1)
    direction = 0
    direction(size(direction)) = way
  end function along_parameter

  !> Whether a branch passes through an equilibrium: between two of its points they are corrected to that value.
  logical function is_on(branches, family, machine, point)
    type(equilibria_t), intent(in) :: branches(:)
    type(family_t), intent(in) :: family
    class(hybrid_t), intent(in) :: machine
    type(equilibrium_t), intent(in) :: point
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    type(equilibrium_t) :: there
    integer :: b, i, k
    logical :: ok
    is_on = .false.
    call machine_neighbourhood(family, point%parameter, machines, error)
    if (allocated(error)) return
    do b = 1, size(branches)
      associate (line => branches(b)%points)
        if (line(1)%mode /= point%mode) cycle
        do i = 1, size(line) - 1
          if ((line(i)%parameter - point%parameter)*(line(i + 1)%parameter - point%parameter) > 0) cycle
          do k = 0, 1
            there = line(i + k)
            there%parameter = point%parameter
            call correct_equilibrium(family, machines, there, along_parameter(there, 1), ok)
            if (ok) is_on = is_on .or. norm2((there%y - point%y)/machine%size_of) < same
          end do
          if (is_on) return
        end do
      end associate
    end do
  end function is_on

  !> Follows an equilibrium both ways, and what begins in the other mode where it ends at a stop.
  recursive subroutine follow(family, plan, seed, branches)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(equilibrium_t), intent(in) :: seed
    type(equilibria_t), allocatable, intent(inout) :: branches(:)
    type(equilibria_t) :: found
    type(equilibrium_t), allocatable :: back(:), further(:)
    integer :: i
    call trace_one_way(family, plan, seed, -1, back, found%ending(1))
    call trace_one_way(family, plan, seed, 1, further, found%ending(2))
    found%points = [[(back(i), i=size(back), 1, -1)], further(min(2, size(further) + 1):)]
    branches = [branches, found]
    if (found%ending(1) == label_be) call leave_mode(family, plan, found%points(1), branches)
    if (found%ending(2) == label_be) call leave_mode(family, plan, found%points(size(found%points)), branches)
  end subroutine follow

  !> Looks for the equilibria of other modes that begin where one ends at a stop, on both sides of its value.
  recursive subroutine leave_mode(family, plan, last, branches)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(equilibrium_t), intent(in) :: last
    type(equilibria_t), allocatable, intent(inout) :: branches(:)
    type(neighbourhood_t) :: machines, own
    type(error_t), allocatable :: error
    type(equilibrium_t) :: seed
    integer, allocatable :: modes(:)
    integer :: m, side
    logical :: ok
    do side = -1, 1, 2
      seed%parameter = last%parameter + side*beyond*family%parameter_size
      if (seed%parameter < plan%lowest .or. seed%parameter > plan%highest) cycle
      call machine_neighbourhood(family, seed%parameter, machines, error)
      if (allocated(error)) cycle
      modes = modes_of_rest(machines%centre)
      do m = 1, size(modes)
        if (modes(m) == last%mode) cycle
        own = machines
        seed = equilibrium_t(mode=modes(m), parameter=seed%parameter, y=last%y)
        call correct_equilibrium(family, own, seed, along_parameter(seed, 1), ok)
        if (ok) ok = is_isolated(machines%centre, seed) .and. lasts(seed)
        if (ok) ok = norm2((seed%y - last%y)/machines%centre%size_of) < 1e3_wp*beyond
        if (ok) ok = .not. is_on(branches, family, machines%centre, seed)
        if (ok) call follow(family, plan, seed, branches)
      end do
    end do
  end subroutine leave_mode

  !> From the seed in the direction in which the parameter rises (`way` = 1) or falls, up to an end.
  subroutine trace_one_way(family, plan, seed, way, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(equilibrium_t), intent(in) :: seed
    integer, intent(in) :: way
    type(equilibrium_t), allocatable, intent(out) :: points(:)
    integer, intent(out) :: ending
    type(equilibrium_way_t) :: line
    type(error_t), allocatable :: error
    logical :: ok
    allocate (points(0))
    ending = label_not_known
    line%now = seed
    call machine_neighbourhood(family, seed%parameter, line%machines, error)
    if (allocated(error)) return
    call tangent_of_equilibrium(line%machines, line%now, family%parameter_size, along_parameter(seed, way), ok)
    points = [line%now]
    if (.not. ok) return
    line%family = family
    line%plan = plan
    call move_alloc(points, line%points)
    call line%follow(0.1_wp*plan%largest_step, smallest_step*plan%largest_step, plan%most_points)
    call move_alloc(line%points, points)
    ending = line%ending
    associate (last => points(size(points)))
      if (last%label == no_label) last%label = ending
    end associate
  end subroutine trace_one_way

  pure integer function points_found(self)
    class(equilibrium_way_t), intent(in) :: self
    points_found = size(self%points)
  end function points_found

  subroutine try_step(self, cosine, ok)
    class(equilibrium_way_t), intent(inout) :: self
    real(wp), intent(out) :: cosine
    logical, intent(out) :: ok
    cosine = -1
    call step_to(self%family, self%machines, self%now, self%step, self%next, ok)
    if (ok) cosine = sum(self%next%tangent*self%now%tangent)
  end subroutine try_step

  subroutine give_up(self)
    class(equilibrium_way_t), intent(inout) :: self
    self%ending = label_not_known
  end subroutine give_up

  subroutine take_step(self)
    class(equilibrium_way_t), intent(inout) :: self
    type(error_t), allocatable :: error
    real(wp) :: length
    logical :: ok
    length = self%step
    associate (plan => self%plan, now => self%now, next => self%next)
      if (next%parameter < plan%lowest .or. next%parameter > plan%highest) then
        length = room(self)
        call end_at_range(self%family, now, merge(plan%lowest, plan%highest, next%parameter < plan%lowest), next, ok)
        self%ending = merge(label_range, label_not_known, ok)
        if (.not. ok) return
      end if
      call note_passages(self%family, self%machines, now, next, length, self%points)
      if (self%points(size(self%points))%label == label_be) then
        self%ending = label_be
        return
      end if
      self%points = [self%points, next]
      if (self%ending == label_range) return
      now = next
      self%step = min(plan%largest_step/max(abs(now%tangent(size(now%tangent))), along_the_state), 1.4_wp*self%step)
      call machine_neighbourhood(self%family, now%parameter, self%machines, error)
    end associate
  end subroutine take_step

  !> How far the end of the range is along the tangent.
  pure real(wp) function room(self)
    class(equilibrium_way_t), intent(in) :: self
    associate (rise => self%now%tangent(size(self%now%tangent)))
      room = huge(room)
      if (abs(rise) > 0) room = (merge(self%plan%highest, self%plan%lowest, rise > 0) - self%now%parameter)/ &
        (rise*self%family%parameter_size)
    end associate
  end function room

  !> The point `length` further along.
  subroutine step_to(family, machines, now, length, next, ok)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(in) :: machines
    type(equilibrium_t), intent(in) :: now
    real(wp), intent(in) :: length
    type(equilibrium_t), intent(out) :: next
    logical, intent(out) :: ok
    type(neighbourhood_t) :: there
    type(error_t), allocatable :: error
    integer :: n
    n = size(now%y)
    next = now
    next%label = no_label
    next%y = now%y + length*now%tangent(:n)*machines%centre%size_of
    next%parameter = now%parameter + length*now%tangent(n + 1)*family%parameter_size
    call machine_neighbourhood(family, next%parameter, there, error)
    ok = .not. allocated(error)
    if (ok) call correct_equilibrium(family, there, next, now%tangent, ok)
    if (ok) call tangent_of_equilibrium(there, next, family%parameter_size, now%tangent, ok)
  end subroutine step_to

  !> The last point within the range.
  subroutine end_at_range(family, now, bound, next, ok)
    type(family_t), intent(in) :: family
    type(equilibrium_t), intent(in) :: now
    real(wp), intent(in) :: bound
    type(equilibrium_t), intent(inout) :: next
    logical, intent(out) :: ok
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    next%parameter = bound
    call machine_neighbourhood(family, bound, machines, error)
    ok = .not. allocated(error)
    if (ok) call correct_equilibrium(family, machines, next, along_parameter(next, 1), ok)
    if (ok) call tangent_of_equilibrium(machines, next, family%parameter_size, now%tangent, ok)
  end subroutine end_at_range

  !> Locates what lies between two neighbours, `length` apart: a stop that is touched or let go, beyond which nothing counts; where
  !> eigenvalues come over the imaginary axis. Adds labelled points in their order.
  subroutine note_passages(family, machines, now, next, length, points)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(in) :: machines
    type(equilibrium_t), intent(in) :: now, next
    real(wp), intent(in) :: length
    type(equilibrium_t), allocatable, intent(inout) :: points(:)
    type(equilibrium_t) :: point, last
    real(wp) :: to
    logical :: found
    to = length
    last = next
    if (.not. lasts(next)) then
      call locate(family, machines, now, to, .true., point, found)
      point%label = label_be
      if (.not. found) point%label = label_not_known
      last = point
    end if
    if (count_unstable(last) /= count_unstable(now)) then
      call locate(family, machines, now, length, .false., point, found)
      if (found) then
        point%label = label_of_crossing(now, last, point)
        points = [points, point]
      end if
    end if
    if (last%label /= no_label) points = [points, last]
  end subroutine note_passages

  !> Where between a point and that `length` further the margins end (`of_mode`) or the number of unstable eigenvalues changes.
  subroutine locate(family, machines, now, length, of_mode, point, found)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(in) :: machines
    type(equilibrium_t), intent(in) :: now
    real(wp), intent(in) :: length
    logical, intent(in) :: of_mode
    type(equilibrium_t), intent(out) :: point
    logical, intent(out) :: found
    type(equilibrium_t) :: tried
    real(wp) :: low, high, middle
    logical :: ok, passed
    integer :: i
    point = now
    found = .false.
    low = 0
    high = length
    do i = 1, halvings
      middle = (low + high)/2
      call step_to(family, machines, now, middle, tried, ok)
      if (.not. ok) return
      passed = count_unstable(tried) /= count_unstable(now)
      if (of_mode) passed = .not. lasts(tried)
      if (passed) then
        high = middle
      else
        low = middle
        point = tried
      end if
      if (high - low <= 2*spacing(high)) exit
    end do
    found = .true.
  end subroutine locate

  !> What passes the imaginary axis at `point`, between two neighbours: a pair, or a real eigenvalue, where the parameter turns or
  !> not.
  pure integer function label_of_crossing(now, next, point) result(label)
    type(equilibrium_t), intent(in) :: now, next, point
    integer :: k
    k = minloc(abs(real(point%values)), 1)
    if (abs(aimag(point%values(k))) > 0) then
      label = label_hb
    else if (now%tangent(size(now%tangent))*next%tangent(size(next%tangent)) < 0) then
      label = label_sn
    else
      label = label_bp
    end if
  end function label_of_crossing

end module equilibrium_branch
