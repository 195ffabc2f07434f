/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Reading TOML text behind plain C functions. A document is an opaque pointer that the caller
 * frees; entries are numbered from 0 in the order of the text. No exception leaves this file. */
#ifndef SEPARATRIX_TOML_SHIM_H
#define SEPARATRIX_TOML_SHIM_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum separatrix_toml_kind {
  SEPARATRIX_TOML_INTEGER = 1,
  SEPARATRIX_TOML_FLOAT = 2,
  SEPARATRIX_TOML_STRING = 3,
  SEPARATRIX_TOML_BOOLEAN = 4,
  SEPARATRIX_TOML_TABLE = 5,
  SEPARATRIX_TOML_ARRAY = 6,
  SEPARATRIX_TOML_DATE = 7
};

enum separatrix_toml_field { SEPARATRIX_TOML_PATH = 1, SEPARATRIX_TOML_TEXT = 2 };

/* The bytes of a file; *message is set when it cannot be read. Free both with separatrix_toml_free_text. */
char *separatrix_toml_read_file(const char *path, int64_t *length, char **message);
void separatrix_toml_free_text(char *text);

/* Parses `length` bytes. NULL only when memory runs out. */
void *separatrix_toml_parse(const char *text, int64_t length);
void separatrix_toml_free(void *document);

/* Length of the syntax error's message, 0 without an error; line and column count from 1. */
int64_t separatrix_toml_error(const void *document, char *buffer, int64_t capacity, int *line, int *column);

int separatrix_toml_count(const void *document);
void separatrix_toml_value(const void *document, int entry, int *kind, int *line, int64_t *integer,
                           double *real);

/* Copies at most `capacity` bytes of a text field without a terminator; returns its length. */
int64_t separatrix_toml_text(const void *document, int entry, int field, char *buffer, int64_t capacity);

/* Where the first byte is that is not UTF-8, or a control character other than the ends of lines and tabs; -1
 * if nowhere. */
int64_t separatrix_first_bad_byte(const char *text, int64_t length);

#ifdef __cplusplus
}
#endif

#endif
