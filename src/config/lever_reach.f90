! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether the crank-lever-rod mechanism can be put together at every crank angle: the end E of the
!> lever must stay within one rod length of the guide, |E_y - h| <= rod.
module lever_reach
  use constants, only: pi, two_pi
  use kinds, only: wp
  use law_table, only: law_choice_t, value_of
  use text, only: to_text
  implicit none
  private

  public :: check_assembly

contains

  !> What fails and where, '' if nothing does. The crank must be shorter than pivot_distance; then
  !> the lever rocks by asin(crank/pivot_distance) about pivot_angle, and E_y = lever*sin(lever
  !> angle) is largest and smallest at the ends of that range or where the lever is upright.
  pure function check_assembly(drive) result(problem)
    type(law_choice_t), intent(in) :: drive
    character(len=:), allocatable :: problem
    real(wp) :: middle, rock, candidates(6), lever_angle, reach, worst, angle
    integer :: i, turns
    middle = value_of(drive, 'pivot_angle')
    rock = asin(value_of(drive, 'crank')/value_of(drive, 'pivot_distance'))
    turns = nint(middle/two_pi)
    candidates = [middle - rock, middle + rock, (two_pi*(turns + i) - pi/2, i=0, 1), (two_pi*(turns - i) + pi/2, i=0, 1)]
    worst = -1
    angle = middle
    do i = 1, size(candidates)
      lever_angle = candidates(i)
      if (abs(lever_angle - middle) > rock .and. i > 2) cycle
      reach = abs(value_of(drive, 'lever')*sin(lever_angle) - value_of(drive, 'guide_height'))
      if (reach <= worst) cycle
      worst = reach
      angle = lever_angle
    end do
    problem = ''
    if (worst <= value_of(drive, 'rod')) return
    problem = 'found '//to_text(value_of(drive, 'rod'))//' m, allowed at least '//to_text(worst, 5)// &
              ' m: the mechanism cannot be assembled at the crank angle '// &
              to_text(crank_angle_at(drive, angle)*180/pi, 5)//' deg'
  end function check_assembly

  !> A crank angle in [0, 2 pi) at which the lever has the angle `lever_angle`.
  pure real(wp) function crank_angle_at(drive, lever_angle)
    type(law_choice_t), intent(in) :: drive
    real(wp), intent(in) :: lever_angle
    real(wp) :: sine
    sine = value_of(drive, 'pivot_distance')/value_of(drive, 'crank')*sin(lever_angle - value_of(drive, 'pivot_angle'))
    crank_angle_at = modulo(lever_angle + asin(max(-1.0_wp, min(1.0_wp, sine))) - value_of(drive, 'angle'), two_pi)
  end function crank_angle_at

end module lever_reach
