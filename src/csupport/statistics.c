// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Confidence limits, from the GNU Scientific Library.

#include <gsl/gsl_cdf.h>
#include <stdint.h>

// Clopper-Pearson upper limit of a share of which `found` in `sample` were seen.
double separatrix_share_upper_limit(int64_t found, int64_t sample, double confidence) {
  if (sample <= 0 || found >= sample) {
    return 1.0;
  }
  return gsl_cdf_beta_Pinv(confidence, (double)found + 1.0, (double)(sample - found));
}
