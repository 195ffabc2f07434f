/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* File operations that Fortran lacks. Every status is 0 or errno. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

/* A copy of the folder part of `path`; the caller frees it. */
static char *folder_of(const char *path) {
  char *copy = strdup(path);
  if (copy == NULL)
    return NULL;
  char *folder = strdup(dirname(copy));
  free(copy);
  return folder;
}

static int sync_path(const char *path, int flags) {
  const int descriptor = open(path, flags);
  if (descriptor < 0)
    return errno;
  const int status = fsync(descriptor) == 0 ? 0 : errno;
  if (close(descriptor) != 0 && status == 0)
    return errno;
  return status;
}

int separatrix_file_exists(const char *path) { return access(path, F_OK) == 0; }

/* Whether `path` is something other than a regular file: a folder, a device, a pipe. */
int separatrix_is_special(const char *path) {
  struct stat facts;
  return stat(path, &facts) == 0 && !S_ISREG(facts.st_mode);
}

/* Whether two names are of one file, also by links. */
int separatrix_is_same_file(const char *path, const char *other) {
  struct stat one, two;
  return stat(path, &one) == 0 && stat(other, &two) == 0 && one.st_dev == two.st_dev &&
         one.st_ino == two.st_ino;
}

/* Creates a file in a folder and removes it: folders of the system may be writable and yet take no file. */
static int try_folder(const char *folder) {
  char *probe = NULL;
  if (asprintf(&probe, "%s/.separatrix-XXXXXX", folder) < 0)
    return ENOMEM;
  const int descriptor = mkstemp(probe);
  const int status = descriptor >= 0 ? 0 : errno;
  if (descriptor >= 0) {
    unlink(probe);
    close(descriptor);
  }
  free(probe);
  return status;
}

/* Whether a file can be created in the folder of `path`. */
int separatrix_folder_status(const char *path) {
  char *folder = folder_of(path);
  struct stat facts;
  int status = 0;
  if (folder == NULL)
    return ENOMEM;
  if (stat(folder, &facts) != 0)
    status = errno;
  else if (!S_ISDIR(facts.st_mode))
    status = ENOTDIR;
  else
    status = try_folder(folder);
  free(folder);
  return status;
}

/* Bytes free to this user on the file system of the folder of `path`, -1 if unknown. */
int64_t separatrix_free_bytes(const char *path) {
  char *folder = folder_of(path);
  struct statvfs facts;
  int64_t result = -1;
  if (folder != NULL && statvfs(folder, &facts) == 0) {
    result = (int64_t)facts.f_bavail * (int64_t)facts.f_frsize;
  }
  free(folder);
  return result;
}

/* Reserves the blocks of a file so that a full disk or a quota shows before the work starts. File
   systems without fallocate are left as they are. */
int separatrix_reserve_file(const char *path) {
  struct stat facts;
  int status = 0;
  const int descriptor = open(path, O_RDWR);
  if (descriptor < 0)
    return errno;
  if (fstat(descriptor, &facts) != 0)
    status = errno;
  else if (facts.st_size > 0 && fallocate(descriptor, FALLOC_FL_KEEP_SIZE, 0, facts.st_size) != 0)
    status = errno;
  if (status == EOPNOTSUPP || status == ENOSYS)
    status = 0;
  if (close(descriptor) != 0 && status == 0)
    status = errno;
  return status;
}

/* Makes the file's content durable, renames it, and makes the new name durable. */
int separatrix_publish_file(const char *from, const char *to) {
  int status = sync_path(from, O_RDONLY);
  if (status != 0)
    return status;
  if (rename(from, to) != 0)
    return errno;
  char *folder = folder_of(to);
  if (folder == NULL)
    return ENOMEM;
  status = sync_path(folder, O_RDONLY | O_DIRECTORY);
  free(folder);
  /* Some file systems cannot sync a folder; the file itself is safe. */
  return status == EINVAL ? 0 : status;
}

/* A file that does not exist counts as removed. */
int separatrix_remove_file(const char *path) { return unlink(path) == 0 || errno == ENOENT ? 0 : errno; }

/* Takes the lock of the file `path`, which is made for it: *descriptor is what holds it. -1 where another
   process has it. Where files cannot be locked *descriptor is -1, the status 0 and *refusal the errno. */
