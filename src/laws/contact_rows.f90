! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The contact laws of the catalogue: rigid barriers with a law of restitution, and soft ones with a force
!> over the penetration p.
module contact_rows
  use kinds, only: wp
  use law_row, only: any_value, law_length, law_row_t, none_above, none_below, not_negative, parameter_row_t, positive, &
    positive_to_one, range_t, zero_to_one
  implicit none
  private

  integer :: i

  !> Laws K p^n (1 + d p'/speed) whose d comes from a restitution, by the formula named.
  character(len=law_length), parameter, public :: restitution_formulas(7) = [character(len=law_length) :: &
    'hunt_crossley_exact', 'hunt_crossley_1975', 'lankarani_nikravesh', 'herbert_mcwhannell', 'gonthier', 'flores', &
    'hu_guo']

  !> Laws K p + D p', laws K p^n, soft barriers, and every law with a barrier.
  character(len=law_length), parameter :: linear_laws(2) = [character(len=law_length) :: &
    'kelvin_voigt', 'kelvin_voigt_restitution']
  character(len=law_length), parameter :: power_laws(8) = [character(len=law_length) :: &
    'hunt_crossley', restitution_formulas]
  character(len=law_length), parameter :: soft_laws(10) = [character(len=law_length) :: linear_laws, power_laws]
  character(len=law_length), parameter :: barrier_laws(14) = [character(len=law_length) :: &
    'newton', 'newton_linear', 'newton_power', 'newton_viscoelastic', soft_laws]

  character(len=*), parameter :: goldsmith = 'Goldsmith, Impact (1960)'
  character(len=*), parameter :: formula_meaning = 'K p^n (1 + d p''/speed), '

  type(law_row_t), parameter, public :: contact_laws(*) = [ &
    law_row_t('contact', 'none', 'no barrier', ''), &
    law_row_t('contact', 'newton', 'rigid barrier: v+ = -k v-', 'Lemes et al., vibro-impact system with ideal excitation'), &
    law_row_t('contact', 'newton_linear', 'rigid barrier: k = 1 - alpha v, not below 0', &
              'Hunt, Crossley, J. Appl. Mech. 42 (1975)'), &
    law_row_t('contact', 'newton_power', 'rigid barrier: k up to yield_speed, above it k (v/yield_speed)^-falloff', &
              'Johnson, Contact Mechanics (1985), 11.5'), &
    law_row_t('contact', 'newton_viscoelastic', 'rigid barrier: k = 1 - g1 v^(1/5) + g2 v^(2/5), within 0 and 1', &
              'Ramirez, Poeschel, Brilliantov, Schwager, Phys. Rev. E 60 (1999) 4465'), &
    law_row_t('contact', 'kelvin_voigt', 'K p + D p''; jumps to D p'' at first touch', goldsmith), &
    law_row_t('contact', 'kelvin_voigt_restitution', 'K p + D p'' with the D that gives the free body a restitution', goldsmith), &
    law_row_t('contact', 'hunt_crossley', 'K p^n (1 + a p''), never pulls', 'Hunt, Crossley, J. Appl. Mech. 42 (1975)'), &
    law_row_t('contact', 'hunt_crossley_exact', formula_meaning//'ln(1+d) - ln(1-ed) = d(1+e)', &
              'compare Zhang, Sharf, J. Appl. Mech. 76 (2009)'), &
    law_row_t('contact', 'hunt_crossley_1975', formula_meaning//'d = 3(1-e)/2', 'Hunt, Crossley, J. Appl. Mech. 42 (1975)'), &
    law_row_t('contact', 'lankarani_nikravesh', formula_meaning//'d = 3(1-e^2)/4', &
              'Lankarani, Nikravesh, J. Mech. Des. 112 (1990)'), &
    law_row_t('contact', 'herbert_mcwhannell', formula_meaning//'d = 6(1-e)/((2e-1)^2+3)', &
              'Herbert, McWhannell, J. Eng. Ind. 99 (1977)'), &
    law_row_t('contact', 'gonthier', formula_meaning//'d = (1-e^2)/e', &
              'Gonthier, McPhee, Lange, Piedboeuf, Multibody Syst. Dyn. 11 (2004)'), &
    law_row_t('contact', 'flores', formula_meaning//'d = 8(1-e)/(5e)', &
              'Flores, Machado, Silva, Martins, Multibody Syst. Dyn. 25 (2011)'), &
    law_row_t('contact', 'hu_guo', formula_meaning//'d = 3(1-e)/(2e)', 'Hu, Guo, Int. J. Mech. Sci. 90 (2015)')]

  type(parameter_row_t), parameter, public :: contact_parameters(*) = [ &
    parameter_row_t('contact', 'newton', 'restitution', '1', zero_to_one, &
                    'k, ratio of the speeds after and before an impact'), &
    parameter_row_t('contact', 'newton_linear', 'slope', 's/m', not_negative, 'alpha, loss of restitution per speed'), &
    parameter_row_t('contact', 'newton_power', 'restitution', '1', zero_to_one, 'k up to the yield speed'), &
    parameter_row_t('contact', 'newton_power', 'yield_speed', 'm/s', positive, &
                    'impact speed above which the barrier yields'), &
    parameter_row_t('contact', 'newton_power', 'falloff', '1', zero_to_one, 'exponent of the fall above the yield speed', &
                    optional=.true., default=0.25_wp), &
    parameter_row_t('contact', 'newton_viscoelastic', 'first', '1', not_negative, 'g1, for v in m/s'), &
    parameter_row_t('contact', 'newton_viscoelastic', 'second', '1', not_negative, &
                    'g2, for v in m/s; spheres have g2 = 0.6 g1^2', optional=.true.), &
    (parameter_row_t('contact', linear_laws(i), 'stiffness', 'N/m', positive, 'K'), i=1, size(linear_laws)), &
    (parameter_row_t('contact', power_laws(i), 'stiffness', 'N/m^n', positive, 'K'), i=1, size(power_laws)), &
    (parameter_row_t('contact', power_laws(i), 'exponent', '1', range_t(0.5_wp, 10.0_wp), &
                     'n: 1 for flat surfaces, 1.5 for spheres (Hertz)', optional=.true., default=1.5_wp), i=1, size(power_laws)), &
    parameter_row_t('contact', 'kelvin_voigt', 'damping', 'N s/m', not_negative, 'D'), &
    parameter_row_t('contact', 'hunt_crossley', 'damping', 's/m', not_negative, &
                    'a = lambda/K; 1/a bounds the speed of rebound'), &
    parameter_row_t('contact', 'kelvin_voigt_restitution', 'restitution', '1', positive_to_one, &
                    'e of a free body, released as `tension` sets'), &
    (parameter_row_t('contact', restitution_formulas(i), 'restitution', '1', positive_to_one, &
                     'e that the formula is asked for'), i=1, size(restitution_formulas)), &
    (parameter_row_t('contact', restitution_formulas(i), 'speed', 'm/s', not_negative, &
                     'impact speed at which it is asked for: a = d/speed; 0 = that of each impact', optional=.true.), &
                     i=1, size(restitution_formulas)), &
    (parameter_row_t('contact', linear_laws(i), 'tension', '1', zero_to_one, &
                     '1: pulls until p = 0; 0: the force is cut off at zero', optional=.true., default=1.0_wp), &
                     i=1, size(linear_laws)), &
    (parameter_row_t('contact', barrier_laws(i), 'upper', 'm', any_value, &
                     'position of the barrier above the body; no barrier if absent', optional=.true., &
                     default=none_above), i=1, size(barrier_laws)), &
    (parameter_row_t('contact', barrier_laws(i), 'lower', 'm', any_value, &
                     'position of the barrier below the body; no barrier if absent', optional=.true., &
                     default=none_below), i=1, size(barrier_laws))]

end module contact_rows
