/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Discrete events of the two-level scheduler of src/parallel: a rank asks for its next tile, a node's
 * question reaches rank 0, rank 0 looks for questions, a block reaches a node. */
#include "scheduler_model.h"

#include <math.h>
#include <stdlib.h>

enum kind { FREE, ARRIVE, POLL, REPLY };

struct event {
  double time;
  enum kind kind;
  int who;
};

struct node {
  long next, last;             /* positions in the pool, from 0; empty if last < next */
  long block_next, block_last; /* the block under way */
  int first, size;             /* its ranks */
  int asker;                   /* the rank that refills, -1: none */
  int waiting;                 /* head of the list of ranks that wait for the refill, -1: none */
  int exhausted;
};

struct rank {
  long next, last; /* positions of its run, from 0; empty if last < next */
  long held;       /* tiles done and not written */
  long pieces;     /* that they are in the file: each is written by a call */
  long done;       /* position after the last tile done */
  double written;  /* when it wrote last */
  int waits;       /* its last tile is accounted for */
};

struct model {
  const struct scheduler_setting *setting;
  const double *cost;
  struct outcome *outcome;
  struct node *nodes;
  struct rank *own;
  int *node_of, *next_waiting;
  struct event *heap;
  long events, room;
  int *queue; /* nodes whose questions rank 0 has not answered yet */
  int queued, poll_due;
  double *stripe_free; /* from when on each stripe of the file can be written */
  double root_begin, root_cost, serving_until;
  int root_idle;
  unsigned long long random;
  int failed;
};

