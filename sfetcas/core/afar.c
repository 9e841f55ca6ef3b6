/* The globalised Newton method: equilibria from the undeformed state, without a start near to them.
 *
 * The same decisions as sfetcas/solvers/globalised.py, where they are explained.
 */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"

#define SF_FIRMEST 1e12
#define SF_BROKEN (-1000000)

/* A state with the equations there. */
typedef struct {
  sf_state state;
  sf_point point;
  double size, gaps;
} sf_here;

/* What a call works on. */
typedef struct {
  const sf_model *m;
  sf_system *system;
  const sf_rules *rules;
  const double *given;
  sf_here *here, *there, both[2];
  double *target, *matrix, *positive, *step, *x, *y, *rest, *b, *solving, *in;
  int left, room;
} sf_run_of;

static int sf_make_run(const sf_model *m, const sf_rules *rules, double *memory, sf_run_of *run) {
  int n = 0, i;
#define PART(part, count) \
  if (memory) part = memory + n; \
  n += (count)
  for (i = 0; i < 2; ++i) {
    if (memory) sf_lay_out(m, memory + n, &run->both[i].state);
    n += sf_state_size(m);
    PART(run->both[i].point.residual, m->total);
    PART(run->both[i].point.scale, m->total);
    PART(run->both[i].point.entries, m->entry_count);
  }
  PART(run->target, m->entry_count);
  PART(run->matrix, m->entry_count);
  PART(run->positive, m->entry_count);
  PART(run->step, m->total);
  PART(run->x, m->total);
  PART(run->y, m->total);
  PART(run->rest, m->total);
  PART(run->b, m->total);
  PART(run->solving, m->total);
  PART(run->in, 8 * (rules->convex ? rules->convex->results : 0));
#undef PART
  return n;
}

int sf_seek_size(const sf_model *m, const sf_rules *rules) {
  sf_run_of none;
  return sf_make_run(m, rules, NULL, &none);
}

static int sf_is_finite(double x) { return x - x == 0.0; }

static void sf_look(sf_run_of *run, sf_here *here) {
  const sf_model *m = run->m;
  double gaps = 0.0;
  int i;
  sf_at(m, &here->state, run->given, &here->point);
  for (i = m->unknowns; i < m->total; ++i) gaps += fabs(here->point.residual[i]);
  here->gaps = gaps;
  here->size = sf_relative(m, &here->point, run->rules->least);
}

static void sf_swap(sf_run_of *run) {
  sf_here *here = run->here;
  run->here = run->there;
  run->there = here;
}

static double sf_length(const sf_run_of *run, const double *step) { return sf_largest(step, run->m->rotation_unknowns); }

/* Factors of a matrix made firmer; the number of its negative pivots, less that of rows and of places that slide. */
static int sf_firm(sf_run_of *run, const double *entries, double firm) {
  const sf_model *m = run->m;
  const sf_rules *rules = run->rules;
  double soft = rules->soft;
  int i, negative = 0;
  sf_copy(run->target, entries, m->entry_count);
  for (i = 0; i < m->total; ++i) run->target[m->diagonal[i]] += (rules->proximal + firm) * rules->mass[i];
  if (rules->symmetric && m->total) {
    sf_copy(run->matrix, run->target, m->entry_count);
    for (i = 0; i < m->total; ++i) run->matrix[m->diagonal[i]] += soft * rules->sides[i];
    if (sf_factorise(run->system->factors, run->matrix, &negative)) return SF_BROKEN;
    if (!rules->pivoted) return negative - m->rows - rules->sliding;
    soft = rules->hard;
  }
  sf_copy(run->matrix, run->target, m->entry_count);
  for (i = 0; i < m->total; ++i) run->matrix[m->diagonal[i]] += soft * rules->sides[i];
  i = sf_pivot(run->system->pivoted, run->matrix);
  if (i == 2) run->room = 1;
  if (i) return SF_BROKEN;
  return rules->symmetric && m->total ? negative - m->rows - rules->sliding : 0;
}

static void sf_back(sf_run_of *run, double *x) {
  if (!run->m->total) return;
  if (run->rules->pivoted)
    sf_pivoted_backward(run->system->pivoted, x, run->solving);
  else
    sf_backward(run->system->factors, 1, x, run->solving);
}

/* Solution for the matrix factorised last, into run->step, the softness taken back; 0 where that fails. */
static int sf_solved_for(sf_run_of *run, const double *b) {
  const sf_model *m = run->m;
  double largest = sf_largest(b, m->total), last = HUGE_VAL;
  int i, round, found = 0;
  for (i = 0; i < m->total; ++i) run->x[i] = 0.0;
  sf_copy(run->rest, b, m->total);
  for (round = 0; round < run->rules->rounds; ++round) {
    double size;
    int gained;
    sf_copy(run->y, run->rest, m->total);
    sf_back(run, run->y);
    for (i = 0; i < m->total; ++i) run->x[i] += run->y[i];
    sf_left(run->system->factors, run->target, b, run->x, run->rest);
    size = sf_largest(run->rest, m->total);
    if (!(size < last)) break;
    sf_copy(run->step, run->x, m->total);
    found = 1;
    gained = last > 4.0 * size;
    last = size;
    if (size <= 1e-16 * largest || !gained) break;
  }
  return found && last <= run->rules->left * largest;
}

