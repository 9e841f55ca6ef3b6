/* A curve of equilibria under loads times an unknown factor: the plain part of sfetcas/solvers/tracing.py.
 *
 * Plain are steps on which no eigenvalue changes its sign or is near to zero, the factor does not turn or leave its
 * range, rows do not come near to depending on each other, and the curve does not come back to where it began.  A step
 * that is not is left to the caller, who takes it by the same rules and knows what to do about it.
 */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"
#include "elementary.h"

/* Where the parts of the memory of a curve begin: that of counting and correcting, two states, and vectors. */
typedef struct {
  double *following, *step, *row, *given, *matrix, *right, *both, *results, *solving, *products;
  sf_state expected, there;
} sf_along;

static int sf_make_along(const sf_model *m, double *memory, sf_along *along) {
  int n = 0;
#define PART(part, count) \
  if (memory) along->part = memory + n; \
  n += (count)
  PART(following, sf_follow_size(m));
  PART(step, m->total);
  PART(row, m->total);
  PART(given, m->given);
  PART(matrix, m->entry_count);
  PART(right, 2 * m->total);
  PART(both, 2 * m->total);
  PART(results, m->results);
  PART(solving, 4 * m->total);
  PART(products, m->rows * (m->rows + 1));
#undef PART
  if (memory) {
    sf_lay_out(m, memory + n, &along->expected);
    sf_lay_out(m, memory + n + sf_state_size(m), &along->there);
  }
  return n + 2 * sf_state_size(m);
}

int sf_trace_size(const sf_model *m) { return sf_make_along(m, NULL, NULL); }

/* Inner product of two vectors by weights. */
static double sf_weighed(int n, const double *weight, const double *a, const double *b) {
  double sum = 0.0;
  int i;
  for (i = 0; i < n; ++i) sum += a[i] * (weight[i] * b[i]);
  return sum;
}

/* Inner product of two directions, see Curve.inner. */
static double sf_inner(const sf_model *m, const sf_curve *curve, const double *a, const double *b) {
  return sf_weighed(m->total, curve->metric, a, b) + a[m->total] * b[m->total] / (curve->unit * curve->unit);
}

/* Largest angle between the rotations of two states, which come first in their numbers; plane angles count whole turns. */
static double sf_apart(const sf_model *m, const double *a, const double *b) {
  double most = 0.0;
  int i;
  for (i = 0; i < m->rotations; ++i) {
    double angle;
    if (m->space) {
      double conjugate[4], turn[4];
      const double *from = a + (size_t)4 * i;
      conjugate[0] = from[0];
      conjugate[1] = -from[1];
      conjugate[2] = -from[2];
      conjugate[3] = -from[3];
      sf_product(conjugate, b + (size_t)4 * i, turn);
      angle = 2.0 * sf_atan2(sqrt(sf_dot3(turn + 1, turn + 1)), fabs(turn[0]));
    } else {
      angle = fabs(a[i] - b[i]);
    }
    if (!(angle <= most)) most = angle;
  }
  return most;
}

/* Whether rows clearly do not depend on each other, see redundancy.py: by bounds of the least and largest square.
 *
 * Of the rows by the unknowns it is given where columns begin, rows, and entries of the matrix.  products has room for
 * rows (rows + 1) numbers.
 */
int sf_independent(const sf_model *m, const int *column, const int *line, const int *entry, const double *entries,
                   double roughly, double usual, double *products) {
  double *g = products, *x = products + m->rows * m->rows, trace = 0.0, inverse = 0.0;
  int n = m->rows, i, j, k;
  for (i = 0; i < n * n; ++i) g[i] = 0.0;
  for (k = 0; k < m->unknowns; ++k)
    for (i = column[k]; i < column[k + 1]; ++i)
      for (j = column[k]; j <= i; ++j) {
        int a = line[i], b = line[j];
        g[a > b ? a * n + b : b * n + a] += entries[entry[i]] * entries[entry[j]];
      }
  for (i = 0; i < n; ++i) trace += g[i * n + i];
  /* With the Cholesky factor L the trace of the inverse is the sum of the squares of the inverse of L. */
  for (i = 0; i < n; ++i)
    for (j = 0; j <= i; ++j) {
      double sum = g[i * n + j];
      for (k = 0; k < j; ++k) sum -= g[i * n + k] * g[j * n + k];
      if (j == i && !(sum > 0.0)) return 0;
      g[i * n + j] = j < i ? sum / g[j * n + j] : sqrt(sum);
    }
  for (j = 0; j < n; ++j)
    for (i = j; i < n; ++i) {
      double sum = i == j ? 1.0 : 0.0;
      for (k = j; k < i; ++k) sum -= g[i * n + k] * x[k];
      x[i] = sum / g[i * n + i];
      inverse += x[i] * x[i];
    }
  return roughly * (trace > usual ? trace : usual) * inverse < 1.0;
}

/* The tangent of the curve at an equilibrium, with the factor last, signed as the one before; 1 where there is none.
 *
 * The point is the one evaluated last.  Doubtful says whether an eigenvalue may be near to zero.
 */
