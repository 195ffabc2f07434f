! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The parts of a machine of several bodies: rows of the catalogue. A law is named 'table:law' after the table
!> [table.NAME] of a case file that it stands in.
module part_rows
  use contact_rows, only: contact_laws, contact_parameters
  use kinds, only: wp
  use law_row, only: any_value, law_length, law_row_t, none_above, none_below, not_negative, parameter_row_t, positive, &
    range_t, zero_to_one
  implicit none
  private

  integer :: i

  character(len=law_length), parameter :: bodies(2) = [character(len=law_length) :: 'body:watched', 'body:mass']
  character(len=law_length), parameter :: springs(5) = [character(len=law_length) :: 'spring:linear', 'spring:polynomial', &
    'spring:pendulum', 'spring:electrostatic', 'spring:expression']
  character(len=law_length), parameter :: frictions(12) = [character(len=law_length) :: 'friction:coulomb', &
    'friction:elastic_coulomb', 'friction:coulomb_viscous', 'friction:coulomb_stribeck', 'friction:coulomb_hyperbolic', &
    'friction:coulomb_quadratic', 'friction:coulomb_load', 'friction:maxwell_slip', 'friction:dahl', 'friction:bouc_wen', &
    'friction:lugre', 'friction:expression']
  character(len=law_length), parameter :: contacts(3) = [character(len=law_length) :: 'contact:newton', 'contact:kelvin_voigt', &
    'contact:massless']
  character(len=law_length), parameter :: joints(20) = [springs, frictions, contacts]
  !> Contacts with the laws of one body, which keep their parameters.
  type(law_row_t), parameter :: other_contacts(12) = [contact_laws(3:5), contact_laws(7:15)]
  type(parameter_row_t), parameter :: kept(64) = pack(contact_parameters, contact_parameters%law /= 'newton' .and. &
                                                                          contact_parameters%law /= 'kelvin_voigt')
  character(len=law_length), parameter :: drives(6) = [character(len=law_length) :: 'drive:force', 'drive:motion', &
    'drive:controller', 'drive:impulse', 'drive:expression', 'drive:base']
  character(len=1), parameter :: drive_unit(3) = ['N', 'm', 'm']
  character(len=law_length), parameter :: structures(2) = [character(len=law_length) :: 'structure:matrices', 'structure:modes']
  character(len=law_length), parameter :: points(2) = [character(len=law_length) :: 'point:watched', 'point:row']

  type(law_row_t), parameter, public :: part_laws(*) = [ &
    law_row_t('body', 'structure', 'several bodies and structures, with springs, joints and drives between them', &
              'Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, 1996'), &
    law_row_t('part', bodies(1), 'the body that x0, v0 and the results refer to: the first one, or watch.body', ''), &
    law_row_t('part', bodies(2), 'any other body', ''), &
    law_row_t('part', structures(1), 'linear structure M q'''' + C q'' + K q, of a file or written down row by row', ''), &
    law_row_t('part', structures(2), 'linear structure by its modes, mass-normalised', ''), &
    law_row_t('part', points(1), 'the point of a structure that x0, v0 and the results refer to', ''), &
    law_row_t('part', points(2), 'any other named point of a structure', ''), &
    law_row_t('part', springs(1), 'spring k and damper c between two bodies, or one and the ground', ''), &
    law_row_t('part', springs(2), 'k s + k2 s^2 + k3 s^3 and damper c; k < 0, k3 > 0 is a double well', &
              'Duffing, Erzwungene Schwingungen (1918)'), &
    law_row_t('part', springs(3), 'moment sin s of an angle s', 'Huygens, Horologium Oscillatorium (1673)'), &
    law_row_t('part', springs(4), 'attraction/(gap - s)^2 of two charged plates, s their way towards each other', &
              'Nathanson et al., IEEE Trans. Electron Devices 14 (1967)'), &
    law_row_t('part', springs(5), 'any force between two bodies, an expression `force` [N] of x, v, t, phase, NAME.x', ''), &
    law_row_t('part', frictions(1), 'dry friction between two bodies, or of one on the ground or a belt', ''), &
    law_row_t('part', frictions(2), 'spring and slider in series (Jenkins)', 'Gastaldi, Berruti, Appl. Sci. (2018)'), &
    law_row_t('part', frictions(3), 'dry friction and b u, u being the sliding speed', ''), &
    law_row_t('part', frictions(4), 'force + (static_force - force) exp(-|u/v_s|^delta)', &
              'Armstrong-Helouvry, Automatica 30 (1994)'), &
    law_row_t('part', frictions(5), 'force + (static_force - force)/(1 + |u|/v_f)', &
              'Galvanetto, Bishop, Chaos Solitons Fractals 5 (1995)'), &
    law_row_t('part', frictions(6), 'dry friction and d u|u|: drag of a fluid, a damper with an orifice', ''), &
    law_row_t('part', frictions(7), 'a coefficient times the normal force, an expression `load` [N]; none where that is negative', &
              'Amontons, Mem. Acad. R. Sci. (1699)'), &
    law_row_t('part', frictions(8), 'elements of spring and slider in parallel', 'Iwan, J. Appl. Mech. 33 (1966)'), &
    law_row_t('part', frictions(9), 'a deflection z: z'' = u |w|^n sgn w, w = 1 - sgn(u) z/z_m, z_m = force/stiffness', &
              'Dahl, AIAA J. 14 (1976)'), &
    law_row_t('part', frictions(10), 'a deflection z with z'' = u (1 - (a sgn(u z) + 1 - a) |z/z_m|^n), a the shape', &
              'Wen, J. Eng. Mech. Div. 102 (1976)'), &
    law_row_t('part', frictions(11), 'bristles: z'' = u - |u| s0 z/g(u), force s0 z + s1 z'' + s2 u', &
              'Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995)'), &
    law_row_t('part', frictions(12), 'an expression `force` [N] of speed, t, phase, NAME.x; none below 0', ''), &
    law_row_t('part', contacts(1), 'rigid stops of the distance of two bodies: v+ = -e v-, all that touch together', &
              'Glocker, Set-Valued Force Laws (2001)'), &
    law_row_t('part', contacts(2), 'stops with spring K and damper D', ''), &
    law_row_t('part', contacts(3), 'rigid stops met by a point without mass: no impacts, the modes left out give way', &
              'Monjaraz-Tec, Gross, Krack, J. Vib. Acoust. 144 (2022)'), &
    (law_row_t('part', 'contact:'//other_contacts(i)%name, other_contacts(i)%meaning, other_contacts(i)%source), i=1, 12), &
    law_row_t('part', drives(1), 'force on a body: mean + amplitude cos(phi + angle) + Fourier series', ''), &
    law_row_t('part', drives(2), 'given motion of a body: mean + amplitude cos(phi + angle) + series, or any `position`', ''), &
    law_row_t('part', drives(3), 'P e + I (integral of e) + D e'' on a body, e what it is short of such a motion', ''), &
    law_row_t('part', drives(4), 'impulse on a body at a time after the start', ''), &
    law_row_t('part', drives(5), 'any force on a body, an expression `force` [N] of t, phase, x, v, NAME.x', ''), &
    law_row_t('part', drives(6), 'the ground moves, an expression `position` [m] of t and phase; bodies are seen from it', '')]

  !> The ends of a part are numbers of reference points: bodies, then points of structures, in the order of the file, 0 the ground;
  !> of a drive, one of them.
  type(parameter_row_t), parameter, public :: part_parameters(*) = [ &
    parameter_row_t('body', 'structure', 'in_sequence', '1', zero_to_one, &
                    'impacts of several contacts at once: 0 all together by one law, 1 one after the other', &
                    optional=.true.), &
    (parameter_row_t('part', bodies(i), 'mass', 'kg', positive, 'mass; required, unless there is an inertia', &
                     optional=.true., default=none_above), i=1, 2), &
    (parameter_row_t('part', bodies(i), 'inertia', 'kg m^2', positive, &
                     'moment of inertia of a body that turns: its positions are angles', optional=.true., &
                     default=none_above), i=1, 2), &
    (parameter_row_t('part', bodies(i), 'load', 'N', any_value, 'constant force, a weight for instance', &
                     optional=.true.), i=1, 2), &
    parameter_row_t('part', bodies(2), 'x0', 'm', any_value, 'position at the start', optional=.true.), &
    parameter_row_t('part', bodies(2), 'v0', 'm/s', any_value, 'velocity at the start', optional=.true.), &
    parameter_row_t('part', structures(1), 'mass', '1', any_value, &
                    'M row by row, or the name of a Matrix Market file', list=.true.), &
    parameter_row_t('part', structures(1), 'stiffness', '1', any_value, 'K, likewise', list=.true.), &
    parameter_row_t('part', structures(2), 'frequency', 'rad/s', not_negative, &
                    'angular frequencies of the undamped modes; 0: rigid', list=.true.), &
    parameter_row_t('part', structures(2), 'damping_ratios', '1', not_negative, &
                    'of each mode; 1 and more: overdamped', optional=.true., list=.true.), &
    (parameter_row_t('part', structures(i), 'damping', '1', any_value, &
                     'C row by row, of any form, in the coordinates of the law', optional=.true., list=.true.), i=1, 2), &
    (parameter_row_t('part', structures(i), 'damping_ratio', '1', range_t(-1.0_wp, none_above), &
                     'of every mode, in place of any other damping; -1: none is given', optional=.true., &
                     default=-1.0_wp), i=1, 2), &
    (parameter_row_t('part', structures(i), 'x0', '1', any_value, &
                     'coordinates at the start, before the watched point is moved', optional=.true., list=.true.), i=1, 2), &
    (parameter_row_t('part', structures(i), 'v0', '1', any_value, 'their rates at the start', optional=.true., &
                     list=.true.), i=1, 2), &
    (parameter_row_t('part', points(i), 'structure', '1', not_negative, 'number of the structure', optional=.true.), i=1, 2), &
    (parameter_row_t('part', points(i), 'row', '1', any_value, 'its displacement for one of each coordinate', &
                     optional=.true., list=.true.), i=1, 2), &
    (parameter_row_t('part', joints(i), 'first_end', '1', not_negative, 'number of the first body between', &
                     optional=.true.), i=1, 20), &
    (parameter_row_t('part', joints(i), 'second_end', '1', not_negative, 'number of the second body between', &
                     optional=.true.), i=1, 20), &
    (parameter_row_t('part', 'contact:'//other_contacts(i)%name, 'first_end', '1', not_negative, &
                     'number of the first body between', optional=.true.), i=1, 12), &
    (parameter_row_t('part', 'contact:'//other_contacts(i)%name, 'second_end', '1', not_negative, &
                     'number of the second body between', optional=.true.), i=1, 12), &
    (parameter_row_t('part', 'contact:'//kept(i)%law, kept(i)%name, kept(i)%unit, kept(i)%range, kept(i)%meaning, &
                     kept(i)%optional, kept(i)%default, kept(i)%list), i=1, 64), &
    (parameter_row_t('part', springs(i), 'stiffness', 'N/m', any_value, 'k; may be negative', optional=.true.), i=1, 2), &
    parameter_row_t('part', springs(2), 'quadratic', 'N/m^2', any_value, 'k2', optional=.true.), &
    parameter_row_t('part', springs(2), 'cubic', 'N/m^3', any_value, 'k3', optional=.true.), &
    parameter_row_t('part', springs(3), 'moment', 'N m', any_value, &
                    'weight times distance of the centre of mass; negative for an inverted pendulum'), &
    parameter_row_t('part', springs(4), 'attraction', 'N m^2', any_value, &
                    'half of permittivity times area times voltage squared'), &
    parameter_row_t('part', springs(4), 'gap', 'm', positive, 's at which the plates would meet'), &
    (parameter_row_t('part', springs(i), 'modulation', '1', any_value, &
                     'force of the spring, not its damping, times 1 + modulation cos(phi) + Fourier series', &
                     optional=.true.), i=1, 4), &
    (parameter_row_t('part', springs(i), 'modulation_cosine', '1', any_value, &
                     'a_1, a_2, ... of cos(n phi), besides the modulation', optional=.true., list=.true.), i=1, 4), &
    (parameter_row_t('part', springs(i), 'modulation_sine', '1', any_value, 'b_1, b_2, ... of sin(n phi)', &
                     optional=.true., list=.true.), i=1, 4), &
    (parameter_row_t('part', springs(i), 'damping', 'N s/m', not_negative, 'c', optional=.true.), i=1, 4), &
    (parameter_row_t('part', springs(i), 'free_length', 'm', any_value, &
                     'second minus first where the spring is without force', optional=.true.), i=1, 4), &
    (parameter_row_t('part', frictions(i), 'force', 'N', not_negative, &
                     'friction while sliding; at high speed where it depends on the speed'), i=1, 6), &
    (parameter_row_t('part', frictions(i), 'static_force', 'N', not_negative, &
                     'friction at break-away; that of sliding if absent, never below it', optional=.true., &
                     default=-1.0_wp), i=1, 6), &
    (parameter_row_t('part', frictions(i), 'velocity', 'm/s', any_value, &
                     'velocity of the surface of the first body or the ground: a belt', optional=.true.), i=1, 12), &
    parameter_row_t('part', frictions(2), 'stiffness', 'N/m', positive, 'of the spring'), &
    parameter_row_t('part', frictions(3), 'damping', 'N s/m', not_negative, 'b'), &
    parameter_row_t('part', frictions(4), 'stribeck_velocity', 'm/s', positive, 'v_s'), &
    parameter_row_t('part', frictions(4), 'stribeck_exponent', '1', positive, 'delta', optional=.true., &
                    default=1.0_wp), &
    parameter_row_t('part', frictions(4), 'damping', 'N s/m', not_negative, 'b of a force b u beside it', optional=.true.), &
    parameter_row_t('part', frictions(5), 'fading_velocity', 'm/s', positive, 'v_f'), &
    parameter_row_t('part', frictions(6), 'drag', 'N s^2/m^2', not_negative, 'd'), &
    parameter_row_t('part', frictions(7), 'kinetic_coefficient', '1', not_negative, 'mu while sliding; at high speed'), &
    parameter_row_t('part', frictions(7), 'static_coefficient', '1', not_negative, &
                    'mu_s at break-away; the kinetic coefficient if absent, never below it', optional=.true., default=-1.0_wp), &
    parameter_row_t('part', frictions(7), 'stribeck_velocity', 'm/s', not_negative, &
                    'v_s of mu + (mu_s - mu) exp(-|u/v_s|^delta); 0: mu at every speed', optional=.true.), &
    parameter_row_t('part', frictions(7), 'stribeck_exponent', '1', positive, 'delta', optional=.true., default=1.0_wp), &
    parameter_row_t('part', frictions(7), 'damping', 'N s/m', not_negative, 'b of a force b u beside it', optional=.true.), &
    parameter_row_t('part', frictions(8), 'stiffness', 'N/m', positive, 'of the spring of each element', list=.true.), &
    parameter_row_t('part', frictions(8), 'force', 'N', positive, 'of the slider of each element', list=.true.), &
    (parameter_row_t('part', frictions(i), 'stiffness', 'N/m', positive, 's0, before sliding'), i=9, 11), &
    (parameter_row_t('part', frictions(i), 'force', 'N', positive, 'friction while sliding on; at high speed'), i=9, 11), &
    (parameter_row_t('part', frictions(i), 'exponent', '1', range_t(1.0_wp, 100.0_wp), 'n', optional=.true., &
                     default=1.0_wp), i=9, 10), &
    parameter_row_t('part', frictions(10), 'shape', '1', zero_to_one, 'a; 0.5: linear unloading', optional=.true., &
                    default=0.5_wp), &
    parameter_row_t('part', frictions(11), 'static_force', 'N', not_negative, &
                    'F_s of g; the force if absent, never below it', optional=.true., default=-1.0_wp), &
    parameter_row_t('part', frictions(11), 'stribeck_velocity', 'm/s', positive, 'v_s of g = F + (F_s - F) exp(-|u/v_s|^delta)', &
                    optional=.true., default=1.0_wp), &
    parameter_row_t('part', frictions(11), 'stribeck_exponent', '1', positive, 'delta', optional=.true., default=2.0_wp), &
    parameter_row_t('part', frictions(11), 'bristle_damping', 'N s/m', not_negative, 's1', optional=.true.), &
    parameter_row_t('part', frictions(11), 'damping', 'N s/m', not_negative, 's2', optional=.true.), &
    parameter_row_t('part', contacts(1), 'restitution', '1', zero_to_one, 'e'), &
    parameter_row_t('part', contacts(2), 'stiffness', 'N/m', positive, 'K'), &
    parameter_row_t('part', contacts(2), 'damping', 'N s/m', not_negative, 'D', optional=.true.), &
    parameter_row_t('part', contacts(3), 'stiffness', 'N/m', not_negative, &
                    'that of the modes which structure.NAME.modes leaves out, if 0', optional=.true.), &
    parameter_row_t('part', contacts(2), 'tension', '1', zero_to_one, '1: the force may pull, 0: it ends where it would', &
                    optional=.true.), &
    (parameter_row_t('part', contacts(i), 'upper', 'm', any_value, 'largest value of second minus first', &
                     optional=.true., default=none_above), i=1, 3), &
    (parameter_row_t('part', contacts(i), 'lower', 'm', any_value, 'smallest value of second minus first', &
                     optional=.true., default=none_below), i=1, 3), &
    (parameter_row_t('part', drives(i), 'body', '1', not_negative, 'number of the body', optional=.true.), i=1, 6), &
    (parameter_row_t('part', drives(i), 'frequency', 'rad/s', not_negative, &
                     'angular frequency; that of the first drive if absent', optional=.true.), i=1, 3), &
    (parameter_row_t('part', drives(i), 'mean', drive_unit(i), any_value, 'mean', optional=.true.), i=1, 3), &
    (parameter_row_t('part', drives(i), 'rate', 'm/s', any_value, 'constant velocity of a driving body', &
                     optional=.true.), i=2, 3), &
    (parameter_row_t('part', drives(i), 'amplitude', drive_unit(i), any_value, 'amplitude', optional=.true.), i=1, 3), &
    (parameter_row_t('part', drives(i), 'angle', 'rad', range_t(-1e4_wp, 1e4_wp), &
                     'added to the angle phi of the drive', optional=.true.), i=1, 3), &
    (parameter_row_t('part', drives(i), 'cosine', drive_unit(i), any_value, &
                     'a_1, a_2, ... of cos(n phi), besides the amplitude', optional=.true., list=.true.), i=1, 3), &
    (parameter_row_t('part', drives(i), 'sine', drive_unit(i), any_value, 'b_1, b_2, ... of sin(n phi)', &
                     optional=.true., list=.true.), i=1, 3), &
    parameter_row_t('part', drives(3), 'proportional', 'N/m', not_negative, 'P', optional=.true.), &
    parameter_row_t('part', drives(3), 'integral', 'N/(m s)', not_negative, 'I', optional=.true.), &
    parameter_row_t('part', drives(3), 'derivative', 'N s/m', not_negative, 'D', optional=.true.), &
    parameter_row_t('part', drives(3), 'sample_time', 's', not_negative, &
                    'time between samples, the force being held in between; 0: continuous', optional=.true.), &
    parameter_row_t('part', drives(4), 'impulse', 'N s', any_value, 'impulse'), &
    parameter_row_t('part', drives(4), 'time', 's', not_negative, 'after the start', optional=.true.), &
    (parameter_row_t('part', drives(i), 'frequency', 'rad/s', not_negative, &
                     'angular frequency of the phase; that of the first drive if absent', optional=.true.), i=5, 6)]

end module part_rows
