/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * How a C program follows a machine with a motor: example_motor CASE flies a second of the case from one
 * start, and shows crank angle and position, and the derivative of the crank speed with respect to the
 * inertia beside a difference of two calls. Then it labels two starts with other speeds of the crank. Ends
 * with 0 if derivative and difference agree and both starts have a label.
 */
#include <math.h>
#include <separatrix.h>
#include <stdio.h>

enum { samples = 6, numbers = 5, columns = 1 + numbers };

static char message[1024];

static int failed(const char *what) {
  fprintf(stderr, "%s: %s\n", what, message);
  return 1;
}

/* x, crank angle, v, crank speed, current at six times, with derivatives unless `jacobian` is NULL. */
static int fly(const separatrix_model *model, int index, double inertia, double (*motion)[numbers],
               double (*jacobian)[numbers][columns]) {
  const double start[numbers] = {0.05, 0, 0, 12, 0}, direction = 1;
  const int first[2] = {0, samples};
  double times[samples], impact[64][5];
  int impacts, steady, reason, impact_segment[64], i;
  separatrix_segments call = {
      .chosen_count = 1,
      .direction_count = jacobian != NULL,
      .segment_count = 1,
      .start_numbers = numbers,
      .sample_numbers = numbers,
      .derivatives = jacobian != NULL,
      .impact_capacity = 64,
      .tolerance = 1e-12,
      .chosen = &index,
      .values = &inertia,
      .directions = &direction,
      .start = start,
      .first = first,
      .times = times,
      .motion = motion[0],
      .jacobian = jacobian ? jacobian[0][0] : NULL,
      .impacts = &impacts,
      .steady = &steady,
      .reason = &reason,
      .impact_segment = impact_segment,
      .impact = impact[0],
  };
  for (i = 0; i < samples; i++)
    times[i] = i / (samples - 1.0);
  return separatrix_propagate(model, &call, message, sizeof message);
}

/* Whether starts with 9 and 16 rad/s come to an attractor. */
static int label(const separatrix_model *model) {
  const double starts[2][numbers] = {{0, 0, 0, 9, 0}, {0, 0, 0, 16, 0}};
  double values[2][separatrix_label_numbers];
  separatrix_catalogue *catalogue;
  int code = separatrix_catalogue_open(model, 0, NULL, NULL, &catalogue, message, sizeof message);
  if (code == 0)
    code = separatrix_catalogue_search_from(catalogue, 2, numbers, starts[0], NULL, message, sizeof message);
  if (code == 0)
    code = separatrix_labels_from(catalogue, 2, numbers, starts[0], values[0], NULL, message, sizeof message);
  if (code == 0)
    printf("from 9 rad/s: attractor %g, from 16 rad/s: attractor %g\n", values[0][1], values[1][1]);
  separatrix_catalogue_free(catalogue);
  return code == 0 && values[0][1] > 0 && values[1][1] > 0;
}

int main(int argc, char **argv) {
  separatrix_model *model;
  double motion[samples][numbers], below[samples][numbers], above[samples][numbers], largest = 0;
  double jacobian[samples][numbers][columns];
  const double inertia = 0.05, h = 1e-6;
  int index, i, labelled;
  if (argc != 2) {
    fprintf(stderr, "usage: example_motor CASE\n");
    return 64;
  }
  if (separatrix_model_read(argv[1], &model, message, sizeof message))
    return failed("reading the case");
  if (separatrix_find_parameter(model, "motor.inertia", &index, message, sizeof message))
    return failed("parameter");
  if (fly(model, index, inertia, motion, jacobian) || fly(model, index, inertia - h, below, NULL) ||
      fly(model, index, inertia + h, above, NULL))
    return failed("segments");
  printf("crank [rad]       x [m]  speed [rad/s]       dw/dJ  difference\n");
  for (i = 0; i < samples; i++) {
    const double difference = (above[i][3] - below[i][3]) / (2 * h);
    printf("%11.6f  %10.7f  %13.8f  %10.4f  %10.4f\n", motion[i][1], motion[i][0], motion[i][3],
           jacobian[i][3][0], difference);
    if (!(fabs(jacobian[i][3][0] - difference) <= largest))
      largest = fabs(jacobian[i][3][0] - difference);
  }
  labelled = label(model);
  separatrix_model_free(model);
  return largest < 1e-3 && labelled ? 0 : 1;
}
