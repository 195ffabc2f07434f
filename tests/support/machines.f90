! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Machines for the tests of the numerics, written as text:
!>   'body point_mass mass=1; restoring linear stiffness=4 free_length=0.4; friction none'
module machines
  use body_machine, only: body_machine_t, prepare_body
  use constants, only: pi
  use errors, only: error_t
  use kinds, only: int64, wp
  use law_table, only: law_choice, law_choice_t, set_value
  use motion, only: advance, advance_period, motion_t
  use motion_state, only: flight_auto, log_t, options_t, state_t, tally_t
  use oscillator, only: build_oscillator, oscillator_t
  implicit none
  private

  public :: laws_from, set_parameter, build, build_from, build_machine, build_machine_from, &
    published_laws, move_on, seed_random, uniform

contains

  !> Laws separated by ';', each 'family name parameter=value ...'; a list has commas between its values.
  function laws_from(text) result(laws)
    character(len=*), intent(in) :: text
    type(law_choice_t), allocatable :: laws(:)
    integer :: from, to
    allocate (laws(0))
    from = 1
    do while (from <= len(text))
      to = index(text(from:), ';') + from - 2
      if (to < from) to = len(text)
      laws = [laws, one_law(adjustl(text(from:to)))]
      from = to + 2
    end do
  end function laws_from

  function one_law(text) result(law)
    character(len=*), intent(in) :: text
    type(law_choice_t) :: law
    character(len=:), allocatable :: rest, word
    character(len=9) :: family
    real(wp), allocatable :: values(:)
    integer :: mark, i
    rest = text
    call take_word(rest, word)
    family = word
    call take_word(rest, word)
    law = law_choice(family, word)
    do
      call take_word(rest, word)
      if (len(word) == 0) exit
      mark = index(word, '=')
      allocate (values(count([(word(i:i) == ',', i=1, len(word))]) + 1))
      read (word(mark + 1:), *) values
      call set_value(law, word(:mark - 1), values)
      deallocate (values)
    end do
  end function one_law

  subroutine take_word(rest, word)
    character(len=:), allocatable, intent(inout) :: rest
    character(len=:), allocatable, intent(out) :: word
    integer :: blank
    rest = trim(adjustl(rest))
    blank = index(rest//' ', ' ')
    word = rest(:blank - 1)
    rest = rest(blank:)
  end subroutine take_word

  !> Sets 'family.parameter'.
  subroutine set_parameter(laws, path, value)
    type(law_choice_t), intent(inout) :: laws(:)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value
    integer :: i, dot
    dot = index(path, '.')
    do i = 1, size(laws)
      if (laws(i)%family == path(:dot - 1)) call set_value(laws(i), path(dot + 1:), [value])
    end do
  end subroutine set_parameter

  !> A machine on its section; ends the test program if it is refused.
  function build_machine(laws, flight, tolerance, event_budget) result(machine)
    type(law_choice_t), intent(in) :: laws(:)
    integer, intent(in), optional :: flight
    real(wp), intent(in), optional :: tolerance
    integer(int64), intent(in), optional :: event_budget
    type(body_machine_t) :: machine
    type(oscillator_t) :: oscillator
    type(options_t) :: options
    type(error_t), allocatable :: error
    options%flight = flight_auto
    if (present(flight)) options%flight = flight
    if (present(tolerance)) options%tolerance = tolerance
    if (present(event_budget)) options%event_budget = event_budget
    call build_oscillator(laws, oscillator, error)
    if (allocated(error)) error stop 'machines: '//error%message
    call prepare_body(oscillator, options, machine, error)
    if (allocated(error)) error stop 'machines: '//error%message
  end function build_machine

  function build_machine_from(text, flight, tolerance) result(machine)
    character(len=*), intent(in) :: text
    integer, intent(in), optional :: flight
    real(wp), intent(in), optional :: tolerance
    type(body_machine_t) :: machine
    machine = build_machine(laws_from(text), flight, tolerance)
  end function build_machine_from

  !> Its body alone, ready to move.
  function build(laws, flight, tolerance, event_budget) result(moving)
    type(law_choice_t), intent(in) :: laws(:)
    integer, intent(in), optional :: flight
    real(wp), intent(in), optional :: tolerance
    integer(int64), intent(in), optional :: event_budget
    type(motion_t) :: moving
    type(body_machine_t) :: machine
    machine = build_machine(laws, flight, tolerance, event_budget)
    moving = machine%body
  end function build

  function build_from(text, flight, tolerance) result(moving)
    character(len=*), intent(in) :: text
    integer, intent(in), optional :: flight
    real(wp), intent(in), optional :: tolerance
    type(motion_t) :: moving
    moving = build(laws_from(text), flight, tolerance)
  end function build_from

  !> The machine of Lemes et al. with the drive fitted to its published numbers.
  function published_laws(friction, ratio) result(laws)
    character(len=*), intent(in) :: friction
    real(wp), intent(in) :: ratio
    type(law_choice_t), allocatable :: laws(:)
    character(len=:), allocatable :: friction_text
    select case (friction)
    case ('coulomb')
      friction_text = 'friction coulomb kinetic_coefficient=0.2'
    case ('viscous')
      friction_text = 'friction viscous damping=0.2'
    case ('coulomb_stribeck')
      friction_text = 'friction coulomb_stribeck kinetic_coefficient=0.2 static_coefficient=0.5 stribeck_velocity=0.001'
    case default
      friction_text = 'friction '//friction
    end select
    laws = laws_from('body point_mass mass=1; restoring linear free_length=0.4; '//friction_text// &
      '; contact newton restitution=0.5 upper=1.1; drive fourier mean=0.31055'// &
      ' cosine=0.09495,0.01,-0.02003 sine=0,0.02849,-0.02686')
    call set_parameter(laws, 'restoring.stiffness', 9*pi**2)
    call set_parameter(laws, 'drive.ratio', ratio)
    call set_parameter(laws, 'drive.angle', 191.1_wp*pi/180)
  end function published_laws

  !> Moves on by `duration` [s] over any number of sections.
  subroutine move_on(moving, state, duration, tally, reason, log)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: duration
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp) :: left
    left = duration
    reason = 0
    do while (left >= moving%machine%period - state%time)
      left = left - (moving%machine%period - state%time)
      call advance_period(moving, state, tally, reason, log)
      if (reason /= 0) return
    end do
    if (left > 0) call advance(moving, state, state%time + left, tally, reason, log)
  end subroutine move_on

  !> The same random numbers in every run.
  subroutine seed_random(seed)
    integer, intent(in) :: seed
    integer :: n, i
    call random_seed(size=n)
    call random_seed(put=[(seed + 7919*i, i=1, n)])
  end subroutine seed_random

  !> A random number between two.
  real(wp) function uniform(low, high)
    real(wp), intent(in) :: low, high
    call random_number(uniform)
    uniform = low + (high - low)*uniform
  end function uniform

end module machines
