/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* HDF5 1.10 itself breaks on some damaged files, in texts that it keeps without a checksum. While a file is
   read that may be damaged, such an end becomes a message and exit code 74. */
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { code_io = 74, guarded_signals = 4 };

static const int guarded[guarded_signals] = {SIGSEGV, SIGBUS, SIGFPE, SIGABRT};
static struct sigaction before[guarded_signals];
static char message[512];
static size_t message_length;
static int active = 0;

static void report(int number) {
  (void)number;
  const ssize_t ignored = write(STDERR_FILENO, message, message_length);
  (void)ignored;
  _exit(code_io);
}

/* Until `separatrix_guard_end`, for the file `path`. */
void separatrix_guard_begin(const char *path) {
  struct sigaction action = {0};
  snprintf(message, sizeof message - 1, "separatrix: '%.400s' is damaged: reading it broke the HDF5 library",
           path);
  strcat(message, "\n");
  message_length = strlen(message);
  if (active)
    return;
  active = 1;
  action.sa_handler = report;
  sigemptyset(&action.sa_mask);
  for (int i = 0; i < guarded_signals; i++)
    sigaction(guarded[i], &action, &before[i]);
}

void separatrix_guard_end(void) {
  if (!active)
    return;
  active = 0;
  for (int i = 0; i < guarded_signals; i++)
    sigaction(guarded[i], &before[i], NULL);
}

/* A copy of this process, which says nothing when it crashes: 0 in the copy, its number in this one, -1 if
   there can be none. */
int separatrix_fork(void) {
  const int process = (int)fork();
  for (int i = 0; process == 0 && i < guarded_signals; i++)
    signal(guarded[i], SIG_DFL);
  return process;
}

/* Waits for the copy; whether it was ended by a signal. */
int separatrix_crashed(int process) {
  int status = 0;
  return waitpid(process, &status, 0) == process && WIFSIGNALED(status);
}
