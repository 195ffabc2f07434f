/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* A copy of this process, for what may spoil the memory before it crashes. */
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

/* 0 in the copy, which prints nothing, its number in this process, -1 if there can be none. */
int separatrix_fork(void) {
  const int process = (int)fork();
  if (process != 0)
    return process;
  const int nowhere = open("/dev/null", O_WRONLY);
  if (nowhere < 0 || dup2(nowhere, STDERR_FILENO) < 0)
    close(STDERR_FILENO);
  return 0;
}

/* Waits for the copy; whether a signal, or a guard of its own, ended it. */
int separatrix_crashed(int process) {
  int status = 0;
  return waitpid(process, &status, 0) == process && !(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}
