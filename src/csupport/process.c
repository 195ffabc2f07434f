/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Clock and facts about this process. */
#define _POSIX_C_SOURCE 200809L
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static double seconds(clockid_t clock) {
  struct timespec now;
  if (clock_gettime(clock, &now) != 0)
    return -1.0;
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Seconds since an arbitrary moment; never goes back. */
double separatrix_monotonic_seconds(void) { return seconds(CLOCK_MONOTONIC); }

/* UTC as 2026-01-31T12:34:56Z. */
int separatrix_utc_now(char *text, int size) {
  const time_t now = time(NULL);
  struct tm parts;
  if (gmtime_r(&now, &parts) == NULL)
    return -1;
  return strftime(text, (size_t)size, "%Y-%m-%dT%H:%M:%SZ", &parts) > 0 ? 0 : -1;
}

/* Resident memory in bytes, -1 where /proc does not tell. */
int64_t separatrix_resident_bytes(void) {
  long long total, resident;
  FILE *file = fopen("/proc/self/statm", "r");
  if (file == NULL)
    return -1;
  const int found = fscanf(file, "%lld %lld", &total, &resident);
  fclose(file);
  return found == 2 ? (int64_t)resident * sysconf(_SC_PAGESIZE) : -1;
}

int separatrix_host_name(char *text, int size) {
  const int status = gethostname(text, (size_t)size);
  text[size - 1] = '\0';
  return status;
}

/* 1 if stderr is a terminal. */
int separatrix_stderr_is_terminal(void) { return isatty(STDERR_FILENO) == 1; }

/* Sets an environment variable unless the user has set it. */
int separatrix_default_environment(const char *name, const char *value) { return setenv(name, value, 0); }

void separatrix_sleep_microseconds(int microseconds) {
  const struct timespec pause = {microseconds / 1000000, (long)(microseconds % 1000000) * 1000};
  nanosleep(&pause, NULL);
}

void separatrix_exit(int code) { exit(code); }

/* Ends without the clean-up of libraries, which may fail after an error of theirs. */
void separatrix_exit_now(int code) {
  fflush(NULL);
  _exit(code);
}
