/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

#ifndef SCHEDULER_MODEL_H
#define SCHEDULER_MODEL_H

struct scheduler_setting {
  int ranks, ranks_per_node;
  double share;          /* of the node's fair share of what is left that a block is */
  double latency;        /* of a message, seconds */
  double service;        /* time of rank 0 for a question, seconds */
  double pause;          /* between two looks of a rank that waits, seconds */
  double polls_per_tile; /* looks of rank 0 during a tile: trajectories of a tile */
  double run;            /* seconds of the tiles that a rank takes in a row, and between two writes */
  double write;          /* time of a call that writes beside that of the stripe, seconds */
  double lock;           /* time for which a call locks its stripe, seconds */
  double write_tile;     /* and of each tile in it */
  long most_held;        /* tiles that a rank holds at most before it writes */
  int stripes;           /* of the file, each with a lock of its own; 0: nothing is waited for */
  unsigned long long seed;
};

/* Arrays over the ranks, zeroed by the caller. */
struct outcome {
  double *busy, *finish; /* time in tiles; end of the last tile, or of the wait for one more */
  long *tiles, *questions;
  double *writing; /* time in calls that write */
  double service;  /* time of rank 0 spent on questions */
  long writes;     /* calls of all ranks that write tiles */
  int longest_queue;
};

/* `cost`: seconds of each tile in the order of handing out. 1 if memory is short. */
int simulate(const struct scheduler_setting *setting, long tiles, const double *cost,
             struct outcome *outcome);

#endif
