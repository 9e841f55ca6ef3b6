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

/* What a call works on; room, seed: whether they were missed; limited: whether no node turns far in a step. */
typedef struct {
  const sf_model *m;
  sf_system *system;
  const sf_rules *rules;
  const sf_inputs *inputs;
  const double *given;
  sf_here *here, *there, both[2];
  double *target, *matrix, *positive, *step, *x, *y, *rest, *b, *solving, *in, *slots, *row, *reached, *kept;
  int left, room, seed, limited;
} sf_run_of;

/* Numbers of a row of inputs. */
static int sf_row_size(const sf_model *m, const sf_inputs *inputs) {
  int n = m->given + 3 * inputs->turning + m->angles, g;
  for (g = 0; g < inputs->groups; ++g) n += inputs->count[g];
  return n;
}

static int sf_make_run(const sf_model *m, const sf_rules *rules, const sf_inputs *inputs, double *memory,
                       sf_run_of *run) {
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
  PART(run->slots, 8 * (rules->convex ? rules->convex->slots : 0));
  PART(run->row, sf_row_size(m, inputs));
  PART(run->reached, sf_state_size(m));
  PART(run->kept, sf_state_size(m));
#undef PART
  return n;
}

/* Numbers of memory that a call takes. */
int sf_find_size(const sf_model *m, const sf_rules *rules, const sf_inputs *inputs) {
  sf_run_of none;
  return sf_make_run(m, rules, inputs, NULL, &none);
}

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

/* Angles near which turns are counted, as the row that was taken prescribes them; all of them for the undeformed state. */
static void sf_hold_angles(const sf_run_of *run, int all, sf_state *state) {
  const double *angle = run->given + run->m->given + 3 * run->inputs->turning;
  int i;
  for (i = 0; i < run->m->angles; ++i)
    if (all || run->inputs->held[i]) state->unwrapped[i] = angle[i];
}

/* From here to there by a share of the step. */
static void sf_go(sf_run_of *run, double share) {
  sf_move(run->m, &run->here->state, run->step, share, &run->there->state);
  /* However far a step turns what is driven, it is the drive that says how often. */
  sf_hold_angles(run, 0, &run->there->state);
}

/* How it ended at an equilibrium: in none where what is driven stands by whole turns from where its drive says. */
static int sf_ended(const sf_run_of *run) {
  const sf_state *state = &run->here->state;
  int i;
  for (i = 0; i < run->m->angles; ++i)
    if (run->inputs->held[i] &&
        !(fabs(sf_counted(run->m, i, state->q, state->unwrapped[i]) - state->unwrapped[i]) <= run->rules->miscounted))
      return SF_STALLED;
  return SF_SOLVED;
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
    lanes = sf_lanes(tape, left);
    left = left < lanes ? left : lanes;
    for (l = 0; l < lanes; ++l)
      sf_gather(m, group, 1, first + (l < left ? l : left - 1), &run->here->state, run->given, p, &work, work.in + l,
                lanes);
    sf_lanes_run(lanes, tape, work.in, run->in, left, run->slots);
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
    sf_go(run, *scale);
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
    if (!first && run->here->size <= rules->rounding) return sf_ended(run);
    first = 0;
    if (found && sf_length(run, run->step) < rules->near) {
      /* Near an equilibrium, stable or not, Newton's own step leads to it. */
      sf_go(run, 1.0);
      sf_look(run, run->there);
      if (run->here->size <= rules->converged && !(run->there->size <= rules->gain * run->here->size)) {
        if (run->there->size < run->here->size) sf_swap(run);
        *negative = sf_firm(run, run->here->point.entries, 0.0);
        return sf_ended(run);
      }
      if (run->there->size < run->here->size || *negative == 0) {
        sf_swap(run);
        continue;
      }
    }
    if (!found || *negative != 0) found = sf_downwards(run);
    length = found ? sf_length(run, run->step) : HUGE_VAL;
    if (!sf_is_finite(length)) return SF_STALLED;
    most = run->limited ? rules->turn : HUGE_VAL;
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
  if (!rules->seed) {
    run->seed = 1;
    return;
  }
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
  sf_go(run, 1.0);
  sf_look(run, run->there);
  up = run->there->point.potential;
  sf_go(run, -1.0);
  sf_look(run, run->there);
  down = run->there->point.potential;
  larger = fabs(up) > fabs(down) ? fabs(up) : fabs(down);
  /* A symmetric pair differs by rounding only: then the first side, so that answers repeat. */
  if (!(up - down > rules->level * larger)) sf_go(run, 1.0);
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
    int found, counted;
    --run->left;
    if (!sf_is_finite(run->here->size)) return SF_NOT_FINITE;
    found = sf_newton(run, negative);
    counted = *negative != SF_BROKEN;
    if (!rules->symmetric) *negative = SF_NOT_DEFINED;
    if (!first && run->here->size <= rules->rounding) return sf_ended(run);
    length = found ? sf_length(run, run->step) : HUGE_VAL;
    if (!(length <= rules->far) || length > (last > rules->near ? last : rules->near))
      /* What is in balance already needs no step, which rounding alone would make. */
      return counted && run->here->size <= rules->converged ? sf_ended(run) : SF_STALLED;
    first = 0;
    last = length;
    sf_go(run, 1.0);
    sf_look(run, run->there);
    if (run->here->size <= rules->converged && !(run->there->size <= rules->gain * run->here->size)) {
      if (run->there->size < run->here->size) sf_swap(run);
      return sf_ended(run);
    }
    sf_swap(run);
  }
  return run->here->size <= rules->converged ? sf_ended(run) : SF_ITERATIONS;
}

