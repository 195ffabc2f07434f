/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Stop signals set a counter that the scheduler reads between trajectories. */
#include <signal.h>
#include <stddef.h>

static volatile sig_atomic_t received = 0, terminated = 0;

static void count_signal(int number) {
  if (number == SIGTERM)
    terminated = 1;
  if (received < 1000000)
    received++;
}

/* The first Ctrl-C stops cleanly, the second at once. */
static void count_interrupt(int number) {
  signal(number, SIG_DFL);
  count_signal(number);
}

/* Ignores SIGXFSZ, so that a write beyond the file size limit comes back as an error. Returns 0, or -1. */
int separatrix_signals_ignore_file_limit(void) {
  struct sigaction action = {0};
  action.sa_handler = SIG_IGN;
  return sigaction(SIGXFSZ, &action, NULL);
}

/* SIGUSR1, SIGUSR2, SIGTERM and the first SIGINT are counted. Returns 0, or -1 if a handler cannot be set. */
int separatrix_signals_install(void) {
  static const int counted[] = {SIGUSR1, SIGUSR2, SIGTERM};
  struct sigaction action = {0};
  action.sa_handler = count_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (size_t i = 0; i < sizeof counted / sizeof *counted; i++) {
    if (sigaction(counted[i], &action, NULL) != 0)
      return -1;
  }
  action.sa_handler = count_interrupt;
  return sigaction(SIGINT, &action, NULL);
}

int separatrix_signals_received(void) { return (int)received; }

/* Whether SIGTERM was among them. */
int separatrix_signals_terminated(void) { return (int)terminated; }

void separatrix_signals_clear(void) {
  received = 0;
  terminated = 0;
}

/* Sends a signal to this process. */
int separatrix_signals_raise(int number) { return raise(number); }
