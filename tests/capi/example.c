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

enum { samples = 5, segments = 2, total = samples * segments, numbers = 2, columns = 4 };

static char message[1024];

static int failed(const char *what) {
  fprintf(stderr, "%s: %s\n", what, message);
  return 1;
}

/* x and v, and their derivatives by stiffness, x, v and crank angle unless `jacobian` is NULL. */
static int fly(const separatrix_model *model, int index, double stiffness, const double *times,
               double (*motion)[numbers], double (*jacobian)[numbers][columns]) {
  const double start[segments][3] = {{0.5, 1.0, 0.0}, {0.7, -1.0, 2.0}}, direction = 1;
  const int first[segments + 1] = {0, samples, total};
  double impact[16][5];
  int impacts[segments], steady[segments], reason[segments], impact_segment[16];
  separatrix_segments call = {
      .chosen_count = 1,
      .direction_count = jacobian != NULL,
      .segment_count = segments,
      .start_numbers = 3,
      .sample_numbers = numbers,
      .derivatives = jacobian != NULL,
      .impact_capacity = 16,
      .tolerance = 1e-9,
      .chosen = &index,
      .values = &stiffness,
      .directions = &direction,
      .start = start[0],
      .first = first,
      .times = times,
      .motion = motion[0],
      .jacobian = jacobian ? jacobian[0][0] : NULL,
      .impacts = impacts,
      .steady = steady,
      .reason = reason,
      .impact_segment = impact_segment,
      .impact = impact[0],
  };
  return separatrix_propagate(model, &call, message, sizeof message);
}

int main(int argc, char **argv) {
  separatrix_model *model;
  char path[64], unit[32];
  double known[3], frequency, times[total], largest = 0;
  double motion[total][numbers], below[total][numbers], above[total][numbers];
  double jacobian[total][numbers][columns];
  int index, i;
  if (argc != 2) {
    fprintf(stderr, "usage: example CASE\n");
    return 64;
  }
  if (separatrix_model_read(argv[1], &model, message, sizeof message))
    return failed("reading the case");
  if (separatrix_find_parameter(model, "restoring.stiffness", &index, message, sizeof message))
    return failed("parameter");
  if (separatrix_parameter(model, index, path, sizeof path, unit, sizeof unit, known, message,
                           sizeof message))
    return failed("parameter");
  printf("%s = %g %s, one of %d parameters\n", path, known[0], unit, separatrix_parameter_count(model));
  if (separatrix_drive_frequency(model, 0, NULL, NULL, &frequency, message, sizeof message))
    return failed("drive");
  for (i = 0; i < total; i++)
    times[i] = (i % samples) * 3.14159 / frequency / samples;

  const double h = 1e-5 * known[0];
  if (fly(model, index, known[0], times, motion, jacobian))
    return failed("segments");
  if (fly(model, index, known[0] - h, times, below, NULL))
    return failed("segments");
  if (fly(model, index, known[0] + h, times, above, NULL))
    return failed("segments");
  printf("segment     t [s]       x [m]   dx/dc       difference\n");
  for (i = 0; i < total; i++) {
    const double difference = (above[i][0] - below[i][0]) / (2 * h);
    printf("%7d  %8.5f  %10.7f  %10.3e  %10.3e\n", i / samples, times[i], motion[i][0], jacobian[i][0][0],
           difference);
    if (!(fabs(jacobian[i][0][0] - difference) <= largest))
      largest = fabs(jacobian[i][0][0] - difference);
  }
  printf("largest deviation %.1e m/(N/m)\n", largest);
  separatrix_model_free(model);
  return largest < 1e-6 ? 0 : 1;
}