/* By whole steps to an equilibrium that need not be left. */
static int sf_by_whole_steps(sf_run_of *run, int *negative, int *status) {
  const sf_rules *rules = run->rules;
  *status = sf_corrected(run, rules->corrections, negative);
  if (*status != SF_SOLVED) return 0;
  if (*negative <= 0 || !rules->minimisable) return 1;
  *status = SF_UNSTABLE;
  return rules->escapes == 0 || !rules->downhill;
}

/* Downhill from a state, and out of what is unstable; by whole steps where nothing is least. */
static int sf_from(sf_run_of *run, int *negative) {
  const sf_rules *rules = run->rules;
  int escape, status;
  if (!rules->downhill) return sf_corrected(run, run->left, negative);
  for (escape = 0; escape <= rules->escapes; ++escape) {
    status = sf_descended(run, negative);
    if (run->room || run->seed || status != SF_SOLVED || *negative <= 0) return status;
    if (escape < rules->escapes) sf_nudged(run);
  }
  return SF_UNSTABLE;
}

/* Data of a row for the model, and what else it has: given, then vectors, then angles. */
static void sf_take(sf_run_of *run, const double *row) {
  const sf_inputs *inputs = run->inputs;
  int g;
  for (g = 0; g < inputs->groups; ++g) {
    sf_copy(inputs->datum[g], row, inputs->count[g]);
    row += inputs->count[g];
  }
  run->given = row;
}

/* A state (numbers,) with what is prescribed by the row that was taken; all angles where it is the undeformed one. */
static void sf_begin(sf_run_of *run, const double *numbers, int undeformed) {
  const sf_model *m = run->m;
  const sf_inputs *inputs = run->inputs;
  sf_state *state = &run->here->state;
  int i, k;
  sf_copy(state->q, numbers, sf_state_size(m));
  for (i = 0; m->space && !undeformed && i < m->rotations; ++i) {
    /* A start that somebody gives may have quaternions that are not normalised, however large. */
    double *q = state->q + (size_t)4 * i, size = sf_largest(q, 4);
    for (k = 0; k < 4; ++k) q[k] /= size;
    size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (k = 0; k < 4; ++k) q[k] /= size;
  }
  sf_prescribe(m, inputs->turning, inputs->turned, run->given + m->given, state);
  sf_hold_angles(run, undeformed, state);
}

/* A row with a share of all loads and motions, or on the way to it from where it was begun; taken. */
static void sf_share(sf_run_of *run, const double *row, double share) {
  const sf_inputs *inputs = run->inputs;
  int i, g, n = sf_row_size(run->m, inputs), data = 0;
  if (inputs->begun) {
    for (i = 0; i < n; ++i) run->row[i] = inputs->begun[i] + share * (row[i] - inputs->begun[i]);
  } else {
    for (g = 0; g < inputs->groups; ++g) data += inputs->count[g];
    sf_copy(run->row, row, data);
    for (i = data; i < n; ++i) run->row[i] = share * row[i];
  }
  sf_take(run, run->row);
}

