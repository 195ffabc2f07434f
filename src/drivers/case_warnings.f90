! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a case leaves to defaults, and what is allowed in it and hardly meant.
module case_warnings
  use build_multibody, only: multibody_of
  use case_parameters, only: parameter_value
  use case_setup, only: grid_of
  use case_type, only: case_t
  use contact_law, only: contact_at_speed, contact_hardened, contact_kelvin_voigt, contact_t
  use drive_law, only: ends_with_its_first
  use eigen, only: undamped_modes
  use errors, only: error_t
  use friction_law, only: power
  use grid, only: grid_t, slice_motion
  use idle_inputs, only: idle_input_t, idle_inputs_of
  use machine_type, only: machine_t
  use motor_choices, only: cannot_start
  use multibody, only: joint_contact, multibody_t
  use journal, only: journal_t
  use kinds, only: int64, wp
  use text, only: to_text
  implicit none
  private

  public :: warn_about

  !> A restitution is one of the structure, not of its modes, if no more than this yields in the upper half of them.
  real(wp), parameter :: converged_share = 0.2_wp

contains

  !> One line in the journal for each. Looks at the case itself, not along its axes.
  subroutine warn_about(command, the_case, journal)
    character(len=*), intent(in) :: command
    type(case_t), intent(in) :: the_case
    type(journal_t), intent(inout) :: journal
    type(grid_t) :: grid
    class(machine_t), allocatable :: moving
    type(error_t), allocatable :: error
    character(len=:), allocatable :: obstacle
    if (len(the_case%assumed) > 0) call journal%line('assumed', 'assumed: '//the_case%assumed)
    grid = grid_of(the_case, the_case%axes(:0))
    call slice_motion(grid, 0_int64, moving, error)
    if (allocated(error)) return
    if (moving%sample_interval > 0) call warn_about_force(command, the_case, moving, journal)
    call warn_about_impulse(the_case, journal)
    obstacle = moving%section_obstacle()
    if ((command == 'basin' .or. command == 'sweep') .and. len(obstacle) > 0) then
      call journal%line('warning', 'warning: no attractors are looked for: '//obstacle//'. Points get the regime at the end of '// &
        'their run')
    end if
    if (any(index(the_case%laws%name, 'structure:') == 1)) call warn_about_modes(the_case, journal)
    call warn_about_impulses(the_case, journal)
    call warn_about_standstill(the_case, journal)
    call warn_about_idle_inputs(the_case, journal)
    if (any(the_case%laws%family == 'body' .and. the_case%laws%name == 'structure')) call note_row(grid, moving, journal)
    if (moving%presses_by_steps) call warn_about_steps(the_case, moving, journal)
  end subroutine warn_about

  !> Warns if an impulse comes after the end.
  subroutine warn_about_impulse(the_case, journal)
    type(case_t), intent(in) :: the_case
    type(journal_t), intent(inout) :: journal
    real(wp) :: time
    if (.not. abs(parameter_value(the_case%laws, 'body.impulse', 0.0_wp)) > 0) return
    time = parameter_value(the_case%laws, 'body.impulse_time', 0.0_wp)
    if (time <= the_case%run%duration) return
    call journal%line('warning', 'warning: body.impulse_time = '//to_text(time)//' s is after the end, run.duration = '// &
      to_text(the_case%run%duration)//' s: no impulse acts')
  end subroutine warn_about_impulse

  !> Warns of a motor that does not start.
  subroutine warn_about_standstill(the_case, journal)
    type(case_t), intent(in) :: the_case
    type(journal_t), intent(inout) :: journal
    real(wp) :: torque
    logical :: remains
    call cannot_start(the_case%laws, torque, remains)
    if (remains) call journal%line('warning', 'warning: the motor cannot start: its torque at standstill is at most '// &
      to_text(torque)//' N m, motor.bearing_friction = '// &
      to_text(parameter_value(the_case%laws, 'motor.bearing_friction', 0.0_wp))//' N m')
  end subroutine warn_about_standstill

  !> Warns of parameters that change nothing.
  subroutine warn_about_idle_inputs(the_case, journal)
    type(case_t), intent(in) :: the_case
    type(journal_t), intent(inout) :: journal
    type(idle_input_t), allocatable :: idle(:)
    integer :: i
    idle = idle_inputs_of(the_case%laws)
    do i = 1, size(idle)
      call journal%line('warning', 'warning: '//trim(idle(i)%key)//' has no effect: '//trim(idle(i)%reason))
    end do
  end subroutine warn_about_idle_inputs

  !> Warns of impulses of a structure that come after the end.
  subroutine warn_about_impulses(the_case, journal)
    type(case_t), intent(in) :: the_case
    type(journal_t), intent(inout) :: journal
    type(multibody_t) :: machine
    type(error_t), allocatable :: error
    integer :: i
    if (.not. any(the_case%laws%family == 'body' .and. the_case%laws%name == 'structure')) return
    call multibody_of(the_case%laws, machine, error)
    if (allocated(error) .or. .not. allocated(machine%impulses)) return
    do i = 1, size(machine%impulses)
      if (machine%impulses(i)%time <= the_case%run%duration) cycle
      call journal%line('warning', 'warning: the impulse at '//to_text(machine%impulses(i)%time)//' s is after the end, '// &
        'run.duration = '//to_text(the_case%run%duration)//' s: it does not act')
    end do
  end subroutine warn_about_impulses

  !> Reports that bodies which touch in a row at the start are struck at once, where the order of impacts would matter.
  subroutine note_row(grid, moving, journal)
    type(grid_t), intent(in) :: grid
    class(machine_t), intent(in) :: moving
    type(journal_t), intent(inout) :: journal
    character(len=:), allocatable :: names
    names = moving%contacts_in_row(grid%start)
    if (len(names) == 0) return
    call journal%line('note', 'note: bodies touch in a row ('//names//'): impacts of contacts that touch come all at once. '// &
      "If they are to come one after the other, as in Newton's cradle, set in_sequence = 1 in [body]")
  end subroutine note_row

  !> Warns where a restitution is one of a flexible structure: it then depends on the number of modes.
  subroutine warn_about_modes(the_case, journal)
    type(case_t), intent(in) :: the_case
    type(journal_t), intent(inout) :: journal
    type(multibody_t) :: machine
    type(error_t), allocatable :: error
    real(wp) :: share
    integer :: j
    call multibody_of(the_case%laws, machine, error)
    if (allocated(error)) return
    do j = 1, size(machine%joints)
      if (machine%joints(j)%kind /= joint_contact) cycle
      share = upper_share(machine, machine%joints(j)%row)
      if (share <= converged_share) cycle
      call journal%line('warning', 'warning: '//trim(machine%joints(j)%name)//': the upper half of the modes makes '// &
        to_text(nint(100*share))//' % of what yields at an impact, and a restitution does not converge with their number. '// &
        'Compare with fewer and with more modes, or give the stop a stiffness (kelvin_voigt), or the point no mass (massless)')
    end do
  end subroutine warn_about_modes

  !> Share of the upper half of the undamped modes in the mobility along a row. A rigid body has no more of its modes.
  function upper_share(machine, row) result(share)
    type(multibody_t), intent(in) :: machine
    real(wp), intent(in) :: row(:)
    real(wp) :: share, squares(machine%n), shapes(machine%n, machine%n), part(machine%n)
    share = 0
    if (machine%n < 2) return
    call undamped_modes(machine%stiffness, machine%mass, squares, shapes)
    part = matmul(row, shapes)**2
    where (squares <= 1e-12_wp*maxval(abs(squares))) part(:) = 0
    share = sum(part((machine%n + 1)/2 + 1:))/max(sum(matmul(row, shapes)**2), tiny(share))
  end function upper_share

  !> Warns if a record of a force jumps where it begins again.
  subroutine warn_about_force(command, the_case, moving, journal)
    character(len=*), intent(in) :: command
    type(case_t), intent(in) :: the_case
    class(machine_t), intent(in) :: moving
    type(journal_t), intent(inout) :: journal
    integer :: last
    associate (force => moving%measured_force(), period => moving%period)
      last = size(force)
      if (ends_with_its_first(force)) return
      if (command /= 'basin' .and. command /= 'sweep' .and. the_case%run%duration <= period) return
      call journal%line('warning', 'warning: drive.force begins with '//to_text(force(1), 6)//' N and ends with '// &
        to_text(force(last), 6)//' N: repeated every '//to_text(period, 6)//' s, from its first sample to its last, it jumps. '// &
        'If its '//to_text(last)//' samples are one period, of '//to_text(last*moving%sample_interval, 6)// &
        ' s, set drive.periodic = 1')
    end associate
  end subroutine warn_about_force

  !> Warns if a body that leans on a soft barrier would use up the steps of a trajectory.
  subroutine warn_about_steps(the_case, moving, journal)
    type(case_t), intent(in) :: the_case
    class(machine_t), intent(in) :: moving
    type(journal_t), intent(inout) :: journal
    type(contact_t) :: stops
    real(wp) :: force, mass, rate, lasts
    logical :: closed_form
    call moving%contact_sizes(mass, force, closed_form)
    stops = moving%stops
    rate = steps_per_second(stops, mass, force)
    ! In closed form, one a radian of the fastest motion.
    if (closed_form) rate = max(sqrt(stops%stiffness/mass), stops%damping/mass)
    lasts = the_case%integrator%step_budget/rate
    if (lasts >= the_case%run%duration) return
    call journal%line('warning', 'warning: this barrier is so stiff that integrator.step_budget = '// &
      to_text(the_case%integrator%step_budget)//' suffices a body that rests against it for about '//to_text(lasts, 2)//' s of '// &
      to_text(the_case%run%duration)//' s; it then ends as step_budget. A softer barrier, or a rigid one '// &
      '(contact.law = "newton"), is faster')
  end subroutine warn_about_steps

  !> About how many steps a body of `mass` [kg] pressed by `force` [N] takes [1/s]: twenty a period of its vibration, and
  !> no longer than an explicit method of this order is stable under the damping, 6 m/D.
  pure real(wp) function steps_per_second(contact, mass, force) result(rate)
    type(contact_t), intent(in) :: contact
    real(wp), intent(in) :: mass, force
    type(contact_t) :: law
    real(wp) :: depth, damping
    law = contact_at_speed(contact, 1.0_wp)
    depth = power(force/law%stiffness, 1/law%exponent)
    damping = law%damping
    if (.not. any(law%kind == [contact_kelvin_voigt, contact_hardened])) damping = law%damping*force
    rate = damping/(6*mass)
    if (depth > 0) rate = rate + 3*sqrt(law%exponent*law%stiffness*power(depth, law%exponent - 1)/mass)
    rate = max(rate, tiny(rate)**0.25_wp)
  end function steps_per_second

end module case_warnings
