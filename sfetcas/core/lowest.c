/* The lowest eigenvalues of the energy on the closings: what is plain of StabilityTest in sfetcas/solvers/stability.py. */

#include <math.h>
#include <stddef.h>

#include "core.h"

#define SF_BLOCK 4 /* vectors that are iterated together */

int sf_lowest_size(const sf_model *m) { return m->entry_count + (2 * SF_BLOCK + 4) * m->total; }

/* Eigenvalues of a small symmetric matrix, rising, and its vectors as columns, by rotations of Jacobi. */
static void sf_jacobi(double a[SF_BLOCK][SF_BLOCK], double *values, double v[SF_BLOCK][SF_BLOCK]) {
  int sweep, i, j, k;
  for (i = 0; i < SF_BLOCK; ++i)
    for (j = 0; j < SF_BLOCK; ++j) v[i][j] = i == j;
  for (sweep = 0; sweep < 50; ++sweep) {
    double off = 0.0;
    for (i = 0; i < SF_BLOCK; ++i)
      for (j = 0; j < i; ++j) off += fabs(a[i][j]);
    if (!(off > 0.0)) break;
    for (i = 0; i < SF_BLOCK; ++i)
      for (j = 0; j < i; ++j) {
        double half, t, c, s;
        if (a[i][j] == 0.0) continue;
        half = (a[i][i] - a[j][j]) / (2.0 * a[i][j]);
        t = (half < 0.0 ? -1.0 : 1.0) / (fabs(half) + sqrt(half * half + 1.0));
        c = 1.0 / sqrt(t * t + 1.0);
        s = t * c;
        for (k = 0; k < SF_BLOCK; ++k) {
          double x = a[k][i], y = a[k][j];
          a[k][i] = c * x + s * y;
          a[k][j] = c * y - s * x;
        }
        for (k = 0; k < SF_BLOCK; ++k) {
          double x = a[i][k], y = a[j][k], p = v[k][i], q = v[k][j];
          a[i][k] = c * x + s * y;
          a[j][k] = c * y - s * x;
          v[k][i] = c * p + s * q;
          v[k][j] = c * q - s * p;
        }
        a[i][j] = a[j][i] = 0.0;
      }
  }
  for (i = 0; i < SF_BLOCK; ++i) values[i] = a[i][i];
  for (i = 1; i < SF_BLOCK; ++i)
    for (j = i; j > 0 && values[j] < values[j - 1]; --j) {
      double one = values[j];
      values[j] = values[j - 1];
      values[j - 1] = one;
      for (k = 0; k < SF_BLOCK; ++k) {
        one = v[k][j];
        v[k][j] = v[k][j - 1];
        v[k][j - 1] = one;
      }
    }
}

/* The lowest eigenvalues by the weights above a shift that is below them all, and their vectors, (block, total).
 *
 * Inverse iteration of a block: the shifted matrix keeps vectors on the closings.  Of the vectors what has no weight is
 * zero, and the inner product by the weights with itself one.  Returns 0 where the first two values are known to a share
 * "least" of the larger one or of the shift, 1 where they are not, 2 where factors have no room.
 */
int sf_lowest(const sf_model *m, sf_system *system, const double *entries, const double *weight, double shift,
              double least, double dual, double *values, double *vectors, double *memory) {
  double *matrix = memory, *right = matrix + m->entry_count, *found = right + SF_BLOCK * m->total;
  double *work = found + SF_BLOCK * m->total, last[2] = {HUGE_VAL, HUGE_VAL};
  unsigned long long seed = 1;
  int n = m->total, round, i, j, k, broken;
  for (k = 0; k < SF_BLOCK; ++k)
    for (i = 0; i < n; ++i) {
      /* Any vectors that are the same everywhere. */
      seed = (seed * 1103515245ULL + 12345ULL) % 2147483648ULL;
      vectors[k * n + i] = weight[i] > 0.0 ? ((double)seed / 1073741824.0 - 1.0) / sqrt(weight[i]) : 0.0;
    }
  for (round = 0; round < 30; ++round) {
    double h[SF_BLOCK][SF_BLOCK], turn[SF_BLOCK][SF_BLOCK], size;
    sf_copy(matrix, entries, m->entry_count);
    for (i = 0; i < m->unknowns; ++i) matrix[m->diagonal[i]] -= shift * weight[i];
    for (i = m->unknowns; i < n; ++i) matrix[m->diagonal[i]] -= dual;
    for (k = 0; k < SF_BLOCK; ++k)
      for (i = 0; i < n; ++i) right[k * n + i] = weight[i] * vectors[k * n + i];
    /* No answer depends on what was solved before. */
    system->pivoted->known = 0;
    broken = sf_solve(system, matrix, SF_BLOCK, right, found, work);
    if (broken) return broken;
    for (k = 0; k < SF_BLOCK; ++k) {
      double *own = found + (size_t)k * n;
      int again;
      for (i = 0; i < n; ++i)
        if (!(weight[i] > 0.0)) own[i] = 0.0;
      /* Twice, as what is nearly along the others loses digits. */
      for (again = 0; again < 2; ++again) {
        for (j = 0; j < k; ++j) {
          const double *other = found + (size_t)j * n;
          double along = sf_weighed(n, weight, other, own);
          for (i = 0; i < n; ++i) own[i] -= along * other[i];
        }
        size = sqrt(sf_weighed(n, weight, own, own));
        if (!(size > 0.0) || !sf_is_finite(size)) return 1;
        for (i = 0; i < n; ++i) own[i] /= size;
      }
    }
    for (k = 0; k < SF_BLOCK; ++k) {
      const double *own = found + (size_t)k * n;
      for (i = 0; i < n; ++i) work[i] = 0.0;
      for (i = 0; i < m->entry_count; ++i) work[m->entry_row[i]] += entries[i] * own[m->entry_column[i]];
      for (j = 0; j < SF_BLOCK; ++j) {
        double sum = 0.0;
        for (i = 0; i < n; ++i) sum += found[(size_t)j * n + i] * work[i];
        h[j][k] = sum;
      }
    }
    for (j = 0; j < SF_BLOCK; ++j)
      for (k = 0; k < j; ++k) h[j][k] = h[k][j] = 0.5 * (h[j][k] + h[k][j]);
    sf_jacobi(h, values, turn);
    for (i = 0; i < n; ++i)
      for (k = 0; k < SF_BLOCK; ++k) {
        double sum = 0.0;
        for (j = 0; j < SF_BLOCK; ++j) sum += found[(size_t)j * n + i] * turn[j][k];
        vectors[(size_t)k * n + i] = sum;
      }
    size = fabs(values[1]) > fabs(shift) ? fabs(values[1]) : fabs(shift);
    if (!sf_all_finite(values, SF_BLOCK)) return 1;
    if (fabs(values[0] - last[0]) <= least * size && fabs(values[1] - last[1]) <= least * size) return 0;
    last[0] = values[0];
    last[1] = values[1];
    /* Each solve factorises anyway: a nearer shift is free and converges ten times as fast. */
    if (round >= 2) shift = values[0] - 0.1 * (values[SF_BLOCK - 1] - values[0]) - 1e-3 * fabs(values[0]);
  }
  return 1;
}
