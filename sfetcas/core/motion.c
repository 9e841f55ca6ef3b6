/* Steps of a motion: the equations at the stages of a step, solved by Newton's method.
 *
 * A model of all stages is that of one with copies of everything, so that terms of several stages are evaluated at once.
 * Quantities that carry mass or are damped are positions, of places and of inner nodes of elements, and rows of groups
 * of terms, the observables; see sfetcas/dynamics/stages.py, where the same is written as expressions, and
 * sfetcas/dynamics/core_steps.py, which makes the tables.
 */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"

/* Where the parts of the memory of a step begin. */
typedef struct {
  sf_state state[2];
  double *moved, *rates, *accelerations, *forces, *tangents, *given, *residual, *matrix, *step, *solving;
  double *in, *slots;
} sf_stage_room;

static void sf_most(const sf_tape *tape, int *arguments, int *slots) {
  *arguments = sf_larger(*arguments, tape->arguments);
  *slots = sf_larger(*slots, tape->slots);
}

static int sf_make_stage_room(const sf_model *m, const sf_motion *o, double *memory, sf_stage_room *room) {
  int n = 0, i, x = o->stages * o->quantities, arguments = 0, slots = 0;
#define PART(place, count) \
  if (memory) place = memory + n; \
  n += (count)
  for (i = 0; i < 2; ++i) {
    PART(room->state[i].q, m->components * m->rotations);
    PART(room->state[i].y, m->displacements);
    PART(room->state[i].lam, m->rows);
    PART(room->state[i].unwrapped, 0);
  }
  PART(room->moved, x);
  PART(room->rates, x);
  PART(room->accelerations, x);
  PART(room->forces, x);
  PART(room->tangents, m->elements * m->points * m->axes);
  PART(room->given, m->given + o->further);
  PART(room->residual, m->total);
  PART(room->matrix, o->entry_count);
  PART(room->step, m->total);
  PART(room->solving, 4 * m->total);
  for (i = 0; i < o->groups; ++i) {
    sf_most(o->seen[i].tape, &arguments, &slots);
    sf_most(o->observables[i].group.tape, &arguments, &slots);
  }
  for (i = 1; i < m->groups; ++i)
    if (o->rows[i].terms) sf_most(o->rows[i].tape, &arguments, &slots);
  for (i = 0; i < o->sliding; ++i) sf_most(o->slide[i].tape, &arguments, &slots);
  if (m->elements) sf_most(o->turning->tape, &arguments, &slots);
  PART(room->in, 8 * arguments);
  PART(room->slots, 8 * slots);
#undef PART
  return n;
}

int sf_advance_size(const sf_model *m, const sf_motion *o) { return sf_make_stage_room(m, o, NULL, NULL); }

/* By how much turned tangents differ from those of the undeformed structure. */
static void sf_tangents(const sf_model *m, const sf_motion *o, const sf_state *s, const double *given, sf_point *p,
                        const sf_work *work, double *tangents) {
  const sf_group *turning = o->turning;
  int e, k, n = m->points * m->axes;
  if (!m->elements) return;
  sf_terms(m, turning, 0, s, given, p, work);
  for (e = 0; e < m->elements; ++e) {
    const double *tangent = turning->datum + (size_t)e * turning->data + o->tangent;
    for (k = 0; k < n; ++k) *tangents++ = p->result[turning->result + (size_t)e * n + k] - tangent[k];
  }
}

/* All quantities at all stages. */
static void sf_quantities(const sf_model *m, const sf_motion *o, const sf_state *s, const double *given, sf_point *p,
                          const sf_work *work, double *tangents, double *x) {
  int g, i, linear = o->stages * o->linear;
  sf_places(m, s, given, p);
  sf_tangents(m, o, s, given, p, work, tangents);
  sf_times(&o->by_place, p->place, x, 0);
  sf_times(&o->by_tangent, tangents, x, 1);
  x += linear;
  for (g = 0; g < o->groups; ++g) {
    const sf_group *group = o->seen + g;
    sf_terms(m, group, 0, s, given, p, work);
    for (i = 0; i < group->terms * group->tape->results; ++i) *x++ = p->result[group->result + i];
  }
}

