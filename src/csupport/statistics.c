// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Confidence limits, from the GNU Scientific Library.

#include <fenv.h>
#include <gsl/gsl_cdf.h>
#include <math.h>
#include <stdint.h>

// Clopper-Pearson upper limit of a share of which `found` in `sample` were seen. The inverse of the
// incomplete beta function in this library does not converge for some large samples, hence the bisection.
double separatrix_share_upper_limit(int64_t found, int64_t sample, double confidence) {
  if (sample <= 0 || found >= sample) {
    return 1.0;
  }
  if (found == 0) {
    return -expm1(log1p(-confidence) / (double)sample);
  }
  // Underflows and the like are the library's daily work, also where the program stops at them.
  fenv_t before;
  feholdexcept(&before);
  double lower = (double)found / (double)sample, upper = 1.0;
  for (int i = 0; i < 60; i++) {
    const double middle = lower + (upper - lower) / 2;
    if (gsl_cdf_beta_P(middle, (double)found + 1.0, (double)(sample - found)) < confidence) {
      lower = middle;
    } else {
      upper = middle;
    }
  }
  fesetenv(&before);
  return upper;
}
