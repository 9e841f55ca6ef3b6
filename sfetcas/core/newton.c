/* Newton's method from a near state down to rounding; sfetcas/solvers/newton.py takes the same decisions in Python. */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"

/* Where the parts of the memory of a correction begin: three states, two points, and vectors. */
typedef struct {
  sf_state state[3];
  sf_point point[2];
  double *step, *right, *both, *given, *ahead, *results, *matrix, *solving;
} sf_room;

static int sf_make_room(const sf_model *m, double *memory, sf_room *room) {
  int n = 0, i;
#define PART(place, count) \
  if (memory) place = memory + n; \
  n += (count)
  for (i = 0; i < 3; ++i) {
    if (memory) sf_lay_out(m, memory + n, &room->state[i]);
    n += sf_state_size(m);
  }
  for (i = 0; i < 2; ++i) {
    PART(room->point[i].residual, m->total);
    PART(room->point[i].scale, m->total);
    PART(room->point[i].entries, m->entry_count);
  }
  PART(room->step, m->total);
  PART(room->right, 2 * m->total);
  PART(room->both, 2 * m->total);
  PART(room->given, m->given);
  PART(room->ahead, m->given);
  PART(room->results, m->results);
  PART(room->matrix, m->entry_count);
  PART(room->solving, 4 * m->total);
#undef PART
  return n;
}

int sf_correct_size(const sf_model *m) { return sf_make_room(m, NULL, NULL); }

/* Whether the residual is small beside the largest forces that act, not only beside stiffness. */
static int sf_balanced(const sf_model *m, const sf_point *p, double share) {
  double acting = 0.0;
  int i;
  for (i = 0; i < m->unknowns; ++i)
    if (p->scale[i] - m->noise[i] > acting) acting = p->scale[i] - m->noise[i];
  return sf_largest(p->residual, m->unknowns) <= share * acting;
}

/* Whether rounding of the unknowns explains the whole residual, and that is small beside all that acts. */
static int sf_rounded(const sf_model *m, const sf_state *s, const sf_point *p, double residual, const sf_limits *limits,
                      double *noise) {
  double turned = sf_largest(s->q, m->components * m->rotations), moved = sf_largest(s->y, m->displacements);
  int i;
  if (!(residual <= limits->balanced) || !sf_balanced(m, p, limits->balanced)) return 0;
  if (!(turned > 1.0)) turned = 1.0;
  if (!(moved > 1.0)) moved = 1.0;
  for (i = 0; i < m->total; ++i) noise[i] = 0.0;
  for (i = 0; i < m->entry_count; ++i) {
    int column = m->entry_column[i];
    double size = column < m->rotation_unknowns ? turned : moved;
    if (column >= m->unknowns) size = fabs(s->lam[column - m->unknowns]);
    noise[m->entry_row[i]] += fabs(p->entries[i]) * size;
  }
  for (i = 0; i < m->total; ++i)
    if (!(fabs(p->residual[i]) <= limits->epsilon * noise[i])) return 0;
  return 1;
}

static void sf_regularise(const sf_model *m, const double *entries, const sf_limits *limits, double *matrix) {
  int i;
  sf_copy(matrix, entries, m->entry_count);
  for (i = 0; i < m->rotation_unknowns; ++i) matrix[m->diagonal[i]] += limits->proximal * limits->weight[i];
  for (i = m->unknowns; i < m->total; ++i) matrix[m->diagonal[i]] -= limits->dual;
}

/* Newton's step with a matrix; else as sf_solve. */
static int sf_step(const sf_model *m, sf_system *system, const double *entries, const double *residual,
                   const sf_limits *limits, sf_room *room) {
  int i;
  sf_regularise(m, entries, limits, room->matrix);
  for (i = 0; i < m->total; ++i) room->right[i] = -residual[i];
  return sf_solve(system, room->matrix, 1, room->right, room->step, room->solving);
}

