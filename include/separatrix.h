/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * libseparatrix: the simulator as a function that a fit can call (docs/library.md).
 *
 * A model is a case file; its numbers are addressed by path ("restoring.stiffness", "drive.cosine[1]",
 * "effect.viscous.damping") or by index from 0. All quantities are in SI units.
 *
 * Functions return 0, or a code as the program does (64: wrong call, 65: bad case or value, 66: a file
 * cannot be read, 78: the motion was given up) and then write what is wrong into `message`, of
 * `message_size` characters, cut to fit.
 * Nothing is kept outside the handles; one handle may be used by several threads at once. They take turns,
 * except while they compute trajectories.
 */
#ifndef SEPARATRIX_H
#define SEPARATRIX_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A case that has been read. */
typedef struct separatrix_model separatrix_model;

/* Reads a case file. On success *model must be given to separatrix_model_free at the end, otherwise it is
 * NULL. */
int separatrix_model_read(const char *path, separatrix_model **model, char *message, size_t message_size);

/* The same for a text in memory; files that it names are looked for in `directory` ("": where the process
 * runs). */
int separatrix_model_from_text(const char *text, const char *directory, separatrix_model **model,
                               char *message, size_t message_size);

/* The same with settings on top, each "key.path=value" with a TOML value, as `--set` of the program takes
 * them; `name` stands for the file in messages, and its folder is where files that the case names are looked
 * for. */
int separatrix_model_with(const char *text, const char *name, int setting_count, const char *const *settings,
                          separatrix_model **model, char *message, size_t message_size);

/* Frees a model; NULL is allowed. */
void separatrix_model_free(separatrix_model *model);

/* Number of parameters: every number of the laws and effects of the case, items of lists included. */
int separatrix_parameter_count(const separatrix_model *model);

/* Path and unit of a parameter, and numbers[3] = value in the case, lower and upper bound (+-1.8e308:
 * none). */
int separatrix_parameter(const separatrix_model *model, int index, char *path, size_t path_size, char *unit,
                         size_t unit_size, double *numbers, char *message, size_t message_size);

/* Index of the parameter with a path. */
int separatrix_find_parameter(const separatrix_model *model, const char *path, int *index, char *message,
                              size_t message_size);

/* Angular frequency of the drive [rad/s] with other values in the parameters chosen[chosen_count]. */
int separatrix_drive_frequency(const separatrix_model *model, int chosen_count, const int *chosen,
                               const double *values, double *frequency, char *message, size_t message_size);

/* Segments of a motion, each from its own start: what separatrix_propagate is given and what it fills. Arrays
 * are contiguous, the last index runs fastest. Sizes come first; m = first[segment_count] is the number of
 * all samples. Set all members; those that a call does not use are 0 or NULL.
 *
 * The numbers of a start and of a sample are
 *   of one body
 *     start: x [m], v [m/s], crank angle [rad]; sample: x as the sensor shows it, v
 *   of a structure of n coordinates (separatrix_coordinate)
 *     start: n positions [m], n velocities [m/s], crank angle [rad]; sample: positions, velocities. The
 *     spring of elastic friction carries all of the friction at the start.
 *   with a motor
 *     start and sample: x [m], crank angle [rad], v [m/s], crank speed [rad/s], and current [A] (motor.law =
 *     "dc" with an inductance) or integral of the speed control [rad] ("pi"); of other motors the last one is
 *     not used at the start. A current that is not a number is that which follows the speed, as it does after
 *     some time constants; derivatives by it are 0. The crank angle goes on beyond a turn; a sample has the
 *     current of every dc motor. */