/* Sums over stages of one row of numbers for each, at part k of the quantities: to_i += sum_j by_ij from_j. */
static void sf_by_stages(const sf_motion *o, int k, const double *by, const double *from, double *to) {
  int i, j, n, width = o->part[k + 1] - o->part[k];
  size_t begin = (size_t)o->stages * o->part[k];
  for (i = 0; i < o->stages; ++i)
    for (j = 0; j < o->stages; ++j)
      for (n = 0; n < width; ++n)
        to[begin + (size_t)i * width + n] += by[i * o->stages + j] * from[begin + (size_t)j * width + n];
}

/* The same of rates that are kept, times powers of the step: to_i += sum_k by_ik h^p_k rate_k, over a power of it. */
static void sf_by_rates(const sf_motion *o, int k, const double *by, const double *scale, const double *rate,
                        double *to) {
  int i, j, n, width = o->part[k + 1] - o->part[k];
  size_t begin = (size_t)o->stages * o->part[k];
  for (i = 0; i < o->stages; ++i)
    for (j = 0; j < o->kept; ++j) {
      double share = by[i * o->kept + j] * scale[j];
      if (share == 0.0) continue;
      for (n = 0; n < width; ++n)
        to[begin + (size_t)i * width + n] += share * rate[(size_t)j * o->quantities + o->part[k] + n];
    }
}

/* Rates and accelerations for what the quantities have moved by; scale: powers of the step by which rates are scaled. */
static void sf_rates(const sf_motion *o, const sf_advance_of *a, const double *scale, sf_stage_room *room) {
  int k, n, count = o->stages * o->quantities;
  for (n = 0; n < count; ++n) room->rates[n] = room->accelerations[n] = 0.0;
  for (k = 0; k <= o->groups; ++k) {
    sf_by_stages(o, k, o->velocity, room->moved, room->rates);
    sf_by_rates(o, k, o->velocity_kept, scale, a->rate, room->rates);
    sf_by_stages(o, k, o->acceleration, room->moved, room->accelerations);
    sf_by_rates(o, k, o->acceleration_kept, scale, a->rate, room->accelerations);
  }
  for (n = 0; n < count; ++n) {
    room->rates[n] /= a->h;
    room->accelerations[n] /= a->h * a->h;
  }
}

/* Inertia and damping forces. */
static void sf_inertia(const sf_motion *o, sf_stage_room *room) {
  int g, i, n = o->stages * o->linear;
  double *force = room->forces;
  sf_times(&o->mass, room->accelerations, force, 0);
  sf_times(&o->drag, room->rates, force, 1);
  for (g = 0; g < o->groups; ++g) {
    const sf_observables *seen = o->observables + g;
    int count = seen->group.terms * seen->group.rows;
    for (i = 0; i < count; ++i, ++n)
      force[n] = seen->mass[i] * room->accelerations[n] + seen->damping[i] * room->rates[n];
  }
  sf_times(&o->coriolis, room->rates, force, 1);
}

/* Velocities of the places that may slide, relative to what carries the obstacles, as loads of their terms. */
static void sf_slide(const sf_model *m, const sf_motion *o, const double *rates, double *given) {
  int g, t, k, axes = m->axes, places = m->places / o->stages;
  for (g = 0; g < o->sliding; ++g) {
    const sf_group *group = o->slide + g;
    for (t = 0; t < group->terms; ++t) {
      const int *place = group->place + (size_t)t * 2;
      const double *own = rates + (size_t)(place[0] / places) * o->linear + (place[0] % places) * axes;
      const double *carrier = rates + (size_t)(place[0] / places) * o->linear + (place[1] % places) * axes;
      for (k = 0; k < axes; ++k) given[group->load + t * axes + k] = own[k] - (place[1] < 0 ? 0.0 : carrier[k]);
    }
  }
}

/* What quantities moved by since the begin of the step. */
static void sf_moved_by(const sf_motion *o, const double *x, double *moved) {
  int k, i, n;
  for (k = 0; k <= o->groups; ++k) {
    int width = o->part[k + 1] - o->part[k];
    for (i = 0; i < o->stages; ++i)
      for (n = 0; n < width; ++n) *moved++ -= x[o->part[k] + n];
  }
}

/* A row acts by its multiplier where it does; its value is what it misses of what it holds. */
static void sf_switch(const sf_advance_of *a, int rows, double *value, int held) {
  int i;
  if (!a->acting) return;
  for (i = 0; i < rows; ++i) value[i] = (value[i] - (held ? a->held[i] : 0.0)) * a->acting[i];
}

