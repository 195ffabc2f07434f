! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a crank at the angle `phi` moves: position of the foot of the spring, `foot`, and inertia reduced to the crank,
!> `inertia`, with their derivatives `foot_slope`, `inertia_slope`.
module crank_mechanism
  use elementary, only: sine_cosine
  use equation_sheet, only: add_optional, add_parameter, define, define_slope, sheet_t
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, value_of
  use text, only: to_text
  implicit none
  private

  public :: add_mechanism

contains

  !> Adds a mechanism, a choice of the family `drive`, with the inertias of a choice of the family `motor`.
  pure subroutine add_mechanism(drive, motor, sheet)
    type(law_choice_t), intent(in) :: drive, motor
    type(sheet_t), intent(inout) :: sheet
    character(len=*), parameter :: of_motor(5) = [character(len=13) :: &
      'rotor_inertia', 'lever_inertia', 'rod_mass', 'rod_inertia', 'foot_mass']
    integer :: i
    call add_parameter(sheet, of_motor(1), value_of(motor, 'inertia'))
    do i = 2, size(of_motor)
      call add_optional(sheet, of_motor(i), value_of(motor, of_motor(i)))
    end do
    if (drive%name /= 'unbalance') then
      call add_optional(sheet, 'angle', value_of(drive, 'angle'))
      call define(sheet, 'angle_now', 'phi + angle')
    end if
    select case (drive%name)
    case ('harmonic')
      call add_of(drive, ['mean     ', 'amplitude'], sheet)
      call define(sheet, 'foot', 'mean + amplitude*cos(angle_now)')
    case ('fourier')
      call add_harmonics(drive, sheet)
    case ('slider_crank')
      call add_of(drive, ['mean ', 'crank', 'rod  '], sheet)
      call define(sheet, 'foot', 'mean + crank*cos(angle_now) + sqrt(rod^2 - (crank*sin(angle_now))^2) - rod')
    case ('crank_lever_rod')
      call add_lever(drive, sheet)
    case default
      call define(sheet, 'foot', '0')
    end select
    call define_slope(sheet, 'foot_slope', 'foot', 'phi')
    if (drive%name == 'crank_lever_rod') then
      call add_lever_inertia(sheet)
    else
      call define(sheet, 'inertia', 'rotor_inertia + foot_mass*foot_slope^2')
    end if
    call define_slope(sheet, 'inertia_slope', 'inertia', 'phi')
  end subroutine add_mechanism

  !> Parameters of a choice by their names.
  pure subroutine add_of(choice, names, sheet)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: names(:)
    type(sheet_t), intent(inout) :: sheet
    integer :: i
    do i = 1, size(names)
      call add_optional(sheet, names(i), value_of(choice, trim(names(i))))
    end do
  end subroutine add_of

  pure subroutine add_harmonics(drive, sheet)
    type(law_choice_t), intent(in) :: drive
    type(sheet_t), intent(inout) :: sheet
    real(wp), allocatable :: cosine(:), sine(:)
    character(len=:), allocatable :: n, foot
    integer :: i
    cosine = list_of(drive, 'cosine')
    sine = list_of(drive, 'sine')
    call add_of(drive, ['mean'], sheet)
    foot = 'mean'
    do i = 1, size(cosine)
      n = to_text(i)
      call add_parameter(sheet, 'cosine'//n, cosine(i))
      call add_parameter(sheet, 'sine'//n, sine(i))
      call define(sheet, 'harmonic'//n, 'cosine'//n//'*cos('//n//'*angle_now) + sine'//n//'*sin('//n//'*angle_now)')
      foot = foot//' + harmonic'//n
    end do
    call define(sheet, 'foot', foot)
  end subroutine add_harmonics

  !> Slotted lever CE about C = 0, driven by the pin D of the crank; rod EA to the guide of A.
  pure subroutine add_lever(drive, sheet)
    type(law_choice_t), intent(in) :: drive
    type(sheet_t), intent(inout) :: sheet
    real(wp) :: sine, cosine
    call add_of(drive, [character(len=12) :: 'crank', 'lever', 'rod', 'guide_height', 'side', 'shift'], sheet)
    call sine_cosine(value_of(drive, 'pivot_angle'), sine, cosine)
    call add_parameter(sheet, 'pivot_x', value_of(drive, 'pivot_distance')*cosine)
    call add_parameter(sheet, 'pivot_y', value_of(drive, 'pivot_distance')*sine)
    call define(sheet, 'pin_x', 'pivot_x + crank*cos(angle_now)')
    call define(sheet, 'pin_y', 'pivot_y + crank*sin(angle_now)')
    call define(sheet, 'scaling', 'lever/sqrt(pin_x^2 + pin_y^2)')
    call define(sheet, 'end_x', 'scaling*pin_x')
    call define(sheet, 'end_y', 'scaling*pin_y')
    call define(sheet, 'reach', 'sqrt(rod^2 - (end_y - guide_height)^2)')
    call define(sheet, 'foot', 'shift + end_x + side*reach')
  end subroutine add_lever

  !> Lever about C, rod with its centre in the middle, and the mass at A. Speeds are those per crank speed.
  pure subroutine add_lever_inertia(sheet)
    type(sheet_t), intent(inout) :: sheet
    call define_slope(sheet, 'end_x_slope', 'end_x', 'phi')
    call define_slope(sheet, 'end_y_slope', 'end_y', 'phi')
    call define(sheet, 'of_lever', 'lever_inertia*(end_x_slope^2 + end_y_slope^2)/lever^2')
    call define(sheet, 'of_rod', 'rod_mass*((end_x_slope + foot_slope)^2 + end_y_slope^2)/4 + rod_inertia*(end_y_slope/reach)^2')
    call define(sheet, 'inertia', 'rotor_inertia + of_lever + of_rod + foot_mass*foot_slope^2')
  end subroutine add_lever_inertia

end module crank_mechanism