typedef struct separatrix_segments {
  int chosen_count;    /* parameters with values of their own */
  int direction_count; /* 0 without derivatives */
  int segment_count;
  int start_numbers;  /* as separatrix_segment_numbers has them */
  int sample_numbers; /* the same of a sample */
  int force_count;    /* 0: the measured force of the case */
  int derivatives;    /* 0: none, and jacobian may be NULL */
  int impact_capacity;
  double tolerance;      /* relative, of the adaptive flight, 1e-15 to 1e-3; exact flights need none */
  double force_interval; /* [s] */

  const int *chosen;    /* [chosen_count] indices of parameters */
  const double *values; /* [chosen_count] */

  /* [direction_count][chosen_count] along which the samples are differentiated: the change of each chosen
   * parameter per unit. One that has no room for a step either way within the bounds is an error. */
  const double *directions;
  const double *start; /* [segment_count][start_numbers] at the time 0 of each segment */
  const int *first;    /* [segment_count + 1]: samples of segment i are first[i] ... first[i + 1] - 1 */
  const double *times; /* [m] since the start of the segment [s], ascending within it, >= 0 */

  /* [force_count] with drive.law = "measured_force": samples [N] every force_interval in place of those of
   * the case. They are one turn of the crank: a segment that starts t seconds after the first has the crank
   * angle 2 pi t/((force_count - 1) force_interval). */
  const double *force;

  double *motion; /* out [m][sample_numbers] */

  /* out [m][sample_numbers][direction_count + start_numbers]: derivatives of motion along the directions,
   * then by the numbers of the start */
  double *jacobian;
  int *impacts; /* out [segment_count]: number of impacts */

  /* out [segment_count]: 1 if the neighbours that the derivatives are taken from meet the same stops in the
   * same order, none is grazed, and every sample has derivatives; 0: do not trust the derivatives */
  int *steady;

  /* out [segment_count]: 0, or why the segment could not be flown and has samples that are not numbers: 3
   * left the domain, 4 not finite, 5 too many events, 6 step size, 7 too many steps, 65 its start is not
   * finite or beyond a rigid barrier. Too many: over 20 000 within a drive period, and 32 more for each
   * sample of a measured force, or over integrator.event_budget or step_budget of the case if those are less.
   */
  int *reason;
  int *impact_segment; /* out [impact_capacity] */

  /* out [impact_capacity][5]: time since the start of the segment [s], number of the contact from 0 (0 of one
   * body and with a motor), its speed before and after [m/s], +1 upper or -1 lower stop. After a soft
   * contact: the speed when it ends, not a number if it lasts. */
  double *impact;
  int impact_count; /* out: how many impacts there were; those beyond the room are left out */
} separatrix_segments;

/* Numbers of a start and of a sample of segments of a model. */
int separatrix_segment_numbers(const separatrix_model *model, int *start_numbers, int *sample_numbers,
                               char *message, size_t message_size);

/* Flies segments of the motion and samples them. Results depend on a segment and the arguments common to all,
 * not on the other segments. Code 64 also for a pointer that is NULL where an array is needed; 65 for a
 * machine whose motion a start does not determine, as one with a ramp of the motor. */
int separatrix_propagate(const separatrix_model *model, separatrix_segments *segments, char *message,
                         size_t message_size);

/* Name of coordinate `index`, from 0, of a structure: a body, or a point or an inner coordinate of one of its
 * parts. Code 64 beyond the last; other machines have none. */
int separatrix_coordinate(const separatrix_model *model, int index, char *name, size_t name_size,
                          char *message, size_t message_size);

/* Name of contact `index`, from 0, of a structure. Code 64 beyond the last. */
int separatrix_contact(const separatrix_model *model, int index, char *name, size_t name_size, char *message,
                       size_t message_size);

/* Force of a joint of a structure, a spring or a soft contact, by its path (spring.NAME, contact.NAME) with
 * other values of parameters. Code 64 for an unknown joint, 65 for one without a force of its own.
 *
 * In:
 *   extension, speed [sample_count]
 *     s [m or rad] of its second end from the first, and its rate [m/s or rad/s]
 * Out:
 *   force, by_extension, by_speed [sample_count]
 *     what pulls the second end back [N or N m], and its derivatives */
int separatrix_joint_force(const separatrix_model *model, int chosen_count, const int *chosen,
                           const double *values, const char *joint, int sample_count, const double *extension,
                           const double *speed, double *force, double *by_extension, double *by_speed,
                           char *message, size_t message_size);

/* Numbers of a sample, an event and the summary of a trajectory, and of an attractor and a label. */
enum {
  separatrix_sample_numbers = 13,
  separatrix_event_numbers = 7,
  separatrix_summary_numbers = 28,
  separatrix_attractor_numbers = 55,
  separatrix_label_numbers = 13,
  separatrix_section_coordinates = 16
};

