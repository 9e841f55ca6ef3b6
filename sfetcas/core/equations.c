/* The stationarity equations of a model and their Newton matrix; sfetcas/mechanics/equations.py explains them. */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"

static void sf_times(const sf_map *map, const double *x, double *y, int add) {
  int i, k;
  for (i = 0; i < map->rows; ++i) {
    double sum = 0.0;
    for (k = map->start[i]; k < map->start[i + 1]; ++k) sum += map->value[k] * x[map->column[k]];
    y[i] = add ? y[i] + sum : sum;
  }
}

static void sf_sum(const sf_sums *sums, const double *x, double *y) {
  int i, k;
  for (i = 0; i < sums->count; ++i) {
    double sum = 0.0;
    for (k = sums->start[i]; k < sums->start[i + 1]; ++k) sum += sums->weight[k] * x[sums->from[k]];
    y[i] = sum;
  }
}

static int sf_larger(int a, int b) { return a > b ? a : b; }

/* Where the parts of the memory of a point begin. */
typedef struct {
  double *constant, *chord, *size, *sum, *force, *in, *slots;
} sf_work;

static int sf_divide(const sf_model *m, double *memory, sf_work *work) {
  int n = 0, arguments = 0, slots = 0, g;
  for (g = 0; g < m->groups; ++g) {
    arguments = sf_larger(arguments, m->group[g].tape->arguments);
    slots = sf_larger(slots, m->group[g].tape->slots);
  }
#define PART(name, count) \
  if (memory) work->name = memory + n; \
  n += (count)
  PART(constant, m->segments * m->axes);
  PART(chord, m->segments * m->axes);
  PART(size, sf_larger(m->elements, m->closings));
  PART(sum, m->displacements);
  PART(force, m->places * m->axes);
  PART(in, 8 * arguments);
  PART(slots, 8 * slots);
#undef PART
  return n;
}

int sf_work_size(const sf_model *m) { return sf_divide(m, NULL, NULL); }

#include "terms.h"

/* Displacements of retained places. */
static void sf_places(const sf_model *m, const sf_state *s, const double *given, sf_point *p) {
  int k;
  sf_times(&m->Y, s->y, p->place, 0);
  for (k = 0; k < m->places * m->axes; ++k) p->place[k] += given[m->shift + k];
}

/* Displacements of retained places, whole pulls of elements, and the results of all terms. */
int sf_evaluate(const sf_model *m, const sf_state *s, const double *given, sf_point *p) {
  sf_work work;
  int e, k, a, g, axes = m->axes;
  sf_divide(m, p->work, &work);
  sf_places(m, s, given, p);
  sf_times(&m->ZT, s->lam, work.constant, 0);
  for (e = 0; e < m->elements; ++e) {
    const double *constant = work.constant + (size_t)m->owner[e] * axes;
    for (k = 0; k < m->points; ++k)
      for (a = 0; a < axes; ++a) {
        size_t at = ((size_t)e * m->points + k) * axes + a;
        p->pull[at] = given[m->pull + at] + constant[a];
      }
  }
  for (g = 0; g < m->groups; ++g) sf_terms(m, m->group + g, g == 0, s, given, p, &work);
  p->result[m->results - 1] = 1.0;
  return 0;
}

/* The changes of the chords of the segments. */
static void sf_chords(const sf_model *m, const double *result, double *chord) {
  const sf_group *group = m->group;
  int e, a;
  for (e = 0; e < m->segments * m->axes; ++e) chord[e] = 0.0;
  for (e = 0; e < m->elements; ++e)
    for (a = 0; a < m->axes; ++a)
      chord[m->owner[e] * m->axes + a] += result[group->result + (size_t)e * group->tape->results + group->rests + a];
}

static void sf_residual(const sf_model *m, const sf_state *s, const double *given, sf_point *p, const sf_work *work) {
  int i, k, g, first = m->rotation_unknowns;
  sf_sum(&m->sides, p->result, p->residual);
  for (i = 0; i < m->total; ++i) p->residual[i] += given[m->beside + i];
  sf_times(&m->WT, s->lam, p->residual + first, 1);
  if (!m->rows) return;
  sf_chords(m, p->result, work->chord);
  sf_times(&m->Z, work->chord, p->residual + m->unknowns, 0);
  sf_times(&m->W, s->y, p->residual + m->unknowns, 1);
  for (i = 0; i < m->closings; ++i) p->residual[m->unknowns + i] += given[m->opening + i];
  for (i = m->unknowns + m->closings; i < m->total; ++i) p->residual[i] = 0.0;
  for (g = 1; g < m->groups; ++g) {
    const sf_group *group = m->group + g;
    for (i = 0; i < group->terms; ++i)
      /* Several terms may share a row. */
      for (k = 0; k < group->rows; ++k)
        p->residual[m->unknowns + group->row[i * group->rows + k]] +=
            p->result[group->result + (size_t)i * group->tape->results + group->rests + k];
  }
}