int separatrix_take_lock(const char *path, int *descriptor, int *refusal) {
  struct stat held, named;
  *refusal = 0;
  for (;;) {
    *descriptor = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (*descriptor < 0)
      return errno;
    const int status = flock(*descriptor, LOCK_EX | LOCK_NB) == 0 ? 0 : errno;
    /* The one who had it may have removed the file meanwhile. */
    if (status == 0 && fstat(*descriptor, &held) == 0 && stat(path, &named) == 0 &&
        held.st_ino == named.st_ino)
      return 0;
    if (status != 0 && status != EWOULDBLOCK) {
      unlink(path);
      *refusal = status;
    }
    close(*descriptor);
    *descriptor = -1;
    if (status != 0)
      return status == EWOULDBLOCK ? -1 : 0;
  }
}

void separatrix_give_lock(const char *path, int descriptor) {
  if (descriptor < 0)
    return;
  unlink(path);
  close(descriptor);
}

/* Opens a file, made if there is none, to write behind what is in it. */
int separatrix_open_append(const char *path, int *descriptor) {
  *descriptor = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  return *descriptor < 0 ? errno : 0;
}

int separatrix_append(int descriptor, const char *text, int64_t length) {
  while (length > 0) {
    const ssize_t written = write(descriptor, text, (size_t)length);
    if (written >= 0) {
      text += written;
      length -= written;
    } else if (errno == EAGAIN) {
      /* A pipe that is full and does not wait by itself. */
      struct pollfd room = {.fd = descriptor, .events = POLLOUT};
      poll(&room, 1, -1);
    } else if (errno != EINTR) {
      return errno;
    }
  }
  return 0;
}

/* Opens a file that exists, to read, or to write at given offsets. */
int separatrix_open_bytes(const char *path, int writable, int *descriptor) {
  *descriptor = open(path, (writable ? O_RDWR : O_RDONLY) | O_CLOEXEC);
  return *descriptor < 0 ? errno : 0;
}

/* Reads `size` bytes from `offset`; EIO if the file ends before. */
int separatrix_read_bytes(int descriptor, void *bytes, int64_t size, int64_t offset) {
  char *next = bytes;
  while (size > 0) {
    const ssize_t done = pread(descriptor, next, (size_t)size, (off_t)offset);
    if (done == 0)
      return EIO;
    if (done < 0 && errno != EINTR)
      return errno;
    if (done > 0) {
      next += done;
      size -= done;
      offset += done;
    }
  }
  return 0;
}

int separatrix_write_bytes(int descriptor, const void *bytes, int64_t size, int64_t offset) {
  const char *next = bytes;
  while (size > 0) {
    const ssize_t done = pwrite(descriptor, next, (size_t)size, (off_t)offset);
    if (done < 0 && errno != EINTR)
      return errno;
    if (done > 0) {
      next += done;
      size -= done;
      offset += done;
    }
  }
  return 0;
}

/* Whether the open file is still the one of that name. */
int separatrix_has_name(int descriptor, const char *path) {
  struct stat own, other;
  if (fstat(descriptor, &own) != 0 || stat(path, &other) != 0)
    return errno != ENOENT && errno != ENOTDIR && errno != ESTALE;
  return own.st_dev == other.st_dev && own.st_ino == other.st_ino;
}

/* Bytes of the open file, -1 if it cannot be known. */
int64_t separatrix_length_of(int descriptor) {
  struct stat own;
  return fstat(descriptor, &own) != 0 ? -1 : (int64_t)own.st_size;
}

/* Makes the file so long; bytes that others write meanwhile are kept. */
int separatrix_set_length(int descriptor, int64_t length) {
  int status;
  do
    status = ftruncate(descriptor, (off_t)length) != 0 ? errno : 0;
  while (status == EINTR);
  return status;
}

/* `sync`: what was written is durable afterwards. */
int separatrix_close_bytes(int descriptor, int sync) {
  const int status = sync && fsync(descriptor) != 0 ? errno : 0;
  if (close(descriptor) != 0 && status == 0)
    return errno;
  return status;
}

void separatrix_error_text(int number, char *text, int size) {
  snprintf(text, (size_t)size, "%s", strerror(number));
}
