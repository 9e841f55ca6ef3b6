/* Sparse symmetric systems: factors L D L^T without pivoting, signs of the pivots, and solutions by refinement.
 *
 * Row by row: the pattern of a row of L are the places that the tree of eliminations reaches from the entries of the
 * matrix in it.  Matrices that are positive in some unknowns and negative in the others have such factors in any order,
 * so that one is chosen in which they stay sparse.
 *
 * Sources: Vanderbei 1995; Davis 2006, Direct Methods for Sparse Linear Systems, chapter 4.
 */

#include <math.h>
#include <stddef.h>

#include "core.h"

/* The tree of eliminations and the columns of L: factors->filled is their number of entries. */
int sf_count(sf_factors *f) {
  int k, p, i, n = f->n;
  for (k = 0; k < n; ++k) f->used[k] = 0;
  for (k = 0; k < n; ++k) {
    int from = f->order[k];
    f->parent[k] = -1;
    f->mark[k] = k;
    for (p = f->start[from]; p < f->start[from + 1]; ++p)
      for (i = f->place[f->row[p]]; i < k && f->mark[i] != k; i = f->parent[i]) {
        if (f->parent[i] < 0) f->parent[i] = k;
        ++f->used[i];
        f->mark[i] = k;
      }
  }
  f->lower[0] = 0;
  for (k = 0; k < n; ++k) f->lower[k + 1] = f->lower[k] + f->used[k];
  f->filled = f->lower[n];
  return 0;
}

/* One row of the factors; soft is added to the diagonal. */
static int sf_row(sf_factors *f, const double *entries, double soft, int k) {
  double pivot = soft, added = fabs(soft), *column = f->column;
  int from = f->order[k], top = f->n, p, i;
  f->mark[k] = k;
  f->used[k] = 0;
  for (p = f->start[from]; p < f->start[from + 1]; ++p) {
    int length = 0;
    i = f->place[f->row[p]];
    if (i > k) continue;
    if (i == k) {
      pivot += entries[p];
      added += fabs(entries[p]);
      continue;
    }
    column[i] += entries[p];
    for (; f->mark[i] != k; i = f->parent[i]) {
      f->path[length++] = i;
      f->mark[i] = k;
    }
    while (length) f->path[--top] = f->path[--length];
  }
  for (; top < f->n; ++top) {
    double value, share;
    int at, end;
    i = f->path[top];
    value = column[i];
    column[i] = 0.0;
    at = f->lower[i];
    end = at + f->used[i];
    for (p = at; p < end; ++p) column[f->lower_row[p]] -= f->value[p] * value;
    share = value / f->pivot[i];
    pivot -= share * value;
    added += fabs(share * value);
    f->lower_row[end] = k;
    f->value[end] = share;
    ++f->used[i];
  }
  f->pivot[k] = pivot;
  /* Its sign is that of rounding where next to nothing is left of what was added up. */
  if (!(fabs(pivot) >= f->least * added)) f->least = added > 0.0 ? fabs(pivot) / added : 0.0;
  return pivot == 0.0;
}

static int sf_factorise_softly(sf_factors *f, const double *entries, const double *soft, int *negative) {
  int k, broken = 0;
  *negative = 0;
  f->least = 1.0;
  for (k = 0; k < f->n; ++k) f->column[k] = 0.0;
  for (k = 0; k < f->n; ++k) f->mark[k] = -1;
  for (k = 0; k < f->n && !broken; ++k) {
    broken = sf_row(f, entries, soft ? soft[f->order[k]] : 0.0, k);
    *negative += f->pivot[k] < 0.0;
  }
  return broken;
}

/* Factors of a matrix and the number of its negative pivots; 1 where a pivot is zero. */
int sf_factorise(sf_factors *f, const double *entries, int *negative) {
  return sf_factorise_softly(f, entries, NULL, negative);
}

/* Solutions (columns, n) in place of right sides, by the last factors; work (n,). */
int sf_backward(const sf_factors *f, int columns, double *x, double *work) {
  int c, k, p, n = f->n;
  for (c = 0; c < columns; ++c, x += n) {
    for (k = 0; k < n; ++k) work[k] = x[f->order[k]];
    for (k = 0; k < n; ++k)
      for (p = f->lower[k]; p < f->lower[k + 1]; ++p) work[f->lower_row[p]] -= f->value[p] * work[k];
    for (k = n - 1; k >= 0; --k) {
      double sum = work[k] / f->pivot[k];
      for (p = f->lower[k]; p < f->lower[k + 1]; ++p) sum -= f->value[p] * work[f->lower_row[p]];
      work[k] = sum;
    }
    for (k = 0; k < n; ++k) x[f->order[k]] = work[k];
  }
  return 0;
}