/* Flies one motion with every event, as the command `trajectory` does and with its bits, and to the end as
 * the command `points` does and with its bits. (The two differ by rounding where the machine flies in lanes.)
 *
 * In:
 *   start [3]
 *     x [m], v [m/s], crank angle [rad]
 *   duration
 *     seconds; 0: that of the case
 *   samples_per_period
 *     0: that of the case; negative: no samples
 *   sample_capacity, event_capacity
 *     room for samples and events
 *
 * Out:
 *   sample_count, event_count
 *     how many there are; those beyond the room are left out
 *   sample [sample_capacity][13]
 *     time [s], x [m], v [m/s], mode (1 slip_plus, 2 slip_minus, 3 stick, 4 upper_barrier, 5 lower_barrier,
 *     6 held); position of the foot of the spring [m] and not a number (with a motor the crank angle since
 * the start [rad]), of two bodies position [m] and velocity [m/s] of the driving one; force of soft barriers
 * on the body [N]; energy and kinetic energy [J]; lost since the start to friction, to damping and to
 *     contacts, put in by the drive [J] event [event_capacity][7] kind (docs/file-format.md), time [s], x
 * [m], v before and after [m/s]; of two bodies position and velocity of the driving one, otherwise not
 * numbers summary [28] As `points`: x [m], v [m/s], number of impacts, speed before the last [m/s], regime,
 * reason (codes of docs/file-format.md). As `trajectory`, over the cycle that the motion comes to, or the
 * window at the end: amplitude [m], largest and smallest x [m], largest v [m/s], impacts per drive period,
 * mean impact speed [m/s]. The machine: drive period [s], upper and lower barrier [m] (infinite: none), 1 if
 * they are soft, 1 if it has two bodies. Reason of the `trajectory`; its energy [J] at the start, lost to
 * friction, damping and contacts, put in; if it came to its end, energy at the end and what is missing in
 * this book, otherwise not numbers. Period of the cycle in drive periods, 0: none; not a number, and the
 * values are over the window, with a duration other than that of the case. 1 if a drive gives the drive
 * period, which else is a unit of time; 1 if the position is an angle, in rad for m. All of it is written
 * also where the motion was given up, as far as it went: the answer is then 78 */
int separatrix_trajectory(const separatrix_model *model, int chosen_count, const int *chosen,
                          const double *values, const double *start, double duration, int samples_per_period,
                          int sample_capacity, int *sample_count, double *sample, int event_capacity,
                          int *event_count, double *event, double *summary, char *message,
                          size_t message_size);

/* A machine and its attractors, as the command `basin` has them for a slice of a map. */
typedef struct separatrix_catalogue separatrix_catalogue;

/* The machine of a model with other values, without attractors yet. On success *catalogue must be given to
 * separatrix_catalogue_free at the end, otherwise it is NULL. The model may be freed before. */
int separatrix_catalogue_open(const separatrix_model *model, int chosen_count, const int *chosen,
                              const double *values, separatrix_catalogue **catalogue, char *message,
                              size_t message_size);

/* Frees a catalogue; NULL is allowed. */
void separatrix_catalogue_free(separatrix_catalogue *catalogue);

/* Adds the attractors to which starts lead, then orders and numbers all from 1. start_count negative: the
 * sample
 * ([attractors]) that `basin` takes over the axes of the case; otherwise start [start_count][3], as above.
 * Starts beyond a barrier are passed over. `stop`, if not NULL, is looked at between starts: not 0 ends the
 * search with code 75. While it runs nothing else may use the catalogue. */
int separatrix_catalogue_search(separatrix_catalogue *catalogue, int start_count, const double *start,
                                const int *stop, char *message, size_t message_size);

/* The same from starts of start_size numbers each: 3, or with a motor also 5, the further ones being crank
 * speed [rad/s], and current [A] or integral of the speed control [rad]. With 3 they are those of the case.
 * Another size is code 64. */
int separatrix_catalogue_search_from(separatrix_catalogue *catalogue, int start_count, int start_size,
                                     const double *start, const int *stop, char *message,
                                     size_t message_size);

/* Number of attractors. */
int separatrix_catalogue_size(const separatrix_catalogue *catalogue);

/* Attractor `index`, from 0. Code 64 for one with more than 16 coordinates on the section.
 *   numbers [55]
 *     label, regime, period in drive periods (0: not periodic, or a family), event word; x [m] and v [m/s]
 *     on the section
 *     at crank angle 0, of two bodies also those of the driving one; multiplier, capture radius, amplitude
 *     [m], largest and smallest x [m], largest v [m/s], impacts per drive period, mean impact speed [m/s],
 *     grazing margin [m] (infinite: none); 1 if it is the set of all positions of rest, 1 if it may be
 * anywhere between stops, number of coordinates on the section, 1 if the machine has two bodies, kind (the
 * codes of docs/file-format.md), time of one cycle [s] (0: none), real parts of its multipliers [16],
 * imaginary parts [16], one for each coordinate point_capacity, point_count, points [point_capacity][16] room
 * for points on the section, how many there are (those beyond the room are left out), and these: of one body
 * x [m] and v [m/s]; of a motion that is not periodic the lower and the upper corner of their box */