/* What rounding of the residuals is judged by. */
static void sf_scale(const sf_model *m, const sf_state *s, const double *given, sf_point *p, const sf_work *work) {
  double *carried = work->size, *sums = work->sum, *forces = work->force, largest = 0.0;
  int e, k, a, i, first = m->rotation_unknowns, axes = m->axes;
  for (e = 0; e < m->elements; ++e) {
    double sum = 0.0;
    for (k = 0; k < m->points; ++k) {
      double size = 0.0;
      for (a = 0; a < axes; ++a) size += fabs(p->pull[((size_t)e * m->points + k) * axes + a]);
      sum += size * m->weight[e * m->points + k];
    }
    carried[e] = sum;
  }
  for (i = 0; i < m->total; ++i) {
    double sum = 0.0;
    for (k = m->sizes.start[i]; k < m->sizes.start[i + 1]; ++k) {
      double size = fabs(p->result[m->sizes.from[k]]);
      if (m->side_of[k] >= 0) size += carried[m->side_of[k]];
      sum += fabs(m->sizes.weight[k]) * size;
    }
    p->scale[i] = sum + m->noise[i];
  }
  if (m->displacements) {
    for (i = 0; i < m->closings; ++i) carried[i] = fabs(s->lam[i]);
    sf_times(&m->WTa, carried, sums, 0);
    for (i = 0; i < m->places * axes; ++i) forces[i] = fabs(given[m->force + i]);
    sf_times(&m->YTa, forces, sums, 1);
    for (i = 0; i < m->displacements; ++i)
      if (sums[i] > largest) largest = sums[i];
    for (i = 0; i < m->displacements; ++i) p->scale[first + i] += sums[i] + m->unloaded * largest + 1e-12;
  }
  for (i = 0; i < m->retained; ++i) {
    const int *retain = m->retain + (size_t)i * axes;
    double most = 0.0;
    for (a = 0; a < axes; ++a)
      if (p->scale[retain[a]] > most) most = p->scale[retain[a]];
    for (a = 0; a < axes; ++a) p->scale[retain[a]] = most;
  }
  for (i = 0; i < m->sliding; ++i) {
    const int *slide = m->slide + (size_t)i * (1 + axes);
    double square = 0.0, size;
    for (a = 0; a < axes; ++a) square += s->lam[slide[1 + a]] * s->lam[slide[1 + a]];
    size = sqrt(square);
    if (size > p->scale[slide[0]]) p->scale[slide[0]] = size;
  }
}

/* The equations at a state: energies, residual, its scale, and the entries of the matrix. */
int sf_at(const sf_model *m, const sf_state *s, const double *given, sf_point *p) {
  sf_work work;
  int g, i;
  sf_divide(m, p->work, &work);
  sf_evaluate(m, s, given, p);
  p->potential = p->stored = 0.0;
  for (g = 0; g < m->groups; ++g) {
    const sf_group *group = m->group + g;
    double potential = 0.0, stored = 0.0;
    for (i = 0; i < group->terms; ++i) {
      const double *result = p->result + group->result + (size_t)i * group->tape->results;
      potential += result[0];
      stored += result[1];
    }
    p->potential += potential;
    p->stored += stored;
  }
  for (i = 0; i < m->places * m->axes; ++i) p->potential -= given[m->force + i] * p->place[i];
  sf_residual(m, s, given, p, &work);
  sf_scale(m, s, given, p, &work);
  sf_sum(&m->entries, p->result, p->entries);
  return 0;
}

/* The derivative of the residual along a rate of loads on nodes and of prescribed displacements, in which it is linear.
 *
 * results (results,) is memory.  The point is that of the state.
 */
int sf_slope(const sf_model *m, const sf_state *s, const double *rate, const sf_point *p, double *slope,
             double *results) {
  sf_work work;
  sf_point there = *p;
  int g, i, e, k, a;
  sf_divide(m, p->work, &work);
  for (i = 0; i < m->results; ++i) results[i] = 0.0;
  there.result = results;
  for (g = 1; g < m->groups; ++g)
    if (m->group[g].proportional && m->group[g].loads) sf_terms(m, m->group + g, 0, s, rate, &there, &work);
  /* Forces at places pull at all segments that lead there. */
  for (e = 0; e < m->elements; ++e) {
    const sf_group *group = m->group;
    size_t at = group->result + (size_t)e * group->tape->results;
    const double *jacobian = p->result + at + group->jacobian, *pull = rate + m->pull + (size_t)e * m->points * m->axes;
    int sides = group->tape->results - group->jacobian;
    for (k = 0; k < sides / m->axes; ++k) {
      double sum = 0.0;
      for (a = 0; a < m->axes; ++a) sum += jacobian[k * m->axes + a] * pull[a];
      results[at + group->gradient + k] = sum;
    }
  }
  sf_sum(&m->sides, results, slope);
  for (i = 0; i < m->total; ++i) slope[i] += rate[m->beside + i];
  for (i = 0; i < m->closings; ++i) slope[m->unknowns + i] += rate[m->opening + i];
  return 0;
}

/* Largest residual over its scale; nan if one is. */
double sf_relative(const sf_model *m, const sf_point *p, double least) {
  double most = 0.0;
  int i;
  for (i = 0; i < m->total; ++i) {
    double share = fabs(p->residual[i]) / (p->scale[i] > least ? p->scale[i] : least);
    if (share != share) return share;
    if (share > most) most = share;
  }
  return most;
}