static int sf_first_step(const sf_model *m, sf_system *system, const sf_point *p, const double *tangent,
                         const sf_limits *limits, sf_room *room) {
  double work = 0.0, along = 0.0;
  int i, broken = sf_step(m, system, tangent, p->residual, limits, room);
  if (broken) return broken;
  for (i = 0; i < m->rotation_unknowns; ++i) work += limits->weight[i] * (room->step[i] * room->step[i]);
  for (i = 0; i < m->total; ++i) along += room->step[i] * p->residual[i];
  if (limits->proximal * work <= 0.1 * fabs(along)) return 0;
  /* The tangent of an unloaded mechanism of rigid members has little but the proximal term. */
  return sf_step(m, system, p->entries, p->residual, limits, room);
}

/* What is given at the factor of a border. */
static void sf_give(const sf_model *m, const sf_border *border, double factor, double *given) {
  int i;
  for (i = 0; i < m->given; ++i) given[i] = border->begun[i] + factor * border->rate[i];
}

/* The derivative of the residual by the factor, at a state whose point is the one evaluated last.
 *
 * The residual is linear in loads.  given (given,) and results are memory.
 */
static void sf_rate(const sf_model *m, const sf_border *border, double factor, const sf_state *s, const sf_point *p,
                    double *slope, double *given, double *results) {
  sf_point there = *p;
  sf_work work;
  int i;
  if (border->apart == 0.0) {
    sf_slope(m, s, border->rate, p, slope, results);
    return;
  }
  there.residual = slope;
  sf_give(m, border, factor + border->apart, given);
  sf_divide(m, p->work, &work);
  sf_evaluate(m, s, given, &there);
  sf_residual(m, s, given, &there, &work);
  for (i = 0; i < m->total; ++i) slope[i] = (slope[i] - p->residual[i]) / border->apart;
}

/* Newton's step of all unknowns and of the factor, whose change is *change; the point is the one evaluated last. */
static int sf_bordered(const sf_model *m, sf_system *system, const sf_border *border, double factor,
                       const sf_state *s, const sf_point *p, const sf_limits *limits, sf_room *room, double *change) {
  double *base = room->both, *rate = room->both + m->total, along = 0.0, across = 0.0;
  int i, broken;
  sf_rate(m, border, factor, s, p, room->right + m->total, room->ahead, room->results);
  sf_regularise(m, p->entries, limits, room->matrix);
  for (i = 0; i < m->total; ++i) {
    room->right[i] = -p->residual[i];
    room->right[m->total + i] = -room->right[m->total + i];
  }
  broken = sf_solve(system, room->matrix, 2, room->right, room->both, room->solving);
  if (broken) return broken;
  for (i = 0; i < m->total; ++i) {
    along += border->row[i] * base[i];
    across += border->row[i] * rate[i];
  }
  *change = -along / (across + border->unit);
  for (i = 0; i < m->total; ++i) room->step[i] = base[i] + *change * rate[i];
  return 0;
}

/* Whether a point is accurate enough for its purpose, before rounding is reached. */
static int sf_suffices(const sf_model *m, const sf_border *border, const sf_point *p, double residual,
                       const sf_limits *limits) {
  return border && residual <= border->passing &&
         sf_largest(p->residual + m->unknowns, m->rows) <= limits->converged;
}

/* The equilibrium near a state, in its place, and the equations there; see sf_report for how that ended.
 *
 * Under what is given, with the matrix of a tangent for the first step if there is one; or with a border along a curve.
 * Returns 2 where factors have no room: nothing is changed then.
 */
