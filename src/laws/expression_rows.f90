! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Catalogue rows of the laws by expressions. The expressions, and the parameters that they name, stand in the case.
module expression_rows
  use law_row, only: any_value, law_row_t, none_above, none_below, parameter_row_t
  implicit none
  private

  type(law_row_t), parameter, public :: expression_laws(*) = [ &
    law_row_t('restoring', 'expression', 'any force [N], an expression `force` of x, v, t, phase, states', ''), &
    law_row_t('friction', 'expression', 'opposes v: an expression `force` of speed = |v|; its value at rest is the static limit', &
              ''), &
    law_row_t('contact', 'expression', 'rigid barrier, an expression `restitution` of the impact speed', ''), &
    law_row_t('drive', 'expression', 'foot x_A: an expression `position` of t, phase; `period`: a time or an expression', ''), &
    law_row_t('force', 'expression', 'any force [N], an expression `force` of x, v, t, phase, states', ''), &
    law_row_t('state', 'expression', 'at most 8, with an expression `rate` of x, v, t, phase, states, and a `start`', '')]

  type(parameter_row_t), parameter, public :: expression_parameters(*) = [ &
    parameter_row_t('contact', 'expression', 'upper', 'm', any_value, 'upper barrier', optional=.true., default=none_above), &
    parameter_row_t('contact', 'expression', 'lower', 'm', any_value, 'lower barrier', optional=.true., default=none_below)]

end module expression_rows