/* Where the loads lead, growing from zero, or what is given as it becomes another. */
static int sf_followed(sf_run_of *run, const double *row, int *negative) {
  const sf_rules *rules = run->rules;
  const sf_inputs *inputs = run->inputs;
  int status = SF_ITERATIONS, numbers = sf_state_size(run->m);
  double share = 0.0, step = 1.0;
  sf_share(run, row, 0.0);
  sf_begin(run, inputs->begun ? inputs->reached : inputs->rest, !inputs->begun);
  sf_copy(run->reached, run->here->state.q, numbers);
  while (share < 1.0 && run->left && !run->room) {
    double next = share + step < 1.0 ? share + step : 1.0;
    sf_share(run, row, next);
    sf_begin(run, run->reached, 0);
    status = sf_corrected(run, rules->corrections, negative);
    if (status == SF_SOLVED) {
      share = next;
      step *= 2.0;
      sf_copy(run->reached, run->here->state.q, numbers);
      continue;
    }
    step *= 0.5;
    if (step < rules->shortest) break;
  }
  if (share < 1.0) return status == SF_SOLVED ? SF_ITERATIONS : status;
  sf_take(run, row);
  if (*negative > 0 && rules->escapes > 0 && rules->downhill) {
    sf_nudged(run);
    return run->seed ? status : sf_from(run, negative);
  }
  return status;
}

/* An equilibrium for a row of inputs, in place of a state (numbers,).
 *
 * It begins at the undeformed state; or with begins at that state, which where that is 2 is an equilibrium for other
 * values, from which whole steps are tried first.  Returns 2 where factors have no room, and 3 where a seed is needed
 * and there is none, with nothing changed but data; see sf_sought for how it ended else.
 */
int sf_find(const sf_model *m, sf_system *system, const sf_rules *rules, const sf_inputs *inputs, const double *row,
            int begins, double *state, sf_point *point, double *memory, sf_sought *sought) {
  sf_run_of run;
  int i, g, k, numbers = sf_state_size(m), negative = SF_NOT_DEFINED, status = SF_BAD_ARGUMENT;
  sf_make_run(m, rules, inputs, memory, &run);
  run.m = m;
  run.system = system;
  run.rules = rules;
  run.inputs = inputs;
  run.left = rules->iterations;
  run.room = run.seed = 0;
  run.limited = 1;
  run.here = &run.both[0];
  run.there = &run.both[1];
  run.here->size = HUGE_VAL;
  for (i = 0; i < 2; ++i) {
    run.both[i].point.result = point->result;
    run.both[i].point.place = point->place;
    run.both[i].point.pull = point->pull;
    run.both[i].point.work = point->work;
  }
  if (sf_all_finite(row, sf_row_size(m, inputs)) && (!begins || sf_all_finite(state, numbers))) {
    sf_take(&run, row);
    for (g = 0; g < inputs->couples; ++g) {
      const sf_group *group = m->group + inputs->couple[g];
      for (k = 0; k < group->terms * group->loads; ++k)
        if (run.given[group->load + k] != 0.0) run.limited = 0;
    }
    sf_begin(&run, begins ? state : inputs->rest, !begins);
    if (begins < 2 || !sf_by_whole_steps(&run, &negative, &status)) {
      if (begins == 2) sf_begin(&run, state, 0);
      status = sf_from(&run, &negative);
    }
    if (status != SF_SOLVED && status != SF_UNSTABLE && run.left && !run.room && !run.seed) {
      double size = run.here->size;
      int before = negative, followed;
      sf_copy(run.kept, run.here->state.q, numbers);
      followed = sf_followed(&run, row, &negative);
      if (followed == SF_SOLVED) {
        status = followed;
      } else {
        sf_copy(run.here->state.q, run.kept, numbers);
        run.here->size = size;
        negative = before;
      }
    }
    if (run.room) return 2;
    if (run.seed) return 3;
    if (rules->minimisable && status == SF_SOLVED && negative > 0) status = SF_UNSTABLE;
    if (status <= SF_UNSTABLE && !sf_all_finite(run.here->state.q, numbers)) status = SF_NOT_FINITE;
    sf_copy(state, run.here->state.q, numbers);
  }
  sought->status = status;
  sought->negative = status <= SF_UNSTABLE ? negative : SF_NOT_DEFINED;
  sought->iterations = rules->iterations - run.left;
  sought->residual = run.here->size;
  return 0;
}
