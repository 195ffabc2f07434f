! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies coupled by dry friction, and what drives the first of them: the rows of the catalogue.
module pair_rows
  use kinds, only: wp
  use law_row, only: any_value, law_length, law_row_t, not_negative, parameter_row_t, positive
  implicit none
  private

  integer :: i

  character(len=*), parameter :: source = 'Ruderman, Zagvozdkin, Rachinskii, IEEE CDC (2022), arXiv:2202.13913'
  character(len=*), parameter :: experiments = 'Ruderman, De Rito, arXiv:2501.03653 (2025)'

  character(len=law_length), parameter :: bodies(2) = [character(len=law_length) :: 'friction_pair', 'backlash_pair']
  character(len=law_length), parameter :: at_speed(2) = [character(len=law_length) :: 'velocity', 'pid_velocity']
  character(len=law_length), parameter :: sines(2) = [character(len=law_length) :: 'sine', 'pid_sine']
  character(len=law_length), parameter :: controllers(2) = [character(len=law_length) :: 'pid_velocity', 'pid_sine']

  type(law_row_t), parameter, public :: pair_laws(*) = [ &
    law_row_t('body', 'friction_pair', 'two bodies coupled by b sgn(v1 - v2) alone; barriers bound x2', source), &
    law_row_t('body', 'backlash_pair', 'the same; barriers carried by the driving body bound x2 - x1', source), &
    law_row_t('drive', 'force', 'force mean + amplitude cos(frequency t) on the body, of two on the driving one', source), &
    law_row_t('drive', 'velocity', 'two bodies: the driving one moves at a constant velocity', experiments), &
    law_row_t('drive', 'sine', 'two bodies: the driving one moves as amplitude sin(frequency t)', source), &
    law_row_t('drive', 'pid_velocity', 'two bodies: a controller moves the driving one along velocity t', experiments), &
    law_row_t('drive', 'pid_sine', 'two bodies: a controller moves the driving one along amplitude sin(frequency t)', &
              experiments)]

  type(parameter_row_t), parameter, public :: pair_parameters(*) = [ &
    (parameter_row_t('body', bodies(i), 'mass', 'kg', positive, 'm1 of the driving body'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'driven_mass', 'kg', positive, 'm2 of the driven body'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'friction', 'N', not_negative, 'b, Coulomb friction of the interface'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'driver_x0', 'm', any_value, &
                     'position of the driving body at the start; without effect where its motion is given', &
                     optional=.true.), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'driver_v0', 'm/s', any_value, &
                     'velocity of the driving body at the start; without effect where its motion is given', &
                     optional=.true.), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'impulse', 'N s', any_value, 'impulse of a hammer on the driven body', &
                     optional=.true.), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'impulse_time', 's', not_negative, 'time of the impulse since the start', &
                     optional=.true.), i=1, 2), &
    parameter_row_t('drive', 'force', 'mean', 'N', any_value, 'mean force', optional=.true.), &
    parameter_row_t('drive', 'force', 'amplitude', 'N', not_negative, 'amplitude of the force'), &
    parameter_row_t('drive', 'force', 'frequency', 'rad/s', positive, 'angular frequency'), &
    (parameter_row_t('drive', at_speed(i), 'velocity', 'm/s', any_value, 'V'), i=1, 2), &
    (parameter_row_t('drive', sines(i), 'amplitude', 'm', not_negative, 'X'), i=1, 2), &
    (parameter_row_t('drive', sines(i), 'frequency', 'rad/s', positive, 'W'), i=1, 2), &
    (parameter_row_t('drive', controllers(i), 'proportional', 'N/m', positive, 'force per error of position'), i=1, 2), &
    (parameter_row_t('drive', controllers(i), 'integral', 'N/(m s)', not_negative, 'force per integral of the error', &
                     optional=.true.), i=1, 2), &
    (parameter_row_t('drive', controllers(i), 'derivative', 'N s/m', not_negative, 'force per error of velocity', &
                     optional=.true.), i=1, 2), &
    (parameter_row_t('drive', controllers(i), 'sample_time', 's', not_negative, &
                     'time between samples of the controller; 0 = continuous', optional=.true.), i=1, 2)]

end module pair_rows