/* One row of what a matrix, repeated along leading vectors, makes of a column of derivatives; zero behind these. */
static double sf_crossed(const sf_model *m, const double *cross, int vectors, const double *column, int row) {
  int k, axes = m->axes;
  double sum = 0.0;
  if (row >= vectors * axes) return 0.0;
  for (k = 0; k < axes; ++k) sum += cross[row % axes * axes + k] * column[row / axes * axes + k];
  return sum;
}

/* Matrix entries that observables have by the quantities of another stage: J_i^T (b m + c d) J_j, or by Coriolis forces
 * J_i^T c m (cross J_j). */
static double *sf_pairs(const sf_model *m, const sf_motion *o, const sf_point *p, int i, int j, double c, double b,
                        const double *cross, double *to) {
  int g, t, row, x, y;
  for (g = 0; g < o->groups; ++g) {
    const sf_observables *seen = o->observables + g;
    const sf_group *group = &seen->group;
    int results = group->tape->results, rows = group->rows, count = group->terms / o->stages;
    int width = (results - group->jacobian) / rows;
    for (t = 0; t < count; ++t) {
      const double *one = p->result + group->result + ((size_t)i * count + t) * results + group->jacobian;
      const double *other = p->result + group->result + ((size_t)j * count + t) * results + group->jacobian;
      const double *mass = seen->mass + (size_t)t * rows, *damping = seen->damping + (size_t)t * rows;
      for (y = 0; y < width; ++y)
        for (x = 0; x < width; ++x) {
          double sum = 0.0;
          for (row = 0; row < rows; ++row)
            sum += one[x * rows + row] *
                   (cross ? c * mass[row] * sf_crossed(m, cross, seen->vectors, other + y * rows, row)
                          : (b * mass[row] + c * damping[row]) * other[y * rows + row]);
          *to++ = sum;
        }
    }
  }
  return to;
}

/* Derivatives of the turned tangents of an element whose inner nodes have mass, at a stage. */
static const double *sf_of_element(const sf_model *m, const sf_motion *o, const sf_point *p, int stage, int e) {
  const sf_group *element = m->group;
  size_t number = (size_t)stage * (m->elements / o->stages) + o->inside[e];
  return p->result + element->result + number * element->tape->results + element->jacobian;
}

/* Those of inner nodes of elements, which hang on the first place of their element. */
static double *sf_hung(const sf_model *m, const sf_motion *o, const sf_point *p, int i, int j, double c, double b,
                       double *to) {
  const sf_group *element = m->group;
  int axes = m->axes, n = m->points, e, x, y, k, side;
  int width = o->massive ? (element->tape->results - element->jacobian) / axes : 0;
  for (e = 0; e < o->massive; ++e) {
    const double *one = sf_of_element(m, o, p, i, e), *other = sf_of_element(m, o, p, j, e);
    const double *mass = o->inner_mass + (size_t)e * n * n, *drag = o->inner_drag + (size_t)e * n * n;
    for (y = 0; y < width; ++y)
      for (x = 0; x < width; ++x) {
        int at = o->point_of[x] * n + o->point_of[y];
        double sum = 0.0;
        for (k = 0; k < axes; ++k) sum += one[x * axes + k] * other[y * axes + k];
        *to++ = sum * (b * mass[at] + c * drag[at]);
      }
  }
  for (side = 0; side < 2; ++side)
    for (e = 0; e < o->massive; ++e) {
      const double *its = sf_of_element(m, o, p, side ? j : i, e);
      const double *mass = o->first_mass + (size_t)e * n, *drag = o->first_drag + (size_t)e * n;
      for (x = 0; x < width; ++x)
        for (k = 0; k < axes; ++k)
          *to++ = its[x * axes + k] * (b * mass[o->point_of[x]] + c * drag[o->point_of[x]]);
    }
  return to;
}

/* Those of the forces of places of one stage that slide: the last results of their terms. */
static double *sf_by_velocity(const sf_model *m, const sf_group *group, int i, int stages, double c, const sf_point *p,
                              double *to) {
  int t, k, n = m->axes * m->axes, count = group->terms / stages, results = group->tape->results;
  for (t = i * count; t < (i + 1) * count; ++t)
    for (k = 0; k < n; ++k) *to++ = c * p->result[group->result + (size_t)(t + 1) * results - n + k];
  return to;
}

