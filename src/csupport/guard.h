/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef SEPARATRIX_GUARD_H
#define SEPARATRIX_GUARD_H

/* Where messages go, also while a guard silences standard error. For handlers of signals. */
int separatrix_guard_messages(void);

#endif
