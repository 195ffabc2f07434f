! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies coupled by dry friction, and what drives the first of them: the rows of the catalogue.
module pair_rows
  use kinds, only: wp
  use law_row, only: law_length, law_row_t, none_above, none_below, parameter_row_t
  implicit none
  private

  integer :: i

  character(len=*), parameter :: source = 'Ruderman, Zagvozdkin, Rachinskii, IEEE CDC (2022), arXiv:2202.13913'
  character(len=*), parameter :: experiments = 'Ruderman, De Rito, arXiv:2501.03653 (2025)'

  character(len=law_length), parameter :: bodies(2) = [character(len=law_length) :: 'friction_pair', 'backlash_pair']
  character(len=law_length), parameter :: at_speed(2) = [character(len=law_length) :: 'velocity', 'pid_velocity']
  character(len=law_length), parameter :: sines(2) = [character(len=law_length) :: 'sine', 'pid_sine']
  character(len=law_length), parameter :: controllers(2) = [character(len=law_length) :: 'pid_velocity', 'pid_sine']

  type(law_row_t), parameter, public :: pair_laws(7) = [ &
    law_row_t('body', 'friction_pair', 'two bodies coupled by b sgn(v1 - v2) alone; barriers bound x2', source), &
    law_row_t('body', 'backlash_pair', 'the same; barriers carried by the driving body bound x2 - x1', source), &
    law_row_t('drive', 'force', 'two bodies: force mean + amplitude cos(frequency t) on the driving one', source), &
    law_row_t('drive', 'velocity', 'two bodies: the driving one moves at a constant velocity', experiments), &
    law_row_t('drive', 'sine', 'two bodies: the driving one moves as amplitude sin(frequency t)', source), &
    law_row_t('drive', 'pid_velocity', 'two bodies: a controller moves the driving one along velocity t', experiments), &
    law_row_t('drive', 'pid_sine', 'two bodies: a controller moves the driving one along amplitude sin(frequency t)', &
              experiments)]

  type(parameter_row_t), parameter, public :: pair_parameters(31) = [ &
    (parameter_row_t('body', bodies(i), 'mass', 'kg', 0.0_wp, none_above, .true., .false., 0.0_wp, .false., &
                     'm1 of the driving body'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'driven_mass', 'kg', 0.0_wp, none_above, .true., .false., 0.0_wp, .false., &
                     'm2 of the driven body'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'friction', 'N', 0.0_wp, none_above, .false., .false., 0.0_wp, .false., &
                     'b, Coulomb friction of the interface'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'driver_x0', 'm', none_below, none_above, .false., .true., 0.0_wp, .false., &
                     'position of the driving body at the start; without effect where its motion is given'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'driver_v0', 'm/s', none_below, none_above, .false., .true., 0.0_wp, .false., &
                     'velocity of the driving body at the start; without effect where its motion is given'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'blow', 'N s', none_below, none_above, .false., .true., 0.0_wp, .false., &
                     'impulse of a hammer on the driven body'), i=1, 2), &
    (parameter_row_t('body', bodies(i), 'blow_time', 's', 0.0_wp, none_above, .false., .true., 0.0_wp, .false., &
                     'time of the blow since the start'), i=1, 2), &
    parameter_row_t('drive', 'force', 'mean', 'N', none_below, none_above, .false., .true., 0.0_wp, .false., &
                    'mean force'), &
    parameter_row_t('drive', 'force', 'amplitude', 'N', 0.0_wp, none_above, .false., .false., 0.0_wp, .false., &
                    'amplitude of the force'), &
    parameter_row_t('drive', 'force', 'frequency', 'rad/s', 0.0_wp, none_above, .true., .false., 0.0_wp, .false., &
                    'angular frequency'), &
    (parameter_row_t('drive', at_speed(i), 'velocity', 'm/s', none_below, none_above, .false., .false., 0.0_wp, .false., &
                     'V'), i=1, 2), &
    (parameter_row_t('drive', sines(i), 'amplitude', 'm', 0.0_wp, none_above, .false., .false., 0.0_wp, .false., &
                     'X'), i=1, 2), &
    (parameter_row_t('drive', sines(i), 'frequency', 'rad/s', 0.0_wp, none_above, .true., .false., 0.0_wp, .false., &
                     'W'), i=1, 2), &
    (parameter_row_t('drive', controllers(i), 'proportional', 'N/m', 0.0_wp, none_above, .true., .false., 0.0_wp, .false., &
                     'force per error of position'), i=1, 2), &
    (parameter_row_t('drive', controllers(i), 'integral', 'N/(ms)', 0.0_wp, none_above, .false., .true., 0.0_wp, .false., &
                     'force per integral of the error'), i=1, 2), &
    (parameter_row_t('drive', controllers(i), 'derivative', 'N s/m', 0.0_wp, none_above, .false., .true., 0.0_wp, .false., &
                     'force per error of velocity'), i=1, 2), &
    (parameter_row_t('drive', controllers(i), 'sample_time', 's', 0.0_wp, none_above, .false., .true., 0.0_wp, .false., &
                     'time between samples of the controller; 0 = continuous'), i=1, 2)]

end module pair_rows