/* What Coriolis forces add to the entries that couple stages. */
static double *sf_turning(const sf_model *m, const sf_motion *o, const sf_point *p, int i, int j, double c,
                          double *to) {
  const sf_group *element = m->group;
  int t, e, x, y, k, side, row, axes = m->axes, n = m->points;
  int wide = o->massive ? (element->tape->results - element->jacobian) / axes : 0;
  to = sf_pairs(m, o, p, i, j, c, 0.0, o->cross, to);
  for (e = 0; e < o->massive; ++e) {
    const double *one = sf_of_element(m, o, p, i, e), *other = sf_of_element(m, o, p, j, e);
    for (y = 0; y < wide; ++y)
      for (x = 0; x < wide; ++x) {
        double sum = 0.0;
        for (k = 0; k < axes; ++k) sum += one[x * axes + k] * sf_crossed(m, o->cross, 1, other + y * axes, k);
        *to++ = sum * c * o->inner_mass[((size_t)e * n + o->point_of[x]) * n + o->point_of[y]];
      }
  }
  for (side = 0; side < 2; ++side)
    for (e = 0; e < o->massive; ++e) {
      const double *its = sf_of_element(m, o, p, side ? j : i, e);
      for (x = 0; x < wide; ++x)
        for (k = 0; k < axes; ++k) {
          double sum = 0.0;
          for (row = 0; row < axes; ++row)
            sum += o->cross[side ? k * axes + row : row * axes + k] * its[x * axes + row];
          *to++ = sum * c * o->first_mass[(size_t)e * n + o->point_of[x]];
        }
    }
  for (t = 0; t < o->weights; ++t)
    for (k = 0; k < axes * axes; ++k) *to++ = c * o->weight[t] * o->cross[k];
  return to;
}

/* Everything of which the matrix has sums, behind the results of the terms. */
static void sf_couple(const sf_model *m, const sf_motion *o, const sf_advance_of *a, const sf_point *p, double *to) {
  int i, j, k, s = o->stages;
  double inertia = o->acceleration[s * s - 1] / (a->h * a->h);
  for (i = 0; i < s; ++i)
    for (j = 0; j < s; ++j) {
      double c = o->velocity[i * s + j] / a->h, b = o->acceleration[i * s + j] / (a->h * a->h);
      to = sf_pairs(m, o, p, i, j, c, b, NULL, to);
      to = sf_hung(m, o, p, i, j, c, b, to);
      for (k = 0; k < o->masses; ++k) *to++ = b * o->place_mass[k];
      for (k = 0; k < o->drags; ++k) *to++ = c * o->place_drag[k];
      for (k = 0; k < o->sliding; ++k) to = sf_by_velocity(m, o->slide + k, i, s, c, p, to);
      if (o->cross) to = sf_turning(m, o, p, i, j, c, to);
    }
  /* Constraints that depend on each other do not make it singular; rows that do not act have a multiplier of zero. */
  for (i = 0; i < m->rows; ++i)
    *to++ = -o->dual / inertia - (a->acting ? (1.0 - a->acting[i]) / (o->dual * inertia) : 0.0);
}

/* The change of all unknowns; else as sf_solve. */
static int sf_change(const sf_model *m, const sf_motion *o, sf_system *system, const sf_advance_of *a,
                     const double *scale, sf_state *s, sf_point *p, const sf_work *work, sf_stage_room *room) {
  int g, i;
  sf_state seen = *s;
  sf_quantities(m, o, s, a->given, p, work, room->tangents, room->moved);
  sf_moved_by(o, a->x, room->moved);
  sf_rates(o, a, scale, room);
  sf_inertia(o, room);
  sf_copy(room->given, a->given, m->given);
  sf_slide(m, o, room->rates, room->given);
  sf_times(&o->onto_pull, room->forces, room->given + m->pull, 1);
  sf_times(&o->onto_places, room->forces, room->given + m->beside + m->rotation_unknowns, 1);
  if (a->acting) {
    sf_copy(room->step, s->lam, m->rows);
    seen.lam = room->step;
    sf_switch(a, m->rows, seen.lam, 0);
  }
  sf_evaluate(m, &seen, room->given, p);
  sf_residual(m, &seen, room->given, p, work);
  for (g = 0; g < o->sliding; ++g) sf_terms(m, o->slide + g, 0, &seen, room->given, p, work);
  seen.lam = room->forces + (size_t)o->stages * o->linear;
  for (g = 0; g < o->groups; ++g) sf_terms(m, &o->observables[g].group, 0, &seen, a->given, p, work);
  sf_sum(&o->shares, p->result, room->residual);
  for (i = 0; i < m->total; ++i) room->residual[i] += p->residual[i];
  sf_switch(a, m->rows, room->residual + m->unknowns, 1);
  for (i = 0; i < m->total; ++i) room->residual[i] = -room->residual[i];
  sf_couple(m, o, a, p, p->result + o->couples);
  sf_sum(&o->entries, p->result, room->matrix);
  return sf_solve(system, room->matrix, 1, room->residual, room->step, room->solving);
}

