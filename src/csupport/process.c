/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Clock and facts about this process. */
#define _GNU_SOURCE
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

extern char **environ;

static double seconds(clockid_t clock) {
  struct timespec now;
  if (clock_gettime(clock, &now) != 0)
    return -1.0;
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Seconds since an arbitrary moment; never goes back. */
double separatrix_monotonic_seconds(void) { return seconds(CLOCK_MONOTONIC); }

/* Memory that is given back stays with the process, up to `bytes` of it, and so do its pages. */
void separatrix_keep_memory(int bytes) {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, bytes);
  mallopt(M_TRIM_THRESHOLD, bytes);
#else
  (void)bytes;
#endif
}

/* UTC as 2026-01-31T12:34:56Z. */
int separatrix_utc_now(char *text, int size) {
  const time_t now = time(NULL);
  struct tm parts;
  if (gmtime_r(&now, &parts) == NULL)
    return -1;
  return strftime(text, (size_t)size, "%Y-%m-%dT%H:%M:%SZ", &parts) > 0 ? 0 : -1;
}

/* Resident memory in bytes, -1 where /proc does not report it. */
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

/* The cores that this process may run on as "0-3,8"; returns their number, -1 if the system reports none. */
int separatrix_core_list(char *text, int size) {
  cpu_set_t set;
  size_t used = 0;
  text[0] = '\0';
  if (sched_getaffinity(0, sizeof set, &set) != 0)
    return -1;
  for (int core = 0; core < CPU_SETSIZE; core++) {
    if (!CPU_ISSET(core, &set))
      continue;
    int last = core;
    while (last + 1 < CPU_SETSIZE && CPU_ISSET(last + 1, &set))
      last++;
    char range[32];
    if (last > core)
      snprintf(range, sizeof range, "%s%d-%d", used > 0 ? "," : "", core, last);
    else
      snprintf(range, sizeof range, "%s%d", used > 0 ? "," : "", core);
    if (used + strlen(range) + 1 > (size_t)size)
      break;
    strcpy(text + used, range);
    used += strlen(range);
    core = last;
  }
  return CPU_COUNT(&set);
}

/* Whether this process may run on a core. */
int separatrix_may_use_core(int core) {
  cpu_set_t set;
  return core < CPU_SETSIZE && sched_getaffinity(0, sizeof set, &set) == 0 && CPU_ISSET(core, &set);
}

/* Cores of this host that are online. */
int separatrix_online_cores(void) { return (int)sysconf(_SC_NPROCESSORS_ONLN); }

/* The name of the processor, as /proc/cpuinfo has it. */
int separatrix_cpu_name(char *text, int size) {
  char line[512];
  FILE *file = fopen("/proc/cpuinfo", "r");
  if (file == NULL)
    return -1;
  while (fgets(line, sizeof line, file) != NULL) {
    const char *colon = strchr(line, ':');
    if (strncmp(line, "model name", 10) != 0 || colon == NULL)
      continue;
    line[strcspn(line, "\n")] = '\0';
    snprintf(text, (size_t)size, "%s", colon + 2);
    fclose(file);
    return 0;
  }
  fclose(file);
  return -1;
}

/* The environment variables that decide how MPI, HDF5 and the batch system work, NAME=VALUE separated by
   blanks, in the order of the alphabet. */
void separatrix_environment(char *text, int size) {
  static const char *const wanted[] = {"FI_",   "HDF5_", "OMPI_MCA_",     "OMP_",         "PRTE_MCA_",
                                       "ROMIO", "UCX_",  "SLURM_JOB_ID=", "SLURM_ARRAY_", "TMPDIR="};
  /* Variables that mpirun sets for its processes. */
  static const char *const internal[] = {"OMPI_MCA_orte_", "OMPI_MCA_ess", "OMPI_MCA_initial_wdir",
                                         "OMPI_MCA_pmix", "OMPI_MCA_shmem_RUNTIME"};
  size_t used = 0;
  const char *last = "";
  text[0] = '\0';
  for (;;) {
    const char *next = NULL;
    for (char **entry = environ; *entry != NULL; entry++) {
      int counts = 0;
      for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++)
        counts = counts || strncmp(*entry, wanted[i], strlen(wanted[i])) == 0;
      for (size_t i = 0; i < sizeof internal / sizeof *internal; i++)
        counts = counts && strncmp(*entry, internal[i], strlen(internal[i])) != 0;
      if (counts && strcmp(*entry, last) > 0 && (next == NULL || strcmp(*entry, next) < 0))
        next = *entry;
    }
    if (next == NULL || used + strlen(next) + 2 > (size_t)size)
      return;
    used += (size_t)snprintf(text + used, (size_t)size - used, "%s%s", used > 0 ? " " : "", next);
    last = next;
  }
}

/* 1 if stderr is a terminal. */
int separatrix_stderr_is_terminal(void) { return isatty(STDERR_FILENO) == 1; }

/* Sets an environment variable unless the user has set it. */
int separatrix_default_environment(const char *name, const char *value) { return setenv(name, value, 0); }

int separatrix_set_environment(const char *name, const char *value) { return setenv(name, value, 1); }

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
