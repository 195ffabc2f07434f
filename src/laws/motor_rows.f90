! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Catalogue rows of the family `motor`, and of the mechanisms that only a motor drives.
module motor_rows
  use law_row, only: any_value, law_length, law_row_t, not_negative, parameter_row_t, positive, range_t
  use kinds, only: wp
  implicit none
  private

  character(len=*), parameter :: kononenko = 'Kononenko, Vibrating Systems with a Limited Power Supply (1969)'
  integer, parameter :: count = 5
  character(len=law_length), parameter :: names(count) = [character(len=law_length) :: 'linear', 'kloss', 'dc', 'pi', &
                                                                            'table']

  type(law_row_t), parameter, public :: motor_laws(*) = [ &
    law_row_t('motor', 'linear', 'torque M0 (1 - w/w0)', kononenko), &
    law_row_t('motor', 'kloss', 'induction motor: 2 M s sb/(s^2 + sb^2), slip s = 1 - w/ws', &
              'Kloss, Arch. Elektrotech. 5 (1916) 59'), &
    law_row_t('motor', 'dc', 'torque k i; L i'' = U - R i - k w', kononenko), &
    law_row_t('motor', 'pi', 'speed control: torque Kp (wr - w) + Ki z; z'' = wr - w', &
              'Astrom, Hagglund, PID Controllers (1995)'), &
    law_row_t('motor', 'table', 'measured torque-speed table, interpolated with a continuous slope', kononenko), &
    law_row_t('drive', 'slider_crank', 'crank and rod move the foot along a guide through the crank axis; needs a motor', &
              'Reuleaux, Theoretische Kinematik (1875)'), &
    law_row_t('drive', 'unbalance', 'unbalanced rotor on the body; needs a motor', 'Sommerfeld, Z. Ver. Dtsch. Ing. 46 (1902)')]

  integer :: i
  type(parameter_row_t), parameter :: own_parameters(*) = [ &
    parameter_row_t('motor', 'linear', 'stall_torque', 'N m', not_negative, 'M0, torque at standstill'), &
    parameter_row_t('motor', 'linear', 'no_load_speed', 'rad/s', positive, 'w0, speed at zero torque'), &
    parameter_row_t('motor', 'kloss', 'breakdown_torque', 'N m', positive, 'M, largest torque'), &
    parameter_row_t('motor', 'kloss', 'breakdown_slip', '1', positive, 'sb, slip at the largest torque'), &
    parameter_row_t('motor', 'kloss', 'synchronous_speed', 'rad/s', positive, 'ws, speed at zero torque'), &
    parameter_row_t('motor', 'dc', 'voltage', 'V', any_value, 'U'), &
    parameter_row_t('motor', 'dc', 'torque_constant', 'N m/A', positive, 'k, torque per current; also back-EMF per speed'), &
    parameter_row_t('motor', 'dc', 'resistance', 'ohm', positive, 'R'), &
    parameter_row_t('motor', 'dc', 'inductance', 'H', not_negative, 'L; 0: the current follows instantly', optional=.true.), &
    parameter_row_t('motor', 'dc', 'start_current', 'A', any_value, 'current at the start, with an inductance', optional=.true.), &
    parameter_row_t('motor', 'pi', 'start_integral', 'rad', any_value, 'z at the start', optional=.true.), &
    parameter_row_t('motor', 'pi', 'proportional', 'N m s', not_negative, 'Kp'), &
    parameter_row_t('motor', 'pi', 'integral', 'N m', not_negative, 'Ki'), &
    parameter_row_t('motor', 'pi', 'reference', 'rad/s', positive, 'wr, reference speed'), &
    parameter_row_t('motor', 'pi', 'torque_limit', 'N m', not_negative, 'largest torque in either direction; 0: no limit', &
                    optional=.true.), &
    parameter_row_t('motor', 'table', 'speed', 'rad/s', any_value, 'knots of the table, ascending, at most 16', list=.true.), &
    parameter_row_t('motor', 'table', 'torque', 'N m', any_value, &
                    'torque at these speeds; it falls through 0 at a positive speed', list=.true.), &
    parameter_row_t('motor', 'linear', 'ramp_from', 'rad/s', not_negative, 'no_load_speed at the start of a ramp', &
                    optional=.true.), &
    parameter_row_t('motor', 'kloss', 'ramp_from', 'rad/s', not_negative, 'synchronous_speed at the start of a ramp', &
                    optional=.true.), &
    parameter_row_t('motor', 'dc', 'ramp_from', 'V', any_value, 'voltage at the start of a ramp', optional=.true.), &
    parameter_row_t('motor', 'pi', 'ramp_from', 'rad/s', not_negative, 'reference at the start of a ramp', optional=.true.), &
    (parameter_row_t('motor', names(i), 'ramp_time', 's', not_negative, 'duration of the ramp, linear in time; 0: none', &
                     optional=.true.), i=1, 4)]

  type(parameter_row_t), parameter :: inertias(*) = [ &
    (parameter_row_t('motor', names(i), 'inertia', 'kg m^2', positive, &
                     'rotor, gear and crank about the crank axis; of an unbalance including its mass'), i=1, count), &
    (parameter_row_t('motor', names(i), 'lever_inertia', 'kg m^2', not_negative, 'lever about its pivot C', optional=.true.), &
     i=1, count), &
    (parameter_row_t('motor', names(i), 'rod_mass', 'kg', not_negative, 'rod of a lever mechanism, centre of mass in the middle', &
                     optional=.true.), i=1, count), &
    (parameter_row_t('motor', names(i), 'rod_inertia', 'kg m^2', not_negative, 'the same rod about its centre of mass', &
                     optional=.true.), i=1, count), &
    (parameter_row_t('motor', names(i), 'foot_mass', 'kg', not_negative, 'mass that moves with the foot of the spring', &
                     optional=.true.), i=1, count), &
    (parameter_row_t('motor', names(i), 'bearing_damping', 'N m s', not_negative, 'h, torque per speed', &
                     optional=.true.), i=1, count), &
    (parameter_row_t('motor', names(i), 'bearing_friction', 'N m', not_negative, 'H0, dry friction torque', optional=.true.), &
     i=1, count), &
    (parameter_row_t('motor', names(i), 'crank_speed', 'rad/s', any_value, 'speed of the crank at the start', &
                     optional=.true.), i=1, count)]

  type(parameter_row_t), parameter :: mechanism_parameters(*) = [ &
    parameter_row_t('drive', 'slider_crank', 'crank', 'm', positive, 'r'), &
    parameter_row_t('drive', 'slider_crank', 'rod', 'm', positive, 'l, longer than the crank'), &
    parameter_row_t('drive', 'slider_crank', 'mean', 'm', any_value, 'x_A = mean + r cos phi + sqrt(l^2 - r^2 sin^2 phi) - l', &
                    optional=.true.), &
    parameter_row_t('drive', 'slider_crank', 'angle', 'rad', range_t(-1e4_wp, 1e4_wp), 'offset added to the crank angle', &
                    optional=.true.), &
    parameter_row_t('drive', 'unbalance', 'moment', 'kg m', positive, 'm_e, mass times eccentricity')]

  type(parameter_row_t), parameter, public :: motor_parameters(size(own_parameters) + size(inertias) + &
                                                               size(mechanism_parameters)) = &
    [own_parameters, inertias, mechanism_parameters]

end module motor_rows