int separatrix_catalogue_attractor(const separatrix_catalogue *catalogue, int index, double *numbers,
                                   int point_capacity, int *point_count, double *points, char *message,
                                   size_t message_size);

/* Numbers the attractors of the slices of a map so that a branch keeps its label, as `basin` does: catalogues
 * [count] over shape [axis_count] values of the parameters, the last axis fastest. */
int separatrix_catalogue_number(int count, separatrix_catalogue *const *catalogues, int axis_count,
                                const int *shape, char *message, size_t message_size);

/* Where starts end up: values [start_count][13] = regime, attractor (0: none), reason, period, event word,
 * impacts per drive period, mean impact speed [m/s], amplitude [m], largest and smallest x [m], largest v
 * [m/s], settle time [s] (not a number: not captured), grazing margin [m] (infinite: no barrier missed), with
 * the bits of `basin` before they are rounded to the types of its file. All are 0 where the start is not
 * finite or beyond a barrier. `stop`, if not NULL, is looked at between some trajectories and the next: not 0
 * ends the work with code 75, and the values that were not computed are 0. Several threads may call it with
 * one catalogue. */
int separatrix_labels(const separatrix_catalogue *catalogue, int start_count, const double *start,
                      double *values, const int *stop, char *message, size_t message_size);

/* The same of starts of start_size numbers each, as in separatrix_catalogue_search_from. */
int separatrix_labels_from(const separatrix_catalogue *catalogue, int start_count, int start_size,
                           const double *start, double *values, const int *stop, char *message,
                           size_t message_size);

/* The resolved case with other values in the parameters chosen[chosen_count]: an ordinary case file. Writes
 * at most text_size characters, the null character included, and the length of the whole text without it. */
int separatrix_model_text(const separatrix_model *model, int chosen_count, const int *chosen,
                          const double *values, char *text, size_t text_size, size_t *length, char *message,
                          size_t message_size);

/* Row `index` of the catalogue of effects, one per parameter: effect, its meaning, parameter and unit;
 * numbers[4] = default, lower and upper bound (+-1.8e308: none), and 1 if the parameter is optional. Code 64
 * beyond the last row. */
int separatrix_effect_parameter(int index, char *effect, size_t effect_size, char *meaning,
                                size_t meaning_size, char *parameter, size_t parameter_size, char *unit,
                                size_t unit_size, double *numbers, char *message, size_t message_size);

/* Row `index` of the effects, one per effect: its name; the function that it is one shape of, and over what;
 * what it changes: "flight", "barrier" or "sensor"; its parameters in which what it does is linear near zero;
 * those that are positive sizes; the law or parameter that a machine must have for it. Lists are parted by
 * blanks. Code 64 beyond the last row. */
int separatrix_effect(int index, char *name, size_t name_size, char *family, size_t family_size, char *acts,
                      size_t acts_size, char *amplitudes, size_t amplitudes_size, char *sizes,
                      size_t sizes_size, char *needs, size_t needs_size, char *message, size_t message_size);

/* Row `index` of the pairs of effects that can be the same motion, and when. Code 64 beyond the last row. */
int separatrix_effect_confusion(int index, char *one, size_t one_size, char *other, size_t other_size,
                                char *reason, size_t reason_size, char *message, size_t message_size);

/* The model with an effect added, `count` of whose parameters are given as keys[count] and values[count]; the
 * others take their defaults; items of a list are keys like "change[2]", in their order. Code 65 if that
 * makes no valid case. To be freed like any other. */
int separatrix_model_with_effect(const separatrix_model *model, const char *effect, int count,
                                 const char *const *keys, const double *values, separatrix_model **extended,
                                 char *message, size_t message_size);

/* The model of a friction or backlash pair with its bodies "driving" and "driven", the joints between them
 * and the drive in tables of their own; without axes, sweep and derived quantities. Code 64 if the case has
 * no pair, 65 if its driving body moves on at a constant velocity, which no such table has. To be freed like
 * any other. */
int separatrix_model_written_out(const separatrix_model *model, separatrix_model **longer, char *message,
                                 size_t message_size);

#ifdef __cplusplus
}
#endif

#endif
