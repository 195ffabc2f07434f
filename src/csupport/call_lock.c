/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* One lock of the process, for calls of the library. */
#include <pthread.h>

static pthread_mutex_t calls = PTHREAD_MUTEX_INITIALIZER;

void separatrix_lock_calls(void) { pthread_mutex_lock(&calls); }

void separatrix_unlock_calls(void) { pthread_mutex_unlock(&calls); }
