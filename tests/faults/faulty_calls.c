/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Loaded with LD_PRELOAD: counts the calls that change a file whose path contains $FAULT_NAME, and at the
   call number $FAULT_AT does $FAULT_DO: `kill` ends the process before the call, `tear` after half of a
   write, and a number is the errno that this and all later writes give. $FAULT_RANK: only on this rank of an
   MPI run. `late`: the first opening of such a file for writing takes $FAULT_AT seconds; `read`: each opening
   for reading. `slow`: each such call takes $FAULT_AT milliseconds. `unlockable`: no such file can be locked,
   as on file systems without locks. `arrive`: the first barrier of MPI without waiting takes $FAULT_AT
   seconds, once there is such a file. `reads`: reads are counted too. The number of calls is added as a line
   to the file $FAULT_COUNT when the process ends. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static const char *name, *action;
static long at;
static atomic_long calls;

#define REAL(function) ((__typeof__(&function))dlsym(RTLD_NEXT, #function))

__attribute__((constructor)) static void read_settings(void) {
  const char *rank = getenv("FAULT_RANK"), *own = getenv("OMPI_COMM_WORLD_RANK"),
             *number = getenv("FAULT_AT");
  if (rank != NULL && own != NULL && strcmp(rank, own) != 0)
    return;
  name = getenv("FAULT_NAME");
  action = getenv("FAULT_DO");
  at = number != NULL && action != NULL ? atol(number) : 0;
}

__attribute__((destructor)) static void report(void) {
  const char *path = getenv("FAULT_COUNT");
  FILE *file = path == NULL || calls == 0 ? NULL : fopen(path, "a");
  if (file == NULL)
    return;
  fprintf(file, "%ld\n", (long)calls);
  fclose(file);
}

static void die(void) { kill(getpid(), SIGKILL); }

/* The errno to give, 0 to go on, -1 to die after half of the write. `writes`: the call needs space. */
static int fault(const char *path, int writes) {
  if (name == NULL || strstr(path, name) == NULL)
    return 0;
  const long call = ++calls;
  if (at > 0 && strcmp(action, "slow") == 0) {
    usleep(1000 * (useconds_t)at);
    return 0;
  }
  if (at == 0 || call < at || strcmp(action, "late") == 0 || strcmp(action, "unlockable") == 0 ||
      strcmp(action, "arrive") == 0 || strcmp(action, "read") == 0)
    return 0;
  if (strcmp(action, "kill") == 0)
    die();
  if (strcmp(action, "tear") == 0) {
    if (!writes)
      die();
    return -1;
  }
  return writes ? atoi(action) : 0;
}

static int path_of(int descriptor, char path[PATH_MAX]) {
  char link[64];
  snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(link, path, PATH_MAX - 1);
  if (length < 0)
    return 0;
  path[length] = '\0';
  return 1;
}

static int fault_of(int descriptor, int writes) {
  char path[PATH_MAX];
  return path_of(descriptor, path) ? fault(path, writes) : 0;
}

#define GUARD(number)                                                                                        \
  if ((number) > 0) {                                                                                        \
    errno = (number);                                                                                        \
    return -1;                                                                                               \
  }

static int open_late(const char *path, int flags, mode_t mode) {
  static atomic_int opened;
  if (name != NULL && at > 0 && strcmp(action, "late") == 0 && (flags & O_ACCMODE) != O_RDONLY &&
      strstr(path, name) != NULL && atomic_fetch_add(&opened, 1) == 0)
    sleep((unsigned)at);
  if (name != NULL && at > 0 && strcmp(action, "read") == 0 && (flags & O_ACCMODE) == O_RDONLY &&
      strstr(path, name) != NULL)
    sleep((unsigned)at);
  return REAL(open)(path, flags, mode);
}

#define OPEN_LATE                                                                                            \
  va_list more;                                                                                              \
  va_start(more, flags);                                                                                     \
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0;                       \
  va_end(more);                                                                                              \
  return open_late(path, flags, mode);

int open(const char *path, int flags, ...) { OPEN_LATE }

int open64(const char *path, int flags, ...){OPEN_LATE}

ssize_t write(int descriptor, const void *data, size_t size) {
  const int number = fault_of(descriptor, 1);
  GUARD(number)
  const ssize_t done = REAL(write)(descriptor, data, number < 0 ? size / 2 : size);
  if (number < 0)
    die();
  return done;
}

ssize_t pwrite(int descriptor, const void *data, size_t size, off_t offset) {
  const int number = fault_of(descriptor, 1);
  GUARD(number)
  const ssize_t done = REAL(pwrite)(descriptor, data, number < 0 ? size / 2 : size, offset);
  if (number < 0)
    die();
  return done;
}

ssize_t pwrite64(int descriptor, const void *data, size_t size, off64_t offset) {
  return pwrite(descriptor, data, size, offset);
}

ssize_t writev(int descriptor, const struct iovec *parts, int count) {
  const int number = fault_of(descriptor, 1);
  GUARD(number)
  const ssize_t done = REAL(writev)(descriptor, parts, number < 0 ? count / 2 : count);
  if (number < 0)
    die();
  return done;
}

static void count_read(int descriptor) {
  char path[PATH_MAX];
  if (name != NULL && action != NULL && strcmp(action, "reads") == 0 && path_of(descriptor, path) &&
      strstr(path, name) != NULL)
    calls++;
}

ssize_t pread(int descriptor, void *data, size_t size, off_t offset) {
  count_read(descriptor);
  return REAL(pread)(descriptor, data, size, offset);
}

ssize_t pread64(int descriptor, void *data, size_t size, off64_t offset) {
  count_read(descriptor);
  return REAL(pread64)(descriptor, data, size, offset);
}

int ftruncate(int descriptor, off_t length) {
  const int number = fault_of(descriptor, 1);
  GUARD(number)
  if (number < 0)
    die();
  return REAL(ftruncate)(descriptor, length);
}

int ftruncate64(int descriptor, off64_t length) { return ftruncate(descriptor, length); }

int fallocate(int descriptor, int mode, off_t offset, off_t length) {
  const int number = fault_of(descriptor, 1);
  GUARD(number)
  if (number < 0)
    die();
  return REAL(fallocate)(descriptor, mode, offset, length);
}

int fallocate64(int descriptor, int mode, off64_t offset, off64_t length) {
  return fallocate(descriptor, mode, offset, length);
}

int fsync(int descriptor) {
  const int number = fault_of(descriptor, 0);
  if (number < 0)
    die();
  return REAL(fsync)(descriptor);
}

int flock(int descriptor, int operation) {
  char path[PATH_MAX];
  if (action != NULL && strcmp(action, "unlockable") == 0 && path_of(descriptor, path) &&
      strstr(path, name) != NULL) {
    errno = ENOLCK;
    return -1;
  }
  return REAL(flock)(descriptor, operation);
}

/* The C function that the Fortran interface of OpenMPI calls. */
int PMPI_Ibarrier(void *communicator, void **request);
int PMPI_Ibarrier(void *communicator, void **request) {
  static atomic_int arrived;
  if (action != NULL && strcmp(action, "arrive") == 0 && access(name, F_OK) == 0 &&
      atomic_fetch_add(&arrived, 1) == 0)
    sleep((unsigned)at);
  return REAL(PMPI_Ibarrier)(communicator, request);
}

int rename(const char *from, const char *to) {
  if (fault(to, 0) < 0)
    die();
  return REAL(rename)(from, to);
}

int unlink(const char *path) {
  if (fault(path, 0) < 0)
    die();
  return REAL(unlink)(path);
}
