/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

#include <stdint.h>
#include <zlib.h>

/* The most bytes that `size` bytes become. */
int64_t separatrix_compress_bound(int64_t size) { return (int64_t)compressBound((uLong)size); }

/* Deflates `size` bytes into `out`, where `room` are; how many they have become, -1 on an error. */
int64_t separatrix_compress(const void *bytes, int64_t size, int level, void *out, int64_t room) {
  uLongf length = (uLongf)room;
  return compress2(out, &length, bytes, (uLong)size, level) == Z_OK ? (int64_t)length : -1;
}

/* The first bytes of all values, then the second ones and so on; values of `width` bytes. */
void separatrix_shuffle(const unsigned char *bytes, int64_t values, int width, unsigned char *out) {
  for (int k = 0; k < width; ++k)
    for (int64_t i = 0; i < values; ++i)
      *out++ = bytes[i * width + k];
}
