! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The contact laws of the catalogue: rigid barriers with a law of restitution, and soft ones with a force
!> over the penetration p.
module contact_rows
  use kinds, only: wp
  use law_row, only: law_length, law_row_t, none_above, none_below, parameter_row_t
  implicit none
  private

  integer :: i

  !> Laws K p^n (1 + d p'/speed) whose d comes from a restitution, by the formula named.
  character(len=law_length), parameter, public :: restitution_formulas(7) = [character(len=law_length) :: &
    'hunt_crossley_exact', 'hunt_crossley_1975', 'lankarani_nikravesh', 'herbert_mcwhannell', 'gonthier', 'flores', &
    'hu_guo']

  !> Laws K p^n, soft barriers, and every law with a barrier.
  character(len=law_length), parameter :: power_laws(8) = [character(len=law_length) :: &
    'hunt_crossley', restitution_formulas]
  character(len=law_length), parameter :: soft_laws(10) = [character(len=law_length) :: &
    'kelvin_voigt', 'kelvin_voigt_restitution', power_laws]
  character(len=law_length), parameter :: barrier_laws(14) = [character(len=law_length) :: &
    'newton', 'newton_linear', 'newton_power', 'newton_viscoelastic', soft_laws]

  character(len=*), parameter :: goldsmith = 'Goldsmith, Impact (1960)'
  character(len=*), parameter :: formula_meaning = 'K p^n (1 + d p''/speed), '

  type(law_row_t), parameter, public :: contact_laws(15) = [ &
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

  type(parameter_row_t), parameter, public :: contact_parameters(72) = [ &
    parameter_row_t('contact', 'newton', 'restitution', '1', 0.0_wp, 1.0_wp, .false., .false., 0.0_wp, .false., &
                    'k, ratio of the speeds after and before an impact'), &
    parameter_row_t('contact', 'newton_linear', 'slope', 's/m', 0.0_wp, none_above, .false., .false., 0.0_wp, .false., &
                    'alpha, loss of restitution per speed'), &
    parameter_row_t('contact', 'newton_power', 'restitution', '1', 0.0_wp, 1.0_wp, .false., .false., 0.0_wp, .false., &
                    'k up to the yield speed'), &
    parameter_row_t('contact', 'newton_power', 'yield_speed', 'm/s', 0.0_wp, none_above, .true., .false., 0.0_wp, .false., &
                    'impact speed above which the barrier yields'), &
    parameter_row_t('contact', 'newton_power', 'falloff', '1', 0.0_wp, 1.0_wp, .false., .true., 0.25_wp, .false., &
                    'exponent of the fall above the yield speed'), &
    parameter_row_t('contact', 'newton_viscoelastic', 'first', '1', 0.0_wp, none_above, .false., .false., 0.0_wp, .false., &
                    'g1, for v in m/s'), &
    parameter_row_t('contact', 'newton_viscoelastic', 'second', '1', 0.0_wp, none_above, .false., .true., 0.0_wp, .false., &
                    'g2, for v in m/s; spheres have g2 = 0.6 g1^2'), &
    (parameter_row_t('contact', soft_laws(i), 'stiffness', 'N/m^n', 0.0_wp, none_above, .true., .false., 0.0_wp, .false., &
                     'K'), i=1, size(soft_laws)), &
    (parameter_row_t('contact', power_laws(i), 'exponent', '1', 0.5_wp, 10.0_wp, .false., .true., 1.5_wp, .false., &
                     'n: 1 for flat surfaces, 1.5 for spheres (Hertz)'), i=1, size(power_laws)), &
    parameter_row_t('contact', 'kelvin_voigt', 'damping', 'N s/m', 0.0_wp, none_above, .false., .false., 0.0_wp, .false., &
                    'D'), &
    parameter_row_t('contact', 'hunt_crossley', 'damping', 's/m', 0.0_wp, none_above, .false., .false., 0.0_wp, .false., &
                    'a = lambda/K; 1/a bounds the speed of rebound'), &
    parameter_row_t('contact', 'kelvin_voigt_restitution', 'restitution', '1', 0.0_wp, 1.0_wp, .true., .false., 0.0_wp, .false., &
                    'e of a free body, released as `tension` says'), &
    (parameter_row_t('contact', restitution_formulas(i), 'restitution', '1', 0.0_wp, 1.0_wp, .true., .false., 0.0_wp, .false., &
                     'e that the formula is asked for'), i=1, size(restitution_formulas)), &
    (parameter_row_t('contact', restitution_formulas(i), 'speed', 'm/s', 0.0_wp, none_above, .false., .true., &
                     0.0_wp, .false., 'impact speed at which it is asked for: a = d/speed; 0 = that of each impact'), &
                     i=1, size(restitution_formulas)), &
    (parameter_row_t('contact', soft_laws(i), 'tension', '1', 0.0_wp, 1.0_wp, .false., .true., 1.0_wp, .false., &
                     '1: pulls until p = 0; 0: the force is cut off at zero'), i=1, 2), &
    (parameter_row_t('contact', barrier_laws(i), 'upper', 'm', none_below, none_above, .false., .true., none_above, .false., &
                     'position of the barrier above the body; no barrier if absent'), i=1, size(barrier_laws)), &
    (parameter_row_t('contact', barrier_laws(i), 'lower', 'm', none_below, none_above, .false., .true., none_below, .false., &
                     'position of the barrier below the body; no barrier if absent'), i=1, size(barrier_laws))]

end module contact_rows