/* The largest rotation or displacement of a change; nan if one is. */
static double sf_size_of(const sf_model *m, const double *step) {
  double most = sf_largest(step + m->rotation_unknowns, m->displacements);
  int i;
  if (most != most) return most;
  for (i = 0; i < m->turning * m->rotations; ++i)
    if (m->unknown[i] >= 0) {
      double by = fabs(step[m->unknown[i]] * m->share[i]);
      if (by != by) return by;
      if (by > most) most = by;
    }
  return most;
}

/* Polynomials of Lagrange through the begin of a step and its stages, at places beyond its end: what was gained since
 * the begin goes on to what will be gained since the end. */
static void sf_onward(const sf_motion *o, double ratio, double *to) {
  int i, j, k, s = o->stages;
  for (i = 0; i < s; ++i)
    for (j = 0; j < s; ++j) {
      double at = 1.0 + ratio * o->at[i], value = at / o->at[j];
      for (k = 0; k < s; ++k)
        if (k != j) value *= (at - o->at[k]) / (o->at[j] - o->at[k]);
      to[i * s + j] = value - (j == s - 1 ? 1.0 : 0.0);
    }
}

/* The state from which a step begins to be sought: those so far go on as in the step before. */
static void sf_guess(const sf_model *m, const sf_motion *o, const sf_advance_of *a, sf_state *s) {
  double onward[SF_STAGES * SF_STAGES];
  int i, j, k, n = o->stages, rotations = m->rotations / n, y = m->displacements / n;
  sf_onward(o, a->ratio, onward);
  for (i = 0; i < n; ++i) {
    for (k = 0; k < rotations; ++k) {
      const double *from = a->q + (size_t)m->components * k;
      double turn[3] = {0.0, 0.0, 0.0}, by[4], *to = s->q + (size_t)m->components * (i * rotations + k), size;
      int l;
      for (j = 0; j < n; ++j)
        for (l = 0; l < m->turning; ++l)
          turn[l] += onward[i * n + j] * a->turn[((size_t)j * rotations + k) * m->turning + l];
      if (!m->space) {
        *to = *from + turn[0];
        continue;
      }
      sf_turned(turn, by);
      sf_product(by, from, to);
      size = sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2] + to[3] * to[3]);
      for (l = 0; l < 4; ++l) to[l] /= size;
    }
    for (k = 0; k < y; ++k) {
      double sum = 0.0;
      for (j = 0; j < n; ++j) sum += onward[i * n + j] * a->shift[(size_t)j * y + k];
      s->y[(size_t)i * y + k] = a->y[k] + sum;
    }
  }
  sf_copy(s->lam, a->lam, m->rows);
  sf_prescribe(m, o->driven, o->drive, a->vector, s);
}

/* The rotation vector between unit quaternions, of at most half a turn. */
static void sf_between(const double *from, const double *to, double *vector) {
  double conjugate[4], r[4], sine, share;
  int k;
  conjugate[0] = from[0];
  for (k = 1; k < 4; ++k) conjugate[k] = -from[k];
  sf_product(to, conjugate, r);
  if (r[0] < 0.0)
    for (k = 0; k < 4; ++k) r[k] = -r[k];
  sine = sqrt(sf_dot3(r + 1, r + 1));
  share = sine < 1e-6 ? 2.0 : 2.0 * sf_atan2(sine, r[0]) / sine;
  for (k = 0; k < 3; ++k) vector[k] = share * r[k + 1];
}

