! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Catalogue rows of the laws by expressions. The expressions, and the parameters that they name, stand in the case.
module expression_rows
  use law_row, only: any_value, law_row_t, none_above, none_below, parameter_row_t
  implicit none
  private

  type(law_row_t), parameter, public :: expression_laws(*) = [ &
    law_row_t('restoring', 'expression', 'force = "..." of x, v, t, phase, states', ''), &
    law_row_t('friction', 'expression', 'force = "..." over speed = |v|, against v; its value at rest holds the body', ''), &
    law_row_t('contact', 'expression', 'rigid barrier: restitution = "..." over the impact speed', ''), &
    law_row_t('drive', 'expression', 'x_A = position = "..." over t, phase; period = time or "..."', ''), &
    law_row_t('force', 'expression', 'force = "..." of x, v, t, phase, states; any number [force.NAME]', ''), &
    law_row_t('state', 'expression', 'rate = "..." of x, v, t, phase, states; start = value; at most 8 [state.NAME]', '')]

  type(parameter_row_t), parameter, public :: expression_parameters(*) = [ &
    parameter_row_t('contact', 'expression', 'upper', 'm', any_value, 'upper barrier', optional=.true., default=none_above), &
    parameter_row_t('contact', 'expression', 'lower', 'm', any_value, 'lower barrier', optional=.true., default=none_below)]

end module expression_rows
