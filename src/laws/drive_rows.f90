! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Catalogue rows of the drives of one body.
module drive_rows
  use kinds, only: wp
  use law_row, only: any_value, law_row_t, none_above, not_negative, parameter_row_t, positive, range_t, zero_to_one
  implicit none
  private

  character(len=*), parameter, public :: lemes = 'Lemes et al., vibro-impact system with ideal excitation'

  !> Largest |angle| [rad]: beyond it the rounding of the angle shows in its sine.
  real(wp), parameter, public :: largest_angle = 1e4_wp

  type(law_row_t), parameter, public :: drive_laws(*) = [ &
    law_row_t('drive', 'none', 'the foot of the spring is at rest at x_A = 0', ''), &
    law_row_t('drive', 'harmonic', 'x_A = mean + amplitude cos(phi + angle)', 'Den Hartog, Trans. ASME 53 (1931)'), &
    law_row_t('drive', 'fourier', 'x_A = mean + sum a_n cos n(phi + angle) + b_n sin n(phi + angle)', &
              'calibrated stand-in for the drive of Lemes et al.'), &
    law_row_t('drive', 'crank_lever_rod', 'crank OD turns the slotted lever CE, rod EA pushes the foot along a guide', &
              'geometry derived from '//lemes), &
    law_row_t('drive', 'measured_force', 'force of a record on the body, linear between samples; repeats as `periodic` sets', &
              'Janot, Gautier, Brunot, Data Set and Reference Models of EMPS (2019)')]

  type(parameter_row_t), parameter, public :: drive_parameters(*) = [ &
    parameter_row_t('drive', 'harmonic', 'ratio', '1', positive, &
                    'drive angular frequency over the natural angular frequency sqrt(c/m)', optional=.true., &
                    default=none_above), &
    parameter_row_t('drive', 'harmonic', 'frequency', 'rad/s', positive, 'angular frequency, in place of the ratio', &
                    optional=.true., default=none_above), &
    parameter_row_t('drive', 'harmonic', 'mean', 'm', any_value, 'mean position of the foot of the spring', &
                    optional=.true.), &
    parameter_row_t('drive', 'harmonic', 'amplitude', 'm', not_negative, 'amplitude of the foot'), &
    parameter_row_t('drive', 'harmonic', 'angle', 'rad', range_t(-largest_angle, largest_angle), &
                    'offset added to the crank angle', optional=.true.), &
    parameter_row_t('drive', 'fourier', 'ratio', '1', positive, &
                    'drive angular frequency over the natural angular frequency sqrt(c/m)', optional=.true., &
                    default=none_above), &
    parameter_row_t('drive', 'fourier', 'frequency', 'rad/s', positive, 'angular frequency, in place of the ratio', &
                    optional=.true., default=none_above), &
    parameter_row_t('drive', 'fourier', 'mean', 'm', any_value, 'mean position of the foot of the spring', &
                    optional=.true.), &
    parameter_row_t('drive', 'fourier', 'cosine', 'm', any_value, 'a_1, a_2, ...', list=.true.), &
    parameter_row_t('drive', 'fourier', 'sine', 'm', any_value, 'b_1, b_2, ..., as many as cosine has', list=.true.), &
    parameter_row_t('drive', 'fourier', 'angle', 'rad', range_t(-largest_angle, largest_angle), &
                    'offset added to the crank angle', optional=.true.), &
    parameter_row_t('drive', 'crank_lever_rod', 'ratio', '1', positive, &
                    'drive angular frequency over the natural angular frequency sqrt(c/m)', optional=.true., &
                    default=none_above), &
    parameter_row_t('drive', 'crank_lever_rod', 'frequency', 'rad/s', positive, 'angular frequency, in place of the ratio', &
                    optional=.true., default=none_above), &
    parameter_row_t('drive', 'crank_lever_rod', 'crank', 'm', positive, 'r = OD'), &
    parameter_row_t('drive', 'crank_lever_rod', 'pivot_distance', 'm', positive, 'l1 = OC, longer than the crank'), &
    parameter_row_t('drive', 'crank_lever_rod', 'lever', 'm', positive, 'l2 = CE'), &
    parameter_row_t('drive', 'crank_lever_rod', 'rod', 'm', positive, 'l3 = EA'), &
    parameter_row_t('drive', 'crank_lever_rod', 'pivot_angle', 'rad', range_t(-largest_angle, largest_angle), &
                    'B, direction of O seen from C against the guide'), &
    parameter_row_t('drive', 'crank_lever_rod', 'guide_height', 'm', any_value, &
                    'h, distance of the guide of A from C', optional=.true.), &
    parameter_row_t('drive', 'crank_lever_rod', 'side', '1', range_t(-1.0_wp, 1.0_wp), &
                    'sigma, +1 or -1: A is ahead of E or behind it', optional=.true., default=1.0_wp), &
    parameter_row_t('drive', 'crank_lever_rod', 'shift', 'm', any_value, 's, position of C on the axis of x', &
                    optional=.true.), &
    parameter_row_t('drive', 'crank_lever_rod', 'angle', 'rad', range_t(-largest_angle, largest_angle), &
                    'offset added to the crank angle', optional=.true.), &
    parameter_row_t('drive', 'measured_force', 'interval', 's', positive, &
                    'time between samples; from the file if the force is one'), &
    parameter_row_t('drive', 'measured_force', 'force', 'N', any_value, &
                    'samples from the start on, or the name of a CSV file with columns t and force', list=.true.), &
    parameter_row_t('drive', 'measured_force', 'periodic', '1', zero_to_one, &
                    '1: samples of one period, a last step leads back to the first; 0: up to the last', &
                    optional=.true.)]

end module drive_rows
