/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * How a C program calls libseparatrix: example CASE flies half a drive period of the case from two starts,
 * and shows position and its derivative with respect to the stiffness of the spring beside a difference of
 * two calls. Ends with 0 if they agree.
 */
#include <math.h>
#include <separatrix.h>
#include <stdio.h>

enum { samples = 5, segments = 2, total = samples * segments };

static char message[1024];

static int failed(const char *what) {
  fprintf(stderr, "%s: %s\n", what, message);
  return 1;
}

/* Positions, and their derivatives by stiffness, x, v and crank angle unless `jacobian` is NULL. */
static int fly(const separatrix_model *model, int index, double stiffness, const double *times, double *x,
               double *jacobian) {
  const double start[segments][3] = {{0.5, 1.0, 0.0}, {0.7, -1.0, 2.0}};
  const int first[segments + 1] = {0, samples, total};
  double v[total], v_jacobian[total][4], impact[16][4];
  int impacts[segments], steady[segments], reason[segments], impact_segment[16], impact_count;
  const double direction = 1;
  return separatrix_segments(model, 1, &index, &stiffness, jacobian != NULL, &direction, segments, start[0],
                             first, times, 0, 0, NULL, jacobian != NULL, 1e-9, x, v, jacobian,
                             jacobian ? v_jacobian[0] : NULL, impacts, steady, reason, 16, &impact_count,
                             impact_segment, impact[0], message, sizeof message);
}

int main(int argc, char **argv) {
  separatrix_model *model;
  char path[64], unit[32];
  double numbers[3], frequency, times[total], x[total], below[total], above[total], jacobian[total][4],
      largest = 0;
  int index, i;
  if (argc != 2) {
    fprintf(stderr, "usage: example CASE\n");
    return 64;
  }
  if (separatrix_model_read(argv[1], &model, message, sizeof message))
    return failed("reading the case");
  if (separatrix_find_parameter(model, "restoring.stiffness", &index, message, sizeof message))
    return failed("parameter");
  if (separatrix_parameter(model, index, path, sizeof path, unit, sizeof unit, numbers, message,
                           sizeof message))
    return failed("parameter");
  printf("%s = %g %s, one of %d parameters\n", path, numbers[0], unit, separatrix_parameter_count(model));
  if (separatrix_drive_frequency(model, 0, NULL, NULL, &frequency, message, sizeof message))
    return failed("drive");
  for (i = 0; i < total; i++)
    times[i] = (i % samples) * 3.14159 / frequency / samples;

  const double h = 1e-5 * numbers[0];
  if (fly(model, index, numbers[0], times, x, jacobian[0]))
    return failed("segments");
  if (fly(model, index, numbers[0] - h, times, below, NULL))
    return failed("segments");
  if (fly(model, index, numbers[0] + h, times, above, NULL))
    return failed("segments");
  printf("segment     t [s]       x [m]   dx/dc       difference\n");
  for (i = 0; i < total; i++) {
    const double difference = (above[i] - below[i]) / (2 * h);
    printf("%7d  %8.5f  %10.7f  %10.3e  %10.3e\n", i / samples, times[i], x[i], jacobian[i][0], difference);
    if (!(fabs(jacobian[i][0] - difference) <= largest))
      largest = fabs(jacobian[i][0] - difference);
  }
  printf("largest deviation %.1e m/(N/m)\n", largest);
  separatrix_model_free(model);
  return largest < 1e-6 ? 0 : 1;
}
