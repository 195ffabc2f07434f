/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* The processor time that control groups allow, of version 1 and 2. */
#define _GNU_SOURCE
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Whether a list of names separated by commas has `cpu`. */
static int has_cpu(const char *names) {
  for (const char *next = names; next != NULL; next = strchr(next, ',')) {
    next += *next == ',';
    const size_t length = strcspn(next, ",");
    if (length == 3 && strncmp(next, "cpu", 3) == 0)
      return 1;
  }
  return 0;
}

/* The first two numbers of a file, or of two files; 0 if there are none, as in `max 100000`. */
static int read_numbers(const char *first, const char *second, double values[2]) {
  FILE *file = fopen(first, "r");
  if (file == NULL)
    return 0;
  int found = fscanf(file, "%lf %lf", &values[0], &values[1]);
  fclose(file);
  if (second != NULL && found == 1 && (file = fopen(second, "r")) != NULL) {
    found += fscanf(file, "%lf", &values[1]) == 1;
    fclose(file);
  }
  return found == 2;
}

/* Cores allowed by the group in `folder`, -1 without a limit. */
static double limit_of(const char *folder, int version) {
  char *first = NULL, *second = NULL;
  double values[2], limit = -1;
  if (asprintf(&first, "%s/%s", folder, version == 1 ? "cpu.cfs_quota_us" : "cpu.max") < 0)
    return -1;
  if (version == 1 && asprintf(&second, "%s/cpu.cfs_period_us", folder) < 0)
    second = NULL;
  if (read_numbers(first, second, values) && values[0] > 0 && values[1] > 0)
    limit = values[0] / values[1];
  free(first);
  free(second);
  return limit;
}

/* The smallest limit of a group and of those above it up to the folder of all, whose path has `top` bytes. */
static double smallest_limit(char *folder, size_t top, int version) {
  double smallest = -1;
  for (;;) {
    const double limit = limit_of(folder, version);
    if (limit > 0 && (smallest < 0 || limit < smallest))
      smallest = limit;
    char *last = strrchr(folder, '/');
    if (last == NULL || (size_t)(last - folder) < top)
      return smallest;
    *last = '\0';
  }
}

/* Cores whose time the control groups of this process allow, -1 without a limit. `root`: where /proc and /sys
   are, as an empty text. */
double separatrix_core_quota(const char *root) {
  char line[PATH_MAX + 256], path[2 * PATH_MAX];
  double smallest = -1;
  snprintf(path, sizeof path, "%s/proc/self/cgroup", root);
  FILE *file = fopen(path, "r");
  if (file == NULL)
    return -1;
  while (fgets(line, sizeof line, file) != NULL) {
    line[strcspn(line, "\n")] = '\0';
    char *names = strchr(line, ':');
    char *group = names == NULL ? NULL : strchr(names + 1, ':');
    if (group == NULL)
      continue;
    *group++ = '\0';
    const int version = *++names == '\0' ? 2 : 1;
    if (version == 1 && !has_cpu(names))
      continue;
    const int top = snprintf(path, sizeof path, "%s/sys/fs/cgroup%s%s", root, version == 1 ? "/" : "", names);
    if (strcmp(group, "/") != 0)
      snprintf(path + top, sizeof path - (size_t)top, "%s", group);
    const double limit = smallest_limit(path, (size_t)top, version);
    if (limit > 0 && (smallest < 0 || limit < smallest))
      smallest = limit;
  }
  fclose(file);
  return smallest;
}
