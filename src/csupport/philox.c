/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Philox4x32-10, the counter-based generator of Salmon et al., "Parallel random numbers: as easy as
   1, 2, 3", SC11: the numbers are a pure function of key and counter. */
#include <stdint.h>

static void philox_round(uint32_t c[4], uint32_t key0, uint32_t key1) {
  const uint64_t product0 = (uint64_t)0xD2511F53u * c[0];
  const uint64_t product1 = (uint64_t)0xCD9E8D57u * c[2];
  const uint32_t high0 = (uint32_t)(product0 >> 32), high1 = (uint32_t)(product1 >> 32);
  const uint32_t c1 = c[1], c3 = c[3];
  c[0] = high1 ^ c1 ^ key0;
  c[1] = (uint32_t)product1;
  c[2] = high0 ^ c3 ^ key1;
  c[3] = (uint32_t)product0;
}

/* The four words that belong to a counter of four words and a key of two. */
void separatrix_philox(const uint32_t counter[4], const uint32_t key[2], uint32_t out[4]) {
  uint32_t key0 = key[0], key1 = key[1];
  for (int i = 0; i < 4; i++)
    out[i] = counter[i];
  for (int i = 0; i < 10; i++) {
    philox_round(out, key0, key1);
    key0 += 0x9E3779B9u;
    key1 += 0xBB67AE85u;
  }
}

/* `count` numbers of 53 bits in [0, 1) that belong to (seed, counter). */
void separatrix_uniform(int64_t seed, int64_t counter, int64_t count, double *values) {
  const uint32_t key[2] = {(uint32_t)seed, (uint32_t)((uint64_t)seed >> 32)};
  uint32_t block[4] = {(uint32_t)counter, (uint32_t)((uint64_t)counter >> 32), 0, 0};
  uint32_t words[4];
  for (int64_t i = 0; i < count; i++) {
    const int half = (int)(i & 1);
    if (half == 0) {
      block[2] = (uint32_t)(i >> 1);
      block[3] = (uint32_t)((uint64_t)i >> 33);
      separatrix_philox(block, key, words);
    }
    const uint64_t bits = ((uint64_t)words[2 * half + 1] << 32) | words[2 * half];
    values[i] = (double)(bits >> 11) * 0x1.0p-53;
  }
}