static int sf_against(sf_run_of *run) {
  int i;
  for (i = 0; i < run->m->total; ++i) run->b[i] = -run->here->point.residual[i];
  return sf_solved_for(run, run->b);
}

static int sf_newton(sf_run_of *run, int *negative) {
  *negative = sf_firm(run, run->here->point.entries, 0.0);
  return *negative != SF_BROKEN && sf_against(run);
}

/* Entries of the matrix with positive matrices of the elements. */
static void sf_convex(sf_run_of *run) {
  const sf_model *m = run->m;
  const sf_group *group = m->group;
  const sf_tape *tape = run->rules->convex;
  sf_point *p = &run->here->point;
  sf_work work;
  int first, lanes, l, k;
  sf_divide(m, p->work, &work);
  sf_evaluate(m, &run->here->state, run->given, p);
  for (first = 0; tape && first < group->terms; first += lanes) {
    int left = group->terms - first;
    lanes = sf_lanes(left);
    left = left < lanes ? left : lanes;
    for (l = 0; l < lanes; ++l)
      sf_gather(m, group, 1, first + (l < left ? l : left - 1), &run->here->state, run->given, p, &work, work.in + l,
                lanes);
    sf_lanes_run(lanes, tape, work.in, run->in, left, run->rules->slots);
    for (l = 0; l < left; ++l)
      for (k = 0; k < tape->results; ++k)
        p->result[group->result + (size_t)(first + l) * group->tape->results + run->rules->stiffness + k] =
            run->in[(size_t)l * tape->results + k];
  }
  sf_sum(&m->entries, p->result, run->positive);
}

/* A step downhill by a positive matrix, as firm as it takes. */
static int sf_downwards(sf_run_of *run) {
  double firm = 0.0;
  sf_convex(run);
  while (firm < SF_FIRMEST && !run->room) {
    if (sf_firm(run, run->positive, firm) == 0 && sf_against(run)) return 1;
    firm = run->rules->firmer * firm > run->rules->firm ? run->rules->firmer * firm : run->rules->firm;
  }
  return 0;
}

/* Where a step leads, shortened until potential and gaps fall; 0 where they never do. */
static int sf_shortened(sf_run_of *run, double *scale) {
  const sf_model *m = run->m;
  const sf_rules *rules = run->rules;
  const double *lam = run->here->state.lam, *residual = run->here->point.residual;
  double penalty = 0.0, slope = 0.0, before, by_rows = 0.0;
  int i, halving;
  for (i = m->unknowns; i < m->total; ++i) {
    double a = fabs(lam[i - m->unknowns] + run->step[i]);
    if (a > penalty) penalty = a;
    by_rows += lam[i - m->unknowns] * residual[i];
  }
  penalty *= 2.0;
  for (i = 0; i < m->unknowns; ++i) slope += residual[i] * run->step[i];
  slope += by_rows;
  slope -= penalty * run->here->gaps;
  if (slope > 0.0) slope = 0.0;
  before = run->here->point.potential + penalty * run->here->gaps;
  for (halving = 0; halving < rules->halvings; ++halving) {
    double wanted;
    sf_move(m, &run->here->state, run->step, *scale, &run->there->state);
    sf_look(run, run->there);
    wanted = rules->armijo * (*scale - 0.5 * (*scale * *scale)) * slope;
    if (run->there->point.potential + penalty * run->there->gaps - before <= wanted + rules->noise * fabs(before)) {
      sf_swap(run);
      return 1;
    }
    *scale *= 0.5;
  }
  return 0;
}

static int sf_descended(sf_run_of *run, int *negative) {
  const sf_rules *rules = run->rules;
  double scale = 1.0;
  int first = 1;
  sf_look(run, run->here);
  while (run->left && !run->room) {
    double length, most;
    int found;
    --run->left;
    if (!sf_is_finite(run->here->size)) return SF_NOT_FINITE;
    found = sf_newton(run, negative);
    if (!first && run->here->size <= rules->rounding) return SF_SOLVED;
    first = 0;
    if (found && sf_length(run, run->step) < rules->near) {
      /* Near an equilibrium, stable or not, Newton's own step leads to it. */
      sf_move(run->m, &run->here->state, run->step, 1.0, &run->there->state);
      sf_look(run, run->there);
      if (run->here->size <= rules->converged && !(run->there->size <= rules->gain * run->here->size)) {
        if (run->there->size < run->here->size) sf_swap(run);
        *negative = sf_firm(run, run->here->point.entries, 0.0);
        return SF_SOLVED;
      }
      if (run->there->size < run->here->size || *negative == 0) {
        sf_swap(run);
        continue;
      }
    }
    if (!found || *negative != 0) found = sf_downwards(run);
    length = found ? sf_length(run, run->step) : HUGE_VAL;
    if (!sf_is_finite(length)) return SF_STALLED;
    most = rules->free ? rules->turn : HUGE_VAL;
    most /= length > SF_TINY ? length : SF_TINY;
    scale = 4.0 * scale < 1.0 ? 4.0 * scale : 1.0;
    if (most < scale) scale = most;
    if (!sf_shortened(run, &scale)) return SF_STALLED;
  }
  return SF_ITERATIONS;
}

