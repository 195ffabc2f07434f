/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* slow_files FOLDER MILLISECONDS MOUNT_POINT -f: shows a folder as a file system on which each operation
 * takes so long. Nothing is cached: each read and write of a process is an operation of this program. */
#define FUSE_USE_VERSION 35
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <fuse.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

static char folder[PATH_MAX];
static struct timespec delay;

static int answer(long number) { return number < 0 ? -errno : (int)number; }

/* The name of a file in the folder, once the time of an operation has passed. */
static const char *slow(const char *path, char name[PATH_MAX]) {
  if (delay.tv_sec > 0 || delay.tv_nsec > 0)
    nanosleep(&delay, NULL);
  if (path)
    snprintf(name, PATH_MAX, "%s%s", folder, path);
  return name;
}

static void *begin(struct fuse_conn_info *connection, struct fuse_config *config) {
  (void)connection;
  config->direct_io = 1;
  config->attr_timeout = config->entry_timeout = config->negative_timeout = 0;
  config->nullpath_ok = 0;
  return NULL;
}

static int get_attributes(const char *path, struct stat *found, struct fuse_file_info *file) {
  char name[PATH_MAX];
  (void)file;
  return answer(lstat(slow(path, name), found));
}

static int opened(const char *path, int flags, mode_t mode, struct fuse_file_info *file) {
  char name[PATH_MAX];
  const int descriptor = open(slow(path, name), flags, mode);
  file->fh = (uint64_t)descriptor;
  return descriptor < 0 ? -errno : 0;
}

static int create_file(const char *path, mode_t mode, struct fuse_file_info *file) {
  return opened(path, file->flags | O_CREAT, mode, file);
}

static int open_file(const char *path, struct fuse_file_info *file) {
  return opened(path, file->flags, 0, file);
}

static int read_file(const char *path, char *data, size_t size, off_t at, struct fuse_file_info *file) {
  char name[PATH_MAX];
  slow(path, name);
  return answer(pread((int)file->fh, data, size, at));
}

static int write_file(const char *path, const char *data, size_t size, off_t at,
                      struct fuse_file_info *file) {
  char name[PATH_MAX];
  slow(path, name);
  return answer(pwrite((int)file->fh, data, size, at));
}

static int set_length(const char *path, off_t length, struct fuse_file_info *file) {
  char name[PATH_MAX];
  (void)file;
  return answer(truncate(slow(path, name), length));
}

static int reserve(const char *path, int mode, off_t at, off_t length, struct fuse_file_info *file) {
  char name[PATH_MAX];
  slow(path, name);
  return answer(fallocate((int)file->fh, mode, at, length));
}

static int sync_file(const char *path, int only_data, struct fuse_file_info *file) {
  char name[PATH_MAX];
  (void)only_data;
  slow(path, name);
  return answer(fsync((int)file->fh));
}

static int close_file(const char *path, struct fuse_file_info *file) {
  (void)path;
  return answer(close((int)file->fh));
}

static int rename_file(const char *from, const char *to, unsigned flags) {
  char name[PATH_MAX], other[PATH_MAX];
  if (flags)
    return -EINVAL;
  snprintf(other, sizeof other, "%s%s", folder, to);
  return answer(rename(slow(from, name), other));
}

static int remove_file(const char *path) {
  char name[PATH_MAX];
  return answer(unlink(slow(path, name)));
}

static int system_state(const char *path, struct statvfs *found) {
  char name[PATH_MAX];
  return answer(statvfs(slow(path, name), found));
}

static int sync_folder(const char *path, int only_data, struct fuse_file_info *file) {
  char name[PATH_MAX];
  (void)only_data;
  (void)file;
  slow(path, name);
  return 0;
}

static int open_folder(const char *path, struct fuse_file_info *file) {
  char name[PATH_MAX];
  (void)file;
  slow(path, name);
  return 0;
}

int main(int count, char **words) {
  static const struct fuse_operations operations = {
      .init = begin,
      .getattr = get_attributes,
      .create = create_file,
      .open = open_file,
      .opendir = open_folder,
      .read = read_file,
      .write = write_file,
      .truncate = set_length,
      .fallocate = reserve,
      .fsync = sync_file,
      .fsyncdir = sync_folder,
      .release = close_file,
      .rename = rename_file,
      .unlink = remove_file,
      .statfs = system_state,
  };
  if (count < 4 || realpath(words[1], folder) == NULL) {
    fputs("slow_files FOLDER MILLISECONDS MOUNT_POINT [-f]\n", stderr);
    return 64;
  }
  const double seconds = atof(words[2]) / 1000;
  delay.tv_sec = (time_t)seconds;
  delay.tv_nsec = (long)(1e9 * (seconds - (double)delay.tv_sec));
  umask(0);
  words[2] = words[0];
  return fuse_main(count - 2, words + 2, &operations, NULL);
}
