! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Effects that may be added to a machine of one body: the rows of the catalogue. Any number of them, each once.
module effect_rows
  use kinds, only: wp
  use law_row, only: any_value, effect_confusion_t, effect_trait_t, law_row_t, not_negative, parameter_row_t, positive, &
    range_t
  implicit none
  private

  public :: acts_at_barrier

  character(len=*), parameter :: sum_of_laws = 'sum of two laws'
  character(len=*), parameter :: sensor = 'what a sensor shows; the motion is the same'

  type(law_row_t), parameter, public :: effect_laws(*) = [ &
    law_row_t('effect', 'viscous', '-b v', sum_of_laws), &
    law_row_t('effect', 'coulomb', '-F sgn v; adds to sliding and to break-away friction', sum_of_laws), &
    law_row_t('effect', 'quadratic_drag', '-c v |v|', 'Nayfeh, Mook, Nonlinear Oscillations (1979)'), &
    law_row_t('effect', 'cubic_damping', '-c v^3', 'Elliott, Tehrani, Langley, Phil. Trans. R. Soc. A 373 (2015) 20140402'), &
    law_row_t('effect', 'stribeck', '-E exp(-|v/v_s|^n) sgn v; adds E to break-away friction', &
              'Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083'), &
    law_row_t('effect', 'static_excess', 'adds to break-away friction', 'Coulomb, Theorie des machines simples (1785)'), &
    law_row_t('effect', 'dahl', 'dry friction is -z, z'' = sigma (1 - z sgn(v)/Fc) v; no stick', &
              'Dahl, Aerospace Corp. TOR-0158 (1968)'), &
    law_row_t('effect', 'asymmetric_friction', '-a - b |v| while sliding; sticks up to Fs + a upwards, Fs - a downwards', &
              'Janot, Gautier, Brunot, Data Set and Reference Models of EMPS (2019)'), &
    law_row_t('effect', 'position_dependent_friction', 'dry friction times max(0, 1 + slope x)', &
              'Armstrong-Helouvry, Control of Machines with Friction (1991)'), &
    law_row_t('effect', 'friction_curve', '-change(|v|) sgn v, of each direction its own: a table over the speed, C1', &
              'Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083'), &
    law_row_t('effect', 'friction_position_curve', 'dry friction times max(0, 1 + change(x)): a table over the position, C1', &
              'Armstrong-Helouvry, Control of Machines with Friction (1991)'), &
    law_row_t('effect', 'cubic_spring', 'k3 s^3, s = l0 + x_A - x', 'Duffing, Erzwungene Schwingungen (1918)'), &
    law_row_t('effect', 'spring_curve', 'q(s), a force over the extension s = l0 + x_A - x: a table, C1', &
              'Nayfeh, Mook, Nonlinear Oscillations (1979)'), &
    law_row_t('effect', 'backlash', 'free play in series with the spring: no force within the gap', &
              'Kahraman, Singh, J. Sound Vib. 142 (1990) 49'), &
    law_row_t('effect', 'force_curve', 'r(x), a force over the position: a table, C1', sum_of_laws), &
    law_row_t('effect', 'offset_force', 'constant force: preload or tilt', sum_of_laws), &
    law_row_t('effect', 'restitution_slope', 'k falls with the speed of impact: k - slope |v|, not below 0', &
              'Goldsmith, Impact (1960)'), &
    law_row_t('effect', 'restitution_curve', 'k + change(|v|), between 0 and 1: a table over the speed of impact, C1', &
              'Goldsmith, Impact (1960)'), &
    law_row_t('effect', 'compliant_contact', 'rigid barriers become soft: K p^n (1 + a p''), never pulls', &
              'Hunt, Crossley, J. Appl. Mech. 42 (1975)'), &
    law_row_t('effect', 'kelvin_voigt_contact', 'rigid barriers become soft: K p + D p'', never pulls', &
              'Goldsmith, Impact (1960)'), &
    law_row_t('effect', 'contact_curve', 'rigid barriers become soft: q(p) (1 + a p''), q a table from q(0) = 0 on, never pulls', &
              'Hunt, Crossley, J. Appl. Mech. 42 (1975)'), &
    law_row_t('effect', 'contact_hardening', 'the force K p^n of soft barriers becomes K p^n (p/p0)^c, their damping stays', &
              'Johnson, Contact Mechanics (1985)'), &
    law_row_t('effect', 'second_barrier', 'a barrier on the free side, with the same law', sum_of_laws), &
    law_row_t('effect', 'drive_ripple', 'crank angle phi + sine sin(n phi) + cosine cos(n phi) in place of phi', &
              'Kononenko, Vibrating Systems with a Limited Power Supply (1969)'), &
    law_row_t('effect', 'drive_harmonics', 'foot moves by sum a_n cos n phi + b_n sin n phi more', sum_of_laws), &
    law_row_t('effect', 'sensor_bias', 'a record shows x + bias', sensor), &
    law_row_t('effect', 'sensor_gain', 'a record shows (1 + gain) x', sensor), &
    law_row_t('effect', 'sensor_delay', 'a record shows x(t - delay)', sensor)]

  type(parameter_row_t), parameter, public :: effect_parameters(*) = [ &
    parameter_row_t('effect', 'viscous', 'damping', 'N s/m', not_negative, 'b'), &
    parameter_row_t('effect', 'coulomb', 'force', 'N', not_negative, 'F'), &
    parameter_row_t('effect', 'quadratic_drag', 'coefficient', 'N s^2/m^2', not_negative, 'c'), &
    parameter_row_t('effect', 'cubic_damping', 'coefficient', 'N s^3/m^3', not_negative, 'c'), &
    parameter_row_t('effect', 'stribeck', 'excess', 'N', not_negative, &
                    'E, friction at zero speed above that at high speed'), &
    parameter_row_t('effect', 'stribeck', 'velocity', 'm/s', positive, 'v_s'), &
    parameter_row_t('effect', 'stribeck', 'exponent', '1', positive, 'n', optional=.true., default=2.0_wp), &
    parameter_row_t('effect', 'static_excess', 'force', 'N', not_negative, &
                    'friction at break-away above that of the machine'), &
    parameter_row_t('effect', 'dahl', 'stiffness', 'N/m', positive, &
                    'sigma, stiffness of the friction before it slides'), &
    parameter_row_t('effect', 'asymmetric_friction', 'coulomb', 'N', any_value, &
                    'a, dry friction upwards above the mean of both directions; at most that mean', optional=.true.), &
    parameter_row_t('effect', 'asymmetric_friction', 'viscous', 'N s/m', any_value, &
                    'b, viscous friction upwards above the mean of both directions', optional=.true.), &
    parameter_row_t('effect', 'position_dependent_friction', 'slope', '1/m', any_value, &
                    'relative change of dry friction per length'), &
    parameter_row_t('effect', 'friction_curve', 'speed', 'm/s', not_negative, &
                    'sliding speeds, ascending; straight on beyond the first and the last', list=.true.), &
    parameter_row_t('effect', 'friction_curve', 'upwards', 'N', any_value, &
                    'change of the friction at these speeds upwards; at speed 0 also of break-away', list=.true.), &
    parameter_row_t('effect', 'friction_curve', 'downwards', 'N', any_value, 'the same downwards', list=.true.), &
    parameter_row_t('effect', 'friction_position_curve', 'position', 'm', any_value, &
                    'positions, ascending; straight on beyond the first and the last', list=.true.), &
    parameter_row_t('effect', 'friction_position_curve', 'change', '1', any_value, &
                    'relative change of dry friction at these positions', list=.true.), &
    parameter_row_t('effect', 'cubic_spring', 'stiffness', 'N/m^3', any_value, 'k3'), &
    parameter_row_t('effect', 'spring_curve', 'extension', 'm', any_value, &
                    'extensions, ascending; straight on beyond the first and the last', list=.true.), &
    parameter_row_t('effect', 'spring_curve', 'force', 'N', any_value, &
                    'force beyond that of the spring at these extensions', list=.true.), &
    parameter_row_t('effect', 'backlash', 'gap', 'm', not_negative, &
                    'g, extension from one end of the play to the other'), &
    parameter_row_t('effect', 'backlash', 'rounding', '1', range_t(0.0_wp, 0.49_wp), &
                    'e/g: parabolas round the corners of the force within e of them; 0 = sharp corners', optional=.true.), &
    parameter_row_t('effect', 'force_curve', 'position', 'm', any_value, &
                    'positions, ascending; straight on beyond the first and the last', list=.true.), &
    parameter_row_t('effect', 'force_curve', 'force', 'N', any_value, 'force upwards at these positions', list=.true.), &
    parameter_row_t('effect', 'offset_force', 'force', 'N', any_value, 'constant force upwards'), &
    parameter_row_t('effect', 'restitution_slope', 'slope', 's/m', not_negative, 'loss of restitution per speed'), &
    parameter_row_t('effect', 'restitution_curve', 'speed', 'm/s', not_negative, &
                    'speeds of impact, ascending; constant beyond the first and the last', list=.true.), &
    parameter_row_t('effect', 'restitution_curve', 'change', '1', range_t(-1.0_wp, 1.0_wp), &
                    'change of the restitution at these speeds', list=.true.), &
    parameter_row_t('effect', 'compliant_contact', 'stiffness', 'N/m^n', positive, 'K'), &
    parameter_row_t('effect', 'compliant_contact', 'damping', 's/m', not_negative, &
                    'a = lambda/K; 1/a bounds the speed of rebound', optional=.true.), &
    parameter_row_t('effect', 'compliant_contact', 'exponent', '1', range_t(0.5_wp, 10.0_wp), &
                    'n: 1 for flat surfaces, 1.5 for spheres (Hertz)', optional=.true., default=1.5_wp), &
    parameter_row_t('effect', 'kelvin_voigt_contact', 'stiffness', 'N/m', positive, 'K'), &
    parameter_row_t('effect', 'kelvin_voigt_contact', 'damping', 'N s/m', not_negative, 'D', optional=.true.), &
    parameter_row_t('effect', 'contact_curve', 'penetration', 'm', positive, &
                    'penetrations above 0, ascending; straight on beyond the last', list=.true.), &
    parameter_row_t('effect', 'contact_curve', 'force', 'N', not_negative, 'force at these penetrations', list=.true.), &
    parameter_row_t('effect', 'contact_curve', 'damping', 's/m', not_negative, 'a; 1/a bounds the speed of rebound', &
                    optional=.true.), &
    parameter_row_t('effect', 'contact_hardening', 'change', '1', range_t(-0.5_wp, 9.0_wp), &
                    'c, change of the exponent n of the force over the penetration'), &
    parameter_row_t('effect', 'contact_hardening', 'penetration', 'm', positive, &
                    'p0, the penetration at which the force stays the same'), &
    parameter_row_t('effect', 'second_barrier', 'position', 'm', any_value, &
                    'below an upper barrier, or above a lower one'), &
    parameter_row_t('effect', 'drive_ripple', 'sine', 'rad', any_value, &
                    'ripple of the crank angle in phase with sin(n phi)'), &
    parameter_row_t('effect', 'drive_ripple', 'cosine', 'rad', any_value, &
                    'ripple of the crank angle in phase with cos(n phi)', optional=.true.), &
    parameter_row_t('effect', 'drive_ripple', 'harmonic', '1', range_t(1.0_wp, 64.0_wp), 'n, a whole number', &
                    optional=.true., default=1.0_wp), &
    parameter_row_t('effect', 'drive_harmonics', 'cosine', 'm', any_value, 'a_1, a_2, ...', list=.true.), &
    parameter_row_t('effect', 'drive_harmonics', 'sine', 'm', any_value, 'b_1, b_2, ..., as many as cosine has', &
                    list=.true.), &
    parameter_row_t('effect', 'sensor_bias', 'bias', 'm', any_value, 'added to the position'), &
    parameter_row_t('effect', 'sensor_gain', 'gain', '1', any_value, 'relative error of the scale'), &
    parameter_row_t('effect', 'sensor_delay', 'delay', 's', any_value, &
                    'of the sensor behind the drive; negative if it is ahead')]

  character(len=*), parameter :: over_speed = 'friction over speed', over_impacts = 'restitution over impact speed', &
    over_extension = 'spring over extension', over_penetration = 'contact over penetration', over_phase = 'drive over phase'

  type(effect_trait_t), parameter, public :: effect_traits(size(effect_laws)) = [ &
    effect_trait_t('viscous', over_speed, 'flight', 'damping', '', ''), &
    effect_trait_t('coulomb', over_speed, 'flight', 'force', '', ''), &
    effect_trait_t('quadratic_drag', over_speed, 'flight', 'coefficient', '', ''), &
    effect_trait_t('cubic_damping', over_speed, 'flight', 'coefficient', '', ''), &
    effect_trait_t('stribeck', over_speed, 'flight', 'excess', 'velocity', ''), &
    effect_trait_t('static_excess', over_speed, 'flight', '', 'force', ''), &
    effect_trait_t('dahl', 'friction before sliding', 'flight', '', 'stiffness', 'friction'), &
    effect_trait_t('asymmetric_friction', 'friction by direction', 'flight', 'coulomb viscous', '', ''), &
    effect_trait_t('position_dependent_friction', 'friction over position', 'flight', 'slope', '', 'friction'), &
    effect_trait_t('friction_curve', over_speed, 'flight', 'upwards downwards', '', ''), &
    effect_trait_t('friction_position_curve', 'friction over position', 'flight', 'change', '', 'friction'), &
    effect_trait_t('cubic_spring', over_extension, 'flight', 'stiffness', '', ''), &
    effect_trait_t('spring_curve', over_extension, 'flight', 'force', '', ''), &
    effect_trait_t('backlash', over_extension, 'flight', '', 'gap', 'restoring.stiffness'), &
    effect_trait_t('force_curve', 'force over position', 'flight', 'force', '', ''), &
    effect_trait_t('offset_force', 'constant force', 'flight', 'force', '', ''), &
    effect_trait_t('restitution_slope', over_impacts, 'barrier', 'slope', '', 'contact.restitution'), &
    effect_trait_t('restitution_curve', over_impacts, 'barrier', 'change', '', 'contact.restitution'), &
    effect_trait_t('compliant_contact', over_penetration, 'barrier', '', 'stiffness damping', 'contact.restitution'), &
    effect_trait_t('kelvin_voigt_contact', over_penetration, 'barrier', '', 'stiffness damping', 'contact.restitution'), &
    effect_trait_t('contact_curve', over_penetration, 'barrier', 'force', '', 'contact.restitution'), &
    effect_trait_t('contact_hardening', over_penetration, 'barrier', 'change', '', 'contact.stiffness'), &
    effect_trait_t('second_barrier', 'contact over position', 'barrier', '', '', 'contact.restitution'), &
    effect_trait_t('drive_ripple', over_phase, 'flight', 'sine cosine', '', 'drive.ratio'), &
    effect_trait_t('drive_harmonics', over_phase, 'flight', 'cosine sine', '', 'drive.ratio'), &
    effect_trait_t('sensor_bias', 'sensor', 'sensor', 'bias', '', ''), &
    effect_trait_t('sensor_gain', 'sensor', 'sensor', 'gain', '', ''), &
    effect_trait_t('sensor_delay', 'sensor', 'sensor', 'delay', '', '')]

  character(len=*), parameter :: sliding = &
    'while the body slides, friction that differs with the direction by a constant is a constant force'
  character(len=*), parameter :: shift = 'where the position of the barrier is fitted, a shifted sensor is a constant force'
  character(len=*), parameter :: scale = &
    'where friction, barrier and the scale of the drive are fitted, a gain of the sensor is a constant force'

  type(effect_confusion_t), parameter, public :: effect_confusions(*) = [ &
    effect_confusion_t('asymmetric_friction', 'offset_force', sliding), &
    effect_confusion_t('asymmetric_friction', 'sensor_bias', shift), &
    effect_confusion_t('asymmetric_friction', 'sensor_gain', scale), &
    effect_confusion_t('offset_force', 'sensor_bias', shift), &
    effect_confusion_t('offset_force', 'sensor_gain', scale), &
    effect_confusion_t('sensor_bias', 'sensor_gain', scale)]

contains

  !> Whether the effect `name` changes nothing but what happens at the barriers.
  pure elemental logical function acts_at_barrier(name)
    character(len=*), intent(in) :: name
    acts_at_barrier = any(effect_traits%name == name .and. effect_traits%acts == 'barrier')
  end function acts_at_barrier

end module effect_rows