/* The state moved along its softest shape to the side of lower energy. */
static void sf_nudged(sf_run_of *run) {
  const sf_model *m = run->m;
  const sf_rules *rules = run->rules;
  double firm = rules->firm, length, up, down, larger;
  int i, sweep;
  sf_look(run, run->here);
  while (sf_firm(run, run->here->point.entries, firm) != 0 && firm < SF_FIRMEST) firm *= rules->firmer;
  /* From a shape that a rule of the scene gives: what comes of it lies to the same side. */
  sf_copy(run->step, rules->seed, m->total);
  for (sweep = 0; sweep < rules->sweeps; ++sweep) {
    for (i = 0; i < m->total; ++i) run->step[i] *= rules->mass[i];
    sf_back(run, run->step);
    for (i = m->unknowns; i < m->total; ++i) run->step[i] = 0.0;
    length = sf_largest(run->step, m->total);
    if (!(length > SF_TINY)) length = SF_TINY;
    for (i = 0; i < m->total; ++i) run->step[i] /= length;
  }
  length = sf_length(run, run->step);
  for (i = 0; i < m->total; ++i) run->step[i] *= rules->nudge / (length > SF_TINY ? length : SF_TINY);
  sf_move(m, &run->here->state, run->step, 1.0, &run->there->state);
  sf_look(run, run->there);
  up = run->there->point.potential;
  sf_move(m, &run->here->state, run->step, -1.0, &run->there->state);
  sf_look(run, run->there);
  down = run->there->point.potential;
  larger = fabs(up) > fabs(down) ? fabs(up) : fabs(down);
  /* A symmetric pair differs by rounding only: then the first side, so that answers repeat. */
  if (!(up - down > rules->level * larger)) sf_move(m, &run->here->state, run->step, 1.0, &run->there->state);
  sf_swap(run);
}

/* Newton's method from a near state. */
static int sf_corrected(sf_run_of *run, int most, int *negative) {
  const sf_rules *rules = run->rules;
  double last = HUGE_VAL;
  int first = 1, count;
  sf_look(run, run->here);
  for (count = 0; count < most && run->left && !run->room; ++count) {
    double length;
    int found;
    --run->left;
    if (!sf_is_finite(run->here->size)) return SF_NOT_FINITE;
    found = sf_newton(run, negative);
    if (!rules->symmetric) *negative = SF_NOT_DEFINED;
    if (!first && run->here->size <= rules->rounding) return SF_SOLVED;
    length = found ? sf_length(run, run->step) : HUGE_VAL;
    if (!(length <= rules->far) || length > (last > rules->near ? last : rules->near)) return SF_STALLED;
    first = 0;
    last = length;
    sf_move(run->m, &run->here->state, run->step, 1.0, &run->there->state);
    sf_look(run, run->there);
    if (run->here->size <= rules->converged && !(run->there->size <= rules->gain * run->here->size)) {
      if (run->there->size < run->here->size) sf_swap(run);
      return SF_SOLVED;
    }
    sf_swap(run);
  }
  return run->here->size <= rules->converged ? SF_SOLVED : SF_ITERATIONS;
}

/* An equilibrium from a state, in its place: downhill and out of what is unstable, or by whole steps alone.
 *
 * Returns 2 where factors have no room, with nothing changed; see sf_sought for how it ended else.
 */
int sf_seek(const sf_model *m, sf_system *system, const sf_rules *rules, const double *given, int whole, int left,
            sf_state *state, sf_point *point, double *memory, sf_sought *sought) {
  sf_run_of run;
  int i, escape, negative = SF_NOT_DEFINED, status = SF_UNSTABLE;
  sf_make_run(m, rules, memory, &run);
  run.m = m;
  run.system = system;
  run.rules = rules;
  run.given = given;
  run.left = left;
  run.room = 0;
  run.here = &run.both[0];
  run.there = &run.both[1];
  for (i = 0; i < 2; ++i) {
    run.both[i].point.result = point->result;
    run.both[i].point.place = point->place;
    run.both[i].point.pull = point->pull;
    run.both[i].point.work = point->work;
  }
  sf_copy_state(m, state, &run.here->state);
  if (whole) {
    status = sf_corrected(&run, whole, &negative);
  } else {
    for (escape = 0; escape <= rules->escapes && !run.room; ++escape) {
      status = sf_descended(&run, &negative);
      if (status != SF_SOLVED || negative <= 0) break;
      status = SF_UNSTABLE;
      if (escape < rules->escapes) sf_nudged(&run);
    }
  }
  if (run.room) return 2;
  sf_copy_state(m, &run.here->state, state);
  sought->status = status;
  sought->negative = negative;
  sought->left = run.left;
  sought->residual = run.here->size;
  return 0;
}