static int sf_tangent(const sf_model *m, sf_system *system, const sf_curve *curve, const sf_border *border,
                      const sf_limits *limits, const sf_state *s, const sf_point *p, const double *before,
                      double *tangent, int *doubtful, sf_along *along) {
  double *answer = along->both + m->total, length;
  int i, broken;
  sf_rate(m, border, border->factor, s, p, along->right, along->given, along->results);
  sf_regularise(m, p->entries, limits, along->matrix);
  for (i = 0; i < m->total; ++i) {
    along->right[i] = -along->right[i];
    along->right[m->total + i] = curve->probe[i];
  }
  /* What is found here does not depend on what was solved before, not even in its last digits. */
  system->pivoted->known = 0;
  broken = sf_solve(system, along->matrix, 2, along->right, along->both, along->solving);
  if (broken) return broken;
  if (!sf_all_finite(along->both, 2 * m->total)) return 1;
  *doubtful = sf_weighed(m->rotation_unknowns, limits->weight, answer, answer) > curve->doubt * curve->doubt;
  sf_copy(tangent, along->both, m->total);
  tangent[m->total] = 1.0;
  length = sqrt(sf_inner(m, curve, tangent, tangent));
  if (sf_inner(m, curve, tangent, before) < 0.0) length = -length;
  for (i = 0; i <= m->total; ++i) tangent[i] /= length;
  return 0;
}

/* Whether a point may be the first of the curve again. */
static int sf_may_close(const sf_model *m, const sf_curve *curve, const double *now, const double *there,
                        double before, double factor) {
  if (!(sf_apart(m, curve->first, there) < 1.2 * sf_apart(m, now, there))) return 0;
  return fabs(factor - curve->first_factor) <= 1.2 * fabs(factor - before) + 1e-9 * curve->unit;
}

/* Points of a curve beyond its last one, as many as there is room for.
 *
 * Returns 0 where the room is filled; 1 where the next step, of the length curve->length or less, is not plain; 2 where
 * factors have no room.  Each point that was found stays.
 */
int sf_trace(const sf_model *m, sf_system *system, sf_curve *curve, const sf_limits *limits, const sf_count_of *count,
             sf_point *point, double *memory, sf_report *report) {
  int size = sf_state_size(m), width = m->total + 1, i;
  sf_along along;
  sf_make_along(m, memory, &along);
  while (curve->points < curve->room) {
    int last = curve->points - 1, same;
    sf_told_of *now = curve->told + last, *next = now + 1;
    double *here = curve->state + (size_t)last * size, *tangent = curve->tangent + (size_t)last * width;
    double *beyond = tangent + width, turning = sf_largest(tangent, m->rotation_unknowns), length = curve->length;
    double along_factor = fabs(tangent[m->total]), change, cosine, growth;
    const double *bend = curve->before;
    sf_border border;
    sf_state start;
    if (!(curve->length > curve->shortest)) return 1;
    /* No node turns by more than a stride, nor does the factor change by more. */
    change = curve->longest / (turning > SF_TINY ? turning : SF_TINY);
    if (length > change) length = change;
    change = curve->stride / (along_factor > SF_TINY ? along_factor : SF_TINY);
    if (length > change) length = change;
    /* Along the tangent, with the curvature that the last two tangents give. */
    for (i = 0; i < width; ++i) {
      double step = length * tangent[i];
      if (bend) step += 0.5 * length * length * ((tangent[i] - bend[i]) / (now->arc - curve->arc_before));
      if (i < m->total)
        along.step[i] = step;
      else
        border.factor = now->factor + step;
    }
    sf_lay_out(m, here, &start);
    sf_move(m, &start, along.step, 1.0, &along.expected);
    sf_copy_state(m, &along.expected, &along.there);
    for (i = 0; i < m->total; ++i) along.row[i] = curve->metric[i] * tangent[i];
    border.begun = curve->begun;
    border.rate = curve->rate;
    border.row = along.row;
    border.unit = tangent[m->total] / (curve->unit * curve->unit);
    border.apart = curve->apart;
    border.passing = curve->passing;
    i = sf_correct(m, system, NULL, NULL, &border, limits, &along.there, point, along.following, report);
    if (i == 2) return 2;
    same = !i && report->good;
    if (same) {
      if (m->rows && !sf_independent(m, curve->column, curve->line, curve->entry, point->entries, curve->roughly,
                                     curve->usual, along.products))
        return 1;
      i = sf_tangent(m, system, curve, &border, limits, &along.there, point, tangent, beyond, &next->doubtful, &along);
      if (i) return i;
      cosine = sf_inner(m, curve, tangent, beyond);
      same = cosine >= curve->sharpest &&
             sf_apart(m, along.expected.q, along.there.q) <= curve->far * (length * turning) + curve->shortest;
    }
    if (!same) {
      curve->length = 0.5 * length;
      continue;
    }
    next->negative = sf_negative(m, system, point->entries, count, along.following);
    if (next->negative < 0 || next->negative != now->negative) return 1;
    if (tangent[m->total] * beyond[m->total] < 0.0) return 1;
    if (!(border.factor >= curve->low && border.factor <= curve->high)) return 1;
    if (curve->known + curve->points >= curve->loop &&
        sf_may_close(m, curve, here, along.there.q, now->factor, border.factor))
      return 1;
    sf_lay_out(m, here + size, &start);
    sf_copy_state(m, &along.there, &start);
    next->factor = border.factor;
    next->arc = now->arc + length;
    next->residual = report->residual;
    next->iterations = report->iterations;
    /* As much longer as the angle and the effort of this one allow. */
    growth = curve->turning / sf_acos(cosine < 1.0 ? cosine : 1.0);
    change = ldexp(curve->effort, -report->iterations);
    if (!(growth < change)) growth = change;
    curve->length = length * (growth < 0.3 ? 0.3 : growth > 2.0 ? 2.0 : growth);
    curve->before = tangent;
    curve->arc_before = now->arc;
    ++curve->points;
  }
  return 0;
}