/* Largest gap of the constraints at the last stage. */
static double sf_gap(const sf_model *m, const sf_motion *o, const sf_advance_of *a, const sf_state *s, sf_point *p,
                     const sf_work *work, sf_stage_room *room) {
  double *rows = room->residual, most = 0.0;
  int g, i, k, n = o->stages, e, others = (m->rows - m->closings) / n, closings = m->closings / n;
  if (!m->rows) return 0.0;
  for (i = 0; i < m->segments * m->axes; ++i) work->chord[i] = 0.0;
  for (e = 0; e < m->elements; ++e)
    for (k = 0; k < m->points; ++k)
      for (i = 0; i < m->axes; ++i)
        work->chord[m->owner[e] * m->axes + i] += room->tangents[((size_t)e * m->points + k) * m->axes + i];
  sf_times(&m->Z, work->chord, rows, 0);
  sf_times(&m->W, s->y, rows, 1);
  for (i = 0; i < m->closings; ++i) rows[i] += a->given[m->opening + i];
  for (i = m->closings; i < m->rows; ++i) rows[i] = 0.0;
  for (g = 1; g < m->groups; ++g) {
    const sf_group *group = o->rows + g, *own = m->group + g;
    if (!group->terms) continue;
    sf_terms(m, group, 0, s, a->given, p, work);
    for (i = 0; i < own->terms; ++i)
      for (k = 0; k < own->rows; ++k)
        rows[own->row[i * own->rows + k]] += p->result[group->result + (size_t)i * own->rows + k];
  }
  sf_switch(a, m->rows, rows, 1);
  for (i = 0; i < closings; ++i) {
    double size = fabs(rows[(n - 1) * closings + i]);
    if (!(size <= most)) most = size;
  }
  for (i = 0; i < others; ++i) {
    double size = fabs(rows[m->closings + (n - 1) * others + i]);
    if (!(size <= most)) most = size;
  }
  return most;
}

static void sf_told(const sf_model *m, const sf_motion *o, const double *scale, const sf_state *s, sf_advance_of *a,
                    sf_stage_room *room) {
  int i, j, k, l, n, stages = o->stages, rotations = m->rotations / stages, y = m->displacements / stages;
  for (i = 0; i < stages; ++i) {
    for (k = 0; k < rotations; ++k) {
      const double *from = a->q + (size_t)m->components * k;
      const double *to = s->q + (size_t)m->components * (i * rotations + k);
      double *turn = a->turns + ((size_t)i * rotations + k) * m->turning;
      if (m->space)
        sf_between(from, to, turn);
      else
        *turn = *to - *from;
    }
    for (k = 0; k < y; ++k) a->shifts[(size_t)i * y + k] = s->y[(size_t)i * y + k] - a->y[k];
  }
  sf_copy(a->last_q, s->q + (size_t)m->components * (stages - 1) * rotations, m->components * rotations);
  sf_copy(a->last_y, s->y + (size_t)(stages - 1) * y, y);
  sf_copy(a->rows, s->lam, m->rows);
  for (k = 0; k <= o->groups; ++k) {
    int width = o->part[k + 1] - o->part[k];
    const double *moved = room->moved + (size_t)stages * o->part[k];
    for (n = 0; n < width; ++n) {
      int at = o->part[k] + n;
      for (i = 0; i < stages; ++i) a->there[(size_t)i * o->quantities + at] = a->x[at] + moved[(size_t)i * width + n];
      for (l = 0; l < o->kept; ++l) {
        double sum = 0.0;
        for (j = 0; j < stages; ++j) sum += o->after[l * stages + j] * moved[(size_t)j * width + n];
        for (j = 0; j < o->kept; ++j)
          sum += o->after_kept[l * o->kept + j] * scale[j] * a->rate[(size_t)j * o->quantities + at];
        a->rates[(size_t)l * o->quantities + at] = sum / scale[l];
      }
    }
  }
}

/* One step; 1 where a matrix is singular, 2 where factors have no room.
 *
 * It has converged where a->size is at most that of the last change, see sfetcas/dynamics/steps.py.
 */
