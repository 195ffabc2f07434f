! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Controllers and impulses of a multibody structure.
module control
  use assembly, only: add_body, add_force
  use errors, only: error_t, fail
  use multibody, only: controller_t, impulse_t, integral_of, multibody_t, wave_value
  use multibody_state, only: multibody_state_t, running_control
  use kinds, only: wp
  use status, only: exit_bad_case
  implicit none
  private

  public :: add_controller, add_impulse, error_of, active_force, bodies_of

contains

  !> Adds a controller, the frequency of the machine and all bodies and joints being known; one for a machine, and none with a
  !> body whose motion is given. A continuous one acts as spring, damper and force; its integral y is one more coordinate,
  !> `name`, of unit mass, under y'' = e'.
  pure subroutine add_controller(machine, controller, name, error)
    type(multibody_t), intent(inout) :: machine
    type(controller_t), intent(in) :: controller
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    complex(wp), allocatable :: harmonic(:), rates(:)
    real(wp), allocatable :: shape(:, :)
    real(wp) :: row(machine%n + 1)
    integer :: m
    if (allocated(machine%controller)) then
      call fail(error, exit_bad_case, 'drive: found two controllers, allowed one')
      return
    end if
    machine%controller = controller
    harmonic = [complex(wp) ::]
    if (allocated(controller%reference%harmonic)) harmonic = controller%reference%harmonic
    if (controller%sample_time > 0) then
      ! The machine knows the harmonics.
      call add_force(machine, controller%row, 0.0_wp, 0*harmonic)
      return
    end if
    associate (c => machine%controller)
      if (abs(c%integral) > 0) then
        call add_body(machine, name, 1.0_wp, 0.0_wp)
        if (allocated(machine%start_shape)) then
          shape = machine%start_shape
          deallocate (machine%start_shape)
          allocate (machine%start_shape(machine%n, 2), source=0.0_wp)
          machine%start_shape(:machine%n - 1, :) = shape
        end if
        c%integral_at = machine%n
        c%row = [c%row, 0.0_wp]
        do m = 1, size(machine%joints)
          machine%joints(m)%row = [machine%joints(m)%row, 0.0_wp]
        end do
      end if
      row(:machine%n) = c%row
      allocate (c%stiffness(machine%n, machine%n), c%damping(machine%n, machine%n), c%load(machine%n), source=0.0_wp)
      do m = 1, machine%n
        c%stiffness(:, m) = c%proportional*row(:machine%n)*row(m)
        c%damping(:, m) = c%derivative*row(:machine%n)*row(m)
      end do
      c%load = (c%proportional*c%reference%mean + c%derivative*c%reference%rate)*c%row
      rates = [(harmonic(m)*cmplx(0.0_wp, m*machine%frequency, wp), m=1, size(harmonic))]
      call add_force(machine, c%row, 0.0_wp, c%proportional*harmonic + c%derivative*rates)
      if (c%integral_at > 0) then
        c%stiffness(:, c%integral_at) = -c%integral*c%row
        c%damping(c%integral_at, :) = c%row
        c%load(c%integral_at) = c%reference%rate
        call add_force(machine, [(merge(1.0_wp, 0.0_wp, m == c%integral_at), m=1, machine%n)], 0.0_wp, rates)
      end if
      machine%stiffness = machine%stiffness + c%stiffness
      machine%damping = machine%damping + c%damping
      machine%load = machine%load + c%load
    end associate
  end subroutine add_controller

  !> Adds an impulse behind those before it in time.
  pure subroutine add_impulse(machine, impulse)
    type(multibody_t), intent(inout) :: machine
    type(impulse_t), intent(in) :: impulse
    type(impulse_t), allocatable :: more(:)
    integer :: before, i
    if (.not. allocated(machine%impulses)) allocate (machine%impulses(0))
    before = count(machine%impulses%time <= impulse%time)
    allocate (more(size(machine%impulses) + 1))
    do i = 1, size(machine%impulses)
      more(i + merge(1, 0, i > before)) = machine%impulses(i)
    end do
    more(before + 1) = impulse
    call move_alloc(more, machine%impulses)
  end subroutine add_impulse

  !> What a controller sees, reference less position, and its rate [m, m/s].
  pure subroutine error_of(machine, state, turning, error, rate)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: error, rate
    associate (controller => machine%controller, n => machine%n)
      call wave_value(controller%reference, machine%frequency, state%time, turning, error, rate)
      error = error + controller%reference%rate*state%clock - sum(controller%row*state%q(:n))
      rate = rate - sum(controller%row*state%v(:n))
    end associate
  end subroutine error_of

  !> Force of a controller on the coordinates but for the harmonics of its reference, which are among those of the machine [N].
  pure function active_force(machine, state) result(force)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    real(wp) :: force(machine%n), running, rate
    associate (controller => machine%controller, n => machine%n)
      call running_control(controller, state, running, rate)
      force = running*controller%row
      if (.not. controller%sample_time > 0) force = force + controller%load &
        - matmul(controller%stiffness, state%q(:n)) - matmul(controller%damping, state%v(:n))
    end associate
  end function active_force

  !> The state of the bodies alone: the integral of a controller has no energy.
  pure type(multibody_state_t) function bodies_of(machine, state) result(bodies)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    bodies = state
    if (integral_of(machine) == 0) return
    bodies%q(integral_of(machine)) = 0
    bodies%v(integral_of(machine)) = 0
  end function bodies_of

end module control