static double uniform(struct model *m) {
  /* splitmix64 */
  unsigned long long z = (m->random += 0x9E3779B97F4A7C15ULL);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static void push(struct model *m, double time, enum kind kind, int who) {
  if (m->events == m->room) {
    struct event *longer = realloc(m->heap, 2 * (size_t)m->room * sizeof *longer);
    if (!longer) {
      m->failed = 1;
      return;
    }
    m->heap = longer;
    m->room *= 2;
  }
  long i = m->events++;
  while (i > 0 && m->heap[(i - 1) / 2].time > time) {
    m->heap[i] = m->heap[(i - 1) / 2];
    i = (i - 1) / 2;
  }
  m->heap[i] = (struct event){time, kind, who};
}

static struct event pop(struct model *m) {
  struct event top = m->heap[0], last = m->heap[--m->events];
  long i = 0;
  for (;;) {
    long child = 2 * i + 1;
    if (child >= m->events)
      break;
    if (child + 1 < m->events && m->heap[child + 1].time < m->heap[child].time)
      child++;
    if (m->heap[child].time >= last.time)
      break;
    m->heap[i] = m->heap[child];
    i = child;
  }
  m->heap[i] = last;
  return top;
}

/* As mpi_node%take: up to one position, or the share of what is left if that is more. */
static long take(struct node *pool, double share, long *first) {
  long left = pool->last - pool->next + 1, count = (long)((double)left * share);
  if (count < 1)
    count = 1;
  if (count > left)
    count = left;
  *first = pool->next;
  pool->next += count;
  return count;
}

/* As mpi_node%take_run: as many positions as take about the time of a run, fewer when little is left for all
 * who take. */
static void take_run(struct model *m, int rank, struct node *pool) {
  struct rank *own = &m->own[rank];
  double mean = m->outcome->tiles[rank] ? m->outcome->busy[rank] / (double)m->outcome->tiles[rank] : INFINITY;
  int takers = m->node_of[rank] == 0 ? m->setting->ranks : pool->size;
  long left = pool->last - pool->next + 1, most = left / (8L * takers);
  long count = (long)fmin(m->setting->run / mean, 1000);
  if (count > most)
    count = most;
  if (count < 1)
    count = 1;
  if (count > left)
    count = left;
  own->next = pool->next;
  own->last = pool->next + count - 1;
  pool->next += count;
}

/* Writes what a rank holds, neighbours in one call, and returns when it is done. A stripe is locked by one
 * rank at a time; the calls of a rank follow one another in one stripe. */
static double write_tiles(struct model *m, double time, int rank) {
  const struct scheduler_setting *setting = m->setting;
  struct rank *own = &m->own[rank];
  if (own->held == 0)
    return time;
  double start = time + (double)own->pieces * setting->write;
  double *stripe = setting->stripes > 0 ? &m->stripe_free[(int)(uniform(m) * setting->stripes)] : NULL;
  if (stripe && *stripe > start)
    start = *stripe;
  double end = start + (double)own->pieces * setting->lock + (double)own->held * setting->write_tile;
  if (stripe)
    *stripe = end;
  m->outcome->writes += own->pieces;
  m->outcome->writing[rank] += end - time;
  own->held = 0;
  own->pieces = 0;
  own->written = end;
  return end;
}

static double pause_end(struct model *m, double time) { return time + m->setting->pause * uniform(m); }

/* Rank 0 looks between two trajectories of its tile, and every pause once it has no tile. */
static void plan_poll(struct model *m, double time) {
  if (m->poll_due || m->queued == 0)
    return;
  double when;
  if (time < m->serving_until) {
    when = m->serving_until;
  } else if (m->root_idle) {
    when = pause_end(m, time);
  } else {
    double gap = m->root_cost / m->setting->polls_per_tile;
    when = m->root_begin + gap * ceil((time - m->root_begin) / gap);
    if (when < time)
      when = time;
  }
  m->poll_due = 1;
  push(m, when, POLL, 0);
}

static void begin_tile(struct model *m, double time, int rank, long position) {
  double cost = m->cost[position];
  m->outcome->busy[rank] += cost;
  m->outcome->tiles[rank]++;
  if (rank == 0) {
    m->root_begin = time;
    m->root_cost = cost;
  }
  push(m, time + cost, FREE, rank);
}

static void ask(struct model *m, double time, int rank) {
  struct node *node = &m->nodes[m->node_of[rank]];
  if (node->asker >= 0) {
    m->next_waiting[rank] = node->waiting;
    node->waiting = rank;
    return;
  }
  node->asker = rank;
  m->outcome->questions[rank]++;
  push(m, time + m->setting->latency, ARRIVE, m->node_of[rank]);
}

/* A rank asks for its next tile. */
static void rank_free(struct model *m, double time, int rank) {
  int number = m->node_of[rank];
  struct node *node = &m->nodes[number];
  struct rank *own = &m->own[rank];
  /* questions have taken time from the tile of rank 0 */
  if (rank == 0 && !m->root_idle && m->root_cost > 0 && time < m->root_begin + m->root_cost * (1 - 1e-12)) {
    push(m, m->root_begin + m->root_cost, FREE, 0);
    return;
  }
  if (own->waits) {
    own->pieces += own->held == 0 || own->next - 1 != own->done;
    own->done = own->next;
    own->held++;
    own->waits = 0;
    if (time - own->written >= m->setting->run || own->held == m->setting->most_held)
      time = write_tiles(m, time, rank);
  }
  if (own->next > own->last)
    take_run(m, rank, node);
  if (own->next > own->last)
    time = write_tiles(m, time, rank);
  m->outcome->finish[rank] = time;
  if (own->next <= own->last) {
    own->waits = 1;
    begin_tile(m, time, rank, own->next++);
  } else if (number > 0 && !node->exhausted) {
    ask(m, time, rank);
  } else if (rank == 0) {
    m->root_idle = 1;
  }
}

/* Rank 0 answers what has arrived. */
static void serve(struct model *m, double time) {
  m->poll_due = 0;
  double now = time;
  for (int i = 0; i < m->queued; i++) {
    struct node *node = &m->nodes[m->queue[i]];
    now += m->setting->service;
    double share = m->setting->share * node->size / m->setting->ranks;
    node->block_last = take(&m->nodes[0], share, &node->block_next);
    node->block_last += node->block_next - 1;
    push(m, now + m->setting->latency, REPLY, m->queue[i]);
  }
  if (m->queued > m->outcome->longest_queue)
    m->outcome->longest_queue = m->queued;
  m->queued = 0;
  m->serving_until = now;
  m->outcome->service += now - time;
  if (!m->root_idle)
    m->root_begin += now - time;
}

/* A block is there: the pool is filled, those who wait look again at the end of their pause. */
static void refill(struct model *m, double time, int number) {
  struct node *node = &m->nodes[number];
  int rank = node->asker;
  time = pause_end(m, time);
  if (node->block_last < node->block_next)
    node->exhausted = 1;
  node->next = node->block_next;
  node->last = node->block_last;
  node->asker = -1;
  push(m, time, FREE, rank);
  for (rank = node->waiting; rank >= 0; rank = m->next_waiting[rank])
    push(m, pause_end(m, time), FREE, rank);
  node->waiting = -1;
}

static int set_up(struct model *m, long tiles) {
  int ranks = m->setting->ranks, per_node = m->setting->ranks_per_node;
  int nodes = (ranks + per_node - 1) / per_node;
  m->room = 2 * (long)ranks + 16;
  m->nodes = calloc((size_t)nodes, sizeof *m->nodes);
  m->node_of = calloc((size_t)ranks, sizeof *m->node_of);
  m->own = calloc((size_t)ranks, sizeof *m->own);
  m->next_waiting = calloc((size_t)ranks, sizeof *m->next_waiting);
  m->queue = calloc((size_t)nodes, sizeof *m->queue);
  m->heap = calloc((size_t)m->room, sizeof *m->heap);
  m->stripe_free = calloc((size_t)m->setting->stripes + 1, sizeof *m->stripe_free);
  if (!m->stripe_free || !m->nodes || !m->own || !m->node_of || !m->next_waiting || !m->queue || !m->heap)
    return 1;
  for (int i = 0; i < nodes; i++) {
    int first = i * per_node, size = per_node < ranks - first ? per_node : ranks - first;
    m->nodes[i] = (struct node){.last = -1, .first = first, .size = size, .asker = -1, .waiting = -1};
  }
  m->nodes[0].last = tiles - 1;
  for (int i = 0; i < ranks; i++) {
    m->own[i] = (struct rank){.last = -1, .written = -INFINITY};
    m->node_of[i] = i / per_node;
    push(m, 0, FREE, i);
  }
  return m->failed;
}

int simulate(const struct scheduler_setting *setting, long tiles, const double *cost,
             struct outcome *outcome) {
  struct model m = {.setting = setting, .cost = cost, .outcome = outcome, .random = setting->seed};
  int status = set_up(&m, tiles);
  while (!status && m.events > 0) {
    struct event event = pop(&m);
    switch (event.kind) {
    case FREE:
      rank_free(&m, event.time, event.who);
      break;
    case ARRIVE:
      m.queue[m.queued++] = event.who;
      break;
    case POLL:
      serve(&m, event.time);
      break;
    case REPLY:
      refill(&m, event.time, event.who);
      break;
    }
    plan_poll(&m, event.time);
    status = m.failed;
  }
  free(m.nodes);
  free(m.own);
  free(m.node_of);
  free(m.next_waiting);
  free(m.queue);
  free(m.stripe_free);
  free(m.heap);
  return status;
}
