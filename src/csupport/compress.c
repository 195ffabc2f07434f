/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>
#ifdef SEPARATRIX_ISAL
#include <isa-l.h>
#endif

/* The most bytes that `size` bytes become. */
int64_t separatrix_compress_bound(int64_t size) { return (int64_t)compressBound((uLong)size); }

#ifdef SEPARATRIX_ISAL
/* Deflates by ISA-L; 0 where that cannot be done. */
static int64_t deflate_fast(const void *bytes, int64_t size, void *out, int64_t room) {
  if (size > UINT32_MAX || room > UINT32_MAX)
    return 0;
  /* Zeroed, as ISA-L looks at bytes that it has not written, without effect. */
  void *work = calloc(1, ISAL_DEF_LVL1_DEFAULT);
  if (!work)
    return 0;
  struct isal_zstream stream = {0};
  isal_deflate_stateless_init(&stream);
  stream.level = 1;
  stream.level_buf = work;
  stream.level_buf_size = ISAL_DEF_LVL1_DEFAULT;
  stream.gzip_flag = IGZIP_ZLIB;
  stream.end_of_stream = 1;
  stream.next_in = (uint8_t *)bytes;
  stream.avail_in = (uint32_t)size;
  stream.next_out = out;
  stream.avail_out = (uint32_t)room;
  int status = isal_deflate_stateless(&stream);
  free(work);
  return status == COMP_OK && stream.avail_in == 0 ? stream.total_out : 0;
}
#endif

/* Deflates `size` bytes into `out`, where `room` are; how many they have become, -1 on an error. `level`: of
 * zlib. */
int64_t separatrix_compress(const void *bytes, int64_t size, int level, void *out, int64_t room) {
#ifdef SEPARATRIX_ISAL
  int64_t found = deflate_fast(bytes, size, out, room);
  if (found > 0)
    return found;
#endif
  uLongf length = (uLongf)room;
  return compress2(out, &length, bytes, (uLong)size, level) == Z_OK ? (int64_t)length : -1;
}

#if defined(__GNUC__) && !defined(__clang__)
#define VECTORS
enum { lanes = 16 };
typedef unsigned char vector __attribute__((vector_size(lanes)));

/* The bytes of the lower, or of the upper, halves of two vectors in turn. */
static inline vector lower(vector a, vector b) {
  return __builtin_shuffle(a, b, (vector){0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23});
}

static inline vector upper(vector a, vector b) {
  return __builtin_shuffle(a, b, (vector){8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31});
}

/* Sixteen values at a time: both halves of their bytes in turn, four times, leaves the first bytes first.
   Returns how many values it has done. */
static inline int64_t shuffle(const unsigned char *restrict bytes, int64_t values, const int width,
                              unsigned char *restrict out) {
  int64_t done = 0;
  for (; done + lanes <= values; done += lanes) {
    vector now[8], next[8];
    memcpy(now, bytes + width * done, (size_t)(width * lanes));
#pragma GCC unroll 4
    for (int round = 0; round < 4; ++round) {
#pragma GCC unroll 4
      for (int k = 0; k < width / 2; ++k) {
        next[2 * k] = lower(now[k], now[k + width / 2]);
        next[2 * k + 1] = upper(now[k], now[k + width / 2]);
      }
#pragma GCC unroll 8
      for (int k = 0; k < width; ++k)
        now[k] = next[k];
    }
#pragma GCC unroll 8
    for (int k = 0; k < width; ++k)
      memcpy(out + k * values + done, &now[k], lanes);
  }
  return done;
}
#endif

/* The first bytes of all values, then the second ones and so on; values of `width` bytes. */
void separatrix_shuffle(const unsigned char *bytes, int64_t values, int width, unsigned char *out) {
  int64_t done = 0;
#ifdef VECTORS
  if (width == 4)
    done = shuffle(bytes, values, 4, out);
  else if (width == 8)
    done = shuffle(bytes, values, 8, out);
#endif
  for (int k = 0; k < width; ++k)
    for (int64_t i = done; i < values; ++i)
      out[k * values + i] = bytes[i * width + k];
}
