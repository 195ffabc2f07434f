/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Atomic operations on 64-bit words in memory that several processes share. */
#include <sched.h>
#include <stdatomic.h>
#include <stdint.h>

_Static_assert(sizeof(_Atomic int64_t) == sizeof(int64_t), "atomic words must have no lock beside them");

/* Each word has a cache line of its own. */
enum { STRIDE = 8 };

static _Atomic int64_t *word(void *words, int index) {
  return (_Atomic int64_t *)((int64_t *)words + (int64_t)index * STRIDE);
}

int64_t separatrix_atomic_bytes(int count) { return (int64_t)count * STRIDE * (int64_t)sizeof(int64_t); }

int64_t separatrix_atomic_load(void *words, int index) { return atomic_load(word(words, index)); }

void separatrix_atomic_store(void *words, int index, int64_t value) {
  atomic_store(word(words, index), value);
}

/* Returns the value before the addition. */
int64_t separatrix_atomic_fetch_add(void *words, int index, int64_t value) {
  return atomic_fetch_add(word(words, index), value);
}

/* 1 if the word was 0 and is 1 now; a store of 0 unlocks. */
int separatrix_atomic_try_lock(void *words, int index) {
  int64_t expected = 0;
  return atomic_compare_exchange_strong(word(words, index), &expected, 1);
}

void separatrix_yield(void) { sched_yield(); }