int sf_correct(const sf_model *m, sf_system *system, const double *given, const double *tangent,
               sf_border *border, const sf_limits *limits, sf_state *state, sf_point *point, double *memory,
               sf_report *report) {
  sf_room room;
  int here = 0, there = 1, count = 0, over = 0, stalls = 0, shortened = 0, refused = 0, i;
  double residual, begun, last = HUGE_VAL, sum = 0.0, first = -1.0, second = -1.0, tolerance, change = 0.0;
  double factor = border ? border->factor : 1.0;
  sf_state *s = room.state;
  sf_point *p = room.point;
  sf_make_room(m, memory, &room);
  /* What is found here does not depend on what was solved before, not even in its last digits. */
  system->pivoted->known = 0;
  for (i = 0; i < 2; ++i) {
    p[i].result = point->result;
    p[i].place = point->place;
    p[i].pull = point->pull;
    p[i].work = point->work;
  }
  tolerance = limits->converged > limits->near ? limits->converged : limits->near;
  sf_copy_state(m, state, &s[0]);
  if (border) {
    sf_give(m, border, factor, room.given);
    given = room.given;
  }
  sf_at(m, &s[0], given, &p[0]);
  begun = residual = sf_relative(m, &p[0], limits->least);
  while (count < limits->iterations) {
    double length, slid = 0.0, share = 1.0, trial;
    int low;
    if (over || residual == 0.0) break;
    if (count && !shortened &&
        ((residual <= limits->exact && sf_balanced(m, &p[here], limits->balanced)) ||
         sf_suffices(m, border, &p[here], residual, limits)))
      break;
    if (border)
      i = sf_bordered(m, system, border, factor, &s[here], &p[here], limits, &room, &change);
    else if (count || !tangent)
      i = sf_step(m, system, p[here].entries, p[here].residual, limits, &room);
    else
      i = sf_first_step(m, system, &p[here], tangent, limits, &room);
    if (i == 2) return 2;
    if (i) break;
    length = sf_largest(room.step, m->total);
    if (!(length - length == 0.0) || !(change - change == 0.0)) break;
    for (i = 0; i < limits->slides; ++i)
      if (fabs(room.step[limits->slide[i]]) > slid) slid = fabs(room.step[limits->slide[i]]);
    if (limits->slid < slid) share = limits->slid / slid;
    length = share * sf_largest(room.step, m->rotation_unknowns);
    if (first < 0.0)
      first = length;
    else if (second < 0.0)
      second = length;
    sum += length;
    i = length > limits->most ||
        length > (limits->contraction * last > limits->brief ? limits->contraction * last : limits->brief);
    if (sum > limits->turned || (count && residual > tolerance && i)) {
      refused = 1;
      break;
    }
    sf_move(m, &s[here], room.step, share, &s[there]);
    if (!count) sf_copy_state(m, &s[here], &s[2]);
    if (border) sf_give(m, border, factor + share * change, room.given);
    sf_at(m, &s[there], given, &p[there]);
    trial = sf_relative(m, &p[there], limits->least);
    if (!(trial - trial == 0.0)) break;
    shortened = share < 1.0;
    low = 0;
    if (!shortened && trial > 0.25 * residual) {
      if (residual <= limits->converged)
        low = count > 0 || (limits->returns && sf_balanced(m, &p[here], limits->balanced));
      else
        low = count > 0 && sf_rounded(m, &s[here], &p[here], residual, limits, room.right);
    }
    /* Where a line ends is known to the root of the residual only: what is left goes in a further step. */
    if (low && !stalls && share * slid > limits->placed) {
      stalls = 1;
    } else if (low) {
      over = 1;
      /* The better of the two; its length and count stay its own. */
      if (!(trial < residual)) continue;
    } else {
      stalls = 0;
    }
    ++count;
    factor += share * change;
    last = length;
    residual = trial;
    i = here;
    here = there;
    there = i;
  }
  if (limits->returns && !(residual <= limits->converged) && begun <= limits->converged) {
    if (count) sf_copy_state(m, &s[2], &s[here]);
    residual = begun;
  }
  sf_copy_state(m, &s[here], state);
  if (border) {
    border->factor = factor;
    sf_give(m, border, factor, room.given);
  }
  sf_at(m, state, given, point);
  report->tolerance = limits->converged;
  report->good = residual <= limits->converged || sf_suffices(m, border, point, residual, limits);
  if (!report->good && !refused && sf_rounded(m, state, point, residual, limits, room.right)) {
    report->tolerance = 4.0 * residual < limits->balanced ? 4.0 * residual : limits->balanced;
    report->good = 1;
  }
  report->residual = residual;
  report->iterations = count;
  report->refused = refused;
  report->steps = (first >= 0.0) + (second >= 0.0);
  report->first = first;
  report->second = second;
  return 0;
}