static double sf_largest(const double *x, int n) {
  double most = 0.0;
  int i;
  for (i = 0; i < n; ++i) {
    double size = fabs(x[i]);
    if (size != size) return size;
    if (size > most) most = size;
  }
  return most;
}

#include "pivoted.h"

/* What is left of b for x. */
static void sf_left(const sf_factors *f, const double *entries, const double *b, const double *x, double *left) {
  int k, p;
  for (k = 0; k < f->n; ++k) left[k] = b[k];
  for (k = 0; k < f->n; ++k)
    for (p = f->start[k]; p < f->start[k + 1]; ++p) left[f->row[p]] -= entries[p] * x[k];
}

#define SF_ROUNDS 8 /* of refinement at most; usual are three */
#define SF_NOTHING 1e-16 /* what is left, over matrix times solution, at which refinement ends */
#define SF_AS_GOOD 1e-2  /* share of what may be left that factors of another matrix leave: as little as its own do */

/* Solutions (columns, n) for right sides b by refinement with the last factors, and the largest of what is left over
 * matrix times solution; not finite where there is none.  work (4 n,). */
static double sf_refined(const sf_system *system, int pivoted, const double *entries, int columns, const double *b,
                         double *x, double *work) {
  const sf_factors *f = system->factors;
  int c, i, round, n = f->n;
  double size = sf_largest(entries, f->entries), *left = work, *step = work + n, *trial = work + 2 * n, error = 0.0;
  for (c = 0; c < columns; ++c, b += n, x += n) {
    double most = sf_largest(b, n), last = HUGE_VAL;
    for (i = 0; i < n; ++i) {
      trial[i] = 0.0;
      left[i] = b[i];
      x[i] = NAN;
    }
    for (round = 0; round < SF_ROUNDS; ++round) {
      double share;
      int gained;
      for (i = 0; i < n; ++i) step[i] = left[i];
      if (pivoted)
        sf_pivoted_backward(system->pivoted, step, work + 3 * n);
      else
        sf_backward(f, 1, step, work + 3 * n);
      for (i = 0; i < n; ++i) trial[i] += step[i];
      sf_left(f, entries, b, trial, left);
      share = sf_largest(left, n) / (size * sf_largest(trial, n) + most + 1e-300);
      if (!(share < last)) break;
      for (i = 0; i < n; ++i) x[i] = trial[i];
      gained = last > 4.0 * share;
      last = share;
      if (share <= SF_NOTHING || !gained) break;
    }
    if (!(last <= error)) error = last;
  }
  return error;
}

/* Solutions (columns, n) for right sides b; 1 where the matrix is singular, 2 where factors have no room.
 *
 * Symmetric matrices are factorised without pivoting after their diagonal was made soft, which refinement takes back;
 * where that does not converge, and after it often did not, with pivoting, by the pivots of the last matrix where they
 * serve.
 */
int sf_solve(sf_system *system, const double *entries, int columns, const double *b, double *x, double *work) {
  int negative, found;
  double error;
  if (system->symmetric && system->lost < system->often) {
    error = HUGE_VAL;
    if (!sf_factorise_softly(system->factors, entries, system->soft, &negative))
      error = sf_refined(system, 0, entries, columns, b, x, work);
    if (error <= system->solved) {
      system->lost = 0;
      return 0;
    }
    ++system->lost;
  }
  if (system->pivoted->known > 1) {
    /* What the factors of the last matrix miss of this one refinement makes up for, if it is little. */
    error = sf_refined(system, 1, entries, columns, b, x, work);
    if (error <= SF_AS_GOOD * system->solved) return 0;
  }
  if (!sf_pivot_again(system->pivoted, entries)) {
    error = sf_refined(system, 1, entries, columns, b, x, work);
    if (error <= system->solved) return 0;
  }
  found = sf_pivot(system->pivoted, entries);
  if (found) return found;
  error = sf_refined(system, 1, entries, columns, b, x, work);
  return !(error - error == 0.0);
}
