/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* For the program of the same build, which needs no trace of its basic blocks. */
void __sanitizer_cov_trace_pc(void) {}