int sf_advance(const sf_model *m, const sf_motion *o, sf_system *system, sf_advance_of *a, sf_point *p,
               double *memory) {
  sf_stage_room room;
  sf_work work;
  double scale[SF_KEPT];
  int here = 0, k, broken;
  /* Compilers do not see that all of it is set. */
  memset(&room, 0, sizeof room);
  memset(&work, 0, sizeof work);
  sf_make_stage_room(m, o, memory, &room);
  sf_divide(m, p->work, &work);
  work.in = room.in;
  work.slots = room.slots;
  for (k = 0; k < o->kept; ++k) scale[k] = o->power[k] == 1 ? a->h : a->h * a->h;
  for (k = 0; k < 2; ++k) room.state[k].unwrapped = a->unwrapped;
  a->iterations = 0;
  a->size = NAN;
  sf_guess(m, o, a, &room.state[0]);
  do {
    /* Within a step matrices differ little. */
    if (system->pivoted->known) system->pivoted->known = a->iterations ? 2 : 1;
    broken = sf_change(m, o, system, a, scale, &room.state[here], p, &work, &room);
    if (broken) return broken;
    sf_move(m, &room.state[here], room.step, 1.0, &room.state[1 - here]);
    here = 1 - here;
    a->size = sf_size_of(m, room.step);
    ++a->iterations;
  } while (a->iterations < o->iterations && a->size > o->last_change && a->size < o->lost);
  sf_quantities(m, o, &room.state[here], a->given, p, &work, room.tangents, room.moved);
  sf_moved_by(o, a->x, room.moved);
  a->gap = sf_gap(m, o, a, &room.state[here], p, &work, &room);
  sf_told(m, o, scale, &room.state[here], a, &room);
  return 0;
}

/* ---- steps of flat states --------------------------------------------------------------------------- */

int sf_take_step_size(const sf_model *m, const sf_motion *o, const sf_flat *f) {
  return sf_advance_size(m, o) + m->given + 3 * o->driven + 2 * m->rows + f->counts + o->stages * o->quantities;
}

/* The state after a step from a state, both of what a step takes from the one before: rotations, displacements,
 * multipliers, what rotations and displacements gained in its stages, quantities, their rates, angles, and its length,
 * 0 for a restart.  inputs (stages, f->inputs); else as sf_advance.
 */
int sf_take_step(const sf_model *m, const sf_motion *o, const sf_flat *f, sf_system *system, double h,
                 const double *inputs, const double *state, double *after, sf_point *p, double *memory,
                 sf_advance_of *a) {
  int n = o->stages, i, k, g, broken;
  int rotations = m->rotations / n, y = m->displacements / n, rows = m->rows / n, given = m->given / n;
  int turned = 3 * o->driven / n, quantities = o->quantities;
  double *all = memory, *vector = all + m->given, *begun = vector + 3 * o->driven, *found = begun + m->rows;
  double *near = found + m->rows, *there = near + f->counts, *own = after;
  const double *lam, *angle;
#define PART(from, count) \
  a->from = state; \
  state += (count)
  PART(q, m->components * rotations);
  PART(y, y);
  lam = state;
  state += rows;
  PART(turn, m->turning * m->rotations);
  PART(shift, m->displacements);
  PART(x, quantities);
  PART(rate, o->kept * quantities);
#undef PART
  angle = state;
  for (i = 0; i < n; ++i) {
    for (g = 0; g < f->groups; ++g) {
      sf_copy(f->datum[g] + (size_t)i * f->count[g], inputs, f->count[g]);
      inputs += f->count[g];
    }
    for (k = 0; k < given; ++k) all[f->given[i * given + k]] = inputs[k];
    inputs += given;
    sf_copy(vector + i * turned, inputs, turned);
    inputs += turned + f->angles;
    for (k = 0; k < rows; ++k) begun[f->row[i * rows + k]] = lam[k];
  }
  for (k = 0; k < f->counts; ++k) near[k] = angle[f->angle[k]];
  a->h = h;
  a->ratio = angle[f->angles] > 0.0 ? h / angle[f->angles] : 0.0;
  a->given = all;
  a->vector = vector;
  a->lam = begun;
  a->unwrapped = near;
  a->acting = a->held = NULL;
  a->last_q = own;
  a->last_y = own += m->components * rotations;
  lam = own += y;
  a->turns = own += rows;
  a->shifts = own += m->turning * m->rotations;
  own += m->displacements;
  a->rates = own + quantities;
  a->rows = found;
  a->there = there;
  /* A step hangs on its state alone, not on which matrix was solved last. */
  system->pivoted->known = 0;
  if (f->pivots) sf_take_pivots(system->pivoted, f->pivots);
  broken = sf_advance(m, o, system, a, p, there + n * quantities);
  if (broken) return broken;
  sf_copy(own, there + (size_t)(n - 1) * quantities, quantities);
  own = a->rates + (size_t)o->kept * quantities;
  for (k = 0; k < rows; ++k) after[lam - after + k] = found[f->row[(n - 1) * rows + k]];
  for (k = 0; k < f->angles; ++k) *own++ = sf_counted(m, k, after, angle[k]);
  *own = h;
  return 0;
}
