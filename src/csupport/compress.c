/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

#include <stdint.h>
#include <stdlib.h>
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

/* A known width lets the compiler use vectors. */
static inline void shuffle(const unsigned char *restrict bytes, int64_t values, int width,
                           unsigned char *restrict out) {
  for (int k = 0; k < width; ++k)
    for (int64_t i = 0; i < values; ++i)
      out[k * values + i] = bytes[i * width + k];
}

/* The first bytes of all values, then the second ones and so on; values of `width` bytes. */
void separatrix_shuffle(const unsigned char *bytes, int64_t values, int width, unsigned char *out) {
  if (width == 4)
    shuffle(bytes, values, 4, out);
  else if (width == 8)
    shuffle(bytes, values, 8, out);
  else
    shuffle(bytes, values, width, out);
}
