/* Lemke's pivots for linear complementarity: see sfetcas/mathematics/complementarity.py, where the same is in NumPy.
 *
 * Source: Lemke 1965; Cottle, Pang and Stone 2009, The Linear Complementarity Problem, section 4.4.
 */

#include <math.h>
#include <stddef.h>

#include "core.h"

/* Whether a row of the inverse of the basis over a pivot comes before another one in the order of words. */
static int sf_before(const double *row, double pivot, const double *other, double of_other, int n) {
  int k;
  for (k = 0; k < n; ++k) {
    double a = row[k] / pivot, b = other[k] / of_other;
    if (a != b) return a < b;
  }
  return 0;
}

/* Pivots on a table (n, 2 n + 2) from that of a row and the last column but one on: 0 where the number of that column
 * leaves the basis (n,), which then is that of a solution; 1 where no pivot leads on, or so many do not suffice.
 *
 * Of a column a pivot is at least a share flat of the largest; of ratios that are equal to a share rounding of
 * themselves and of size the first in the order of words is taken, which does not go round.
 */
int sf_lemke(int n, double *table, int *basis, int out, int pivots, double flat, double rounding, double size) {
  int width = 2 * n + 2, last = 2 * n + 1, enters = 2 * n, i, k;
  for (; pivots > 0; --pivots) {
    double *row = table + (size_t)out * width, pivot = row[enters], most = 1e-300, least = HUGE_VAL, bound;
    int left = basis[out], chosen = -1;
    for (k = 0; k < width; ++k) row[k] /= pivot;
    for (i = 0; i < n; ++i) {
      double *other = table + (size_t)i * width, share = other[enters];
      if (i == out || share == 0.0) continue;
      for (k = 0; k < width; ++k) other[k] -= share * row[k];
    }
    basis[out] = enters;
    if (left == 2 * n) return 0;
    /* What has left lets its partner in: of each pair one is zero. */
    enters = left < n ? left + n : left - n;
    for (i = 0; i < n; ++i) {
      double entry = fabs(table[(size_t)i * width + enters]);
      if (entry > most) most = entry;
    }
    for (i = 0; i < n; ++i) {
      const double *each = table + (size_t)i * width;
      if (each[enters] > flat * most && each[last] / each[enters] < least) least = each[last] / each[enters];
    }
    bound = (1.0 + rounding) * least + rounding * size;
    for (i = 0; i < n; ++i) {
      const double *each = table + (size_t)i * width, *best = table + (size_t)(chosen < 0 ? 0 : chosen) * width;
      if (!(each[enters] > flat * most) || !(each[last] / each[enters] <= bound)) continue;
      if (basis[i] == 2 * n) {
        chosen = i;
        break;
      }
      if (chosen < 0 || sf_before(each, each[enters], best, best[enters], n)) chosen = i;
    }
    /* None is able, or numbers have grown beyond all bounds. */
    if (chosen < 0) return 1;
    out = chosen;
  }
  return 1;
}
