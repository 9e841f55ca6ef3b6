/* Loads that grow: the plain part of sfetcas/solvers/continuation.py, whose decisions these are, and many cases.
 *
 * Plain is a way on which no equilibrium comes near to being unstable.  Where one does, or steps become very short, the
 * way is left to the caller, who knows what to do about it.
 */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"

#define SF_HALF_TURN 3.14159265358979323846

/* Where the parts of the memory of a way begin: that of a correction, a state, and vectors. */
typedef struct {
  double *correcting, *tangent, *given, *matrix, *left, *solved, *work;
  sf_state state;
} sf_place;

static int sf_make_place(const sf_model *m, double *memory, sf_place *place) {
  int n = 0;
#define PART(part, count) \
  if (memory) place->part = memory + n; \
  n += (count)
  PART(correcting, sf_correct_size(m));
  PART(tangent, m->entry_count);
  PART(given, m->given);
  PART(matrix, m->entry_count);
  PART(left, m->total);
  PART(solved, m->total);
  PART(work, m->total);
#undef PART
  if (memory) sf_lay_out(m, memory + n, &place->state);
  return n + sf_state_size(m);
}

int sf_follow_size(const sf_model *m) { return sf_make_place(m, NULL, NULL); }

static double sf_norm(const double *x, int n) {
  double sum = 0.0;
  int i;
  for (i = 0; i < n; ++i) sum += x[i] * x[i];
  return sqrt(sum);
}

/* Whether factors miss so little of the matrix that the signs of their pivots are right; see InertiaSolver.missed. */
static int sf_accurate(const sf_factors *f, const sf_count_of *count, const double *matrix, sf_place *place) {
  double before = HUGE_VAL, now = HUGE_VAL;
  int i, round, n = f->n;
  for (i = 0; i < n; ++i) place->left[i] = 1.0;
  for (round = 0; round < count->rounds; ++round) {
    for (i = 0; i < n; ++i) place->solved[i] = place->left[i];
    sf_backward(f, 1, place->solved, place->work);
    for (i = 0; i < n; ++i) place->work[i] = place->left[i];
    sf_left(f, matrix, place->work, place->solved, place->left);
    before = now;
    now = sf_norm(place->left, n);
  }
  return now <= count->blurred * sqrt((double)n) || now < count->broken * before;
}

/* Number of eigenvalues of the energy on the closings below a shift; -1 where factors do not tell.
 *
 * The signs of the pivots of the matrix with a border count them; see sfetcas/solvers/stability.py.
 */
static int sf_below(const sf_model *m, const sf_system *system, const double *entries, const sf_count_of *count,
                    double shift, sf_place *place) {
  double size = 1.0, *matrix = place->matrix;
  int i, negative;
  sf_copy(matrix, entries, m->entry_count);
  for (i = 0; i < m->unknowns; ++i) {
    double own = fabs(entries[m->diagonal[i]]);
    if (i < m->rotation_unknowns && own > size) size = own;
    /* Where rounding hides small eigenvalues each mode is looked at by itself, which is not done here. */
    if (count->weight[i] > 0.0 && !(own * count->rounding <= count->graded * count->weight[i])) return -1;
    matrix[m->diagonal[i]] -= shift * count->weight[i];
    if (i >= m->rotation_unknowns) matrix[m->diagonal[i]] += count->soft * count->softest;
  }
  for (i = m->unknowns; i < m->total; ++i) matrix[m->diagonal[i]] -= count->soft / size;
  if (sf_factorise(system->factors, matrix, &negative) || !(system->factors->least >= count->signs)) return -1;
  return sf_accurate(system->factors, count, matrix, place) ? negative - m->rows : -1;
}

/* Whether all eigenvalues are clearly above zero; 0 where some are not, or nobody knows. */
static int sf_clear(const sf_model *m, const sf_system *system, const double *entries, const sf_count_of *count,
                    sf_place *place) {
  return sf_below(m, system, entries, count, count->shift, place) == 0;
}

/* Number of negative eigenvalues where none is near to zero; -1 where one is, or nobody knows. */
int sf_negative(const sf_model *m, const sf_system *system, const double *entries, const sf_count_of *count,
                double *memory) {
  sf_place place;
  int above, below;
  sf_make_place(m, memory, &place);
  above = sf_below(m, system, entries, count, count->shift, &place);
  /* Usual are equilibria with none at all. */
  if (above <= 0) return above;
  below = sf_below(m, system, entries, count, -count->shift, &place);
  return above == below ? above : -1;
}

/* The state with prescribed rotations as they are at a part of the way. */
static void sf_hold(const sf_model *m, const sf_way *way, double part, sf_state *state) {
  int i, k;
  for (i = 0; i < way->turning; ++i) {
    size_t at = (size_t)m->given + 3 * (size_t)i;
    double turn[3];
    for (k = 0; k < 3; ++k) turn[k] = (way->begun ? way->begun[at + k] : 0.0) + part * way->rate[at + k];
    sf_prescribe(m, 1, way->turned + i, turn, state);
  }
}

static void sf_give_part(const sf_model *m, const sf_way *way, double part, double *given) {
  int i;
  for (i = 0; i < m->given; ++i) given[i] = (way->begun ? way->begun[i] : 0.0) + part * way->rate[i];
}

/* The equilibrium to which loads lead that grow, in place of a state, which is one where the way begins.
 *
 * tangent (entries,) is the matrix there.  Returns 0 at the end of the way; 1 where it is not plain any more: way->done
 * says how far it was, and the state is the equilibrium there; 2 where factors have no room.
 */
int sf_follow(const sf_model *m, sf_system *system, sf_way *way, const sf_limits *limits, const sf_count_of *count,
              const double *tangent, sf_state *state, sf_point *point, double *memory, sf_report *report) {
  sf_place place;
  sf_make_place(m, memory, &place);
  sf_copy(place.tangent, tangent, m->entry_count);
  for (; way->done < 1.0 && way->tries > 0; --way->tries) {
    double step = way->step < way->longest ? way->step : way->longest;
    double trial = way->done + step < 1.0 ? way->done + step : 1.0;
    int far, stuck, broken;
    sf_give_part(m, way, trial, place.given);
    sf_copy_state(m, state, &place.state);
    sf_hold(m, way, trial, &place.state);
    broken = sf_correct(m, system, place.given, place.tangent, NULL, limits, &place.state, point, place.correcting,
                        report);
    if (broken) return broken;
    if (!report->steps && !report->good) return 1;
    if (report->steps < 2) report->second = 0.0;
    if (report->steps < 1) report->first = 0.0;
    far = report->first > SF_HALF_TURN && (m->angles || report->second > way->linear);
    if (!report->good || far) {
      stuck = way->done == 0.0 && step <= way->unbalanced && report->second < way->still * report->first && !far;
      if (stuck || !(step > way->shortest * way->done && step > way->least)) return 1;
      way->step = step * (way->done == 0.0 ? 0.1 : report->iterations > 2 ? 0.5 : 0.25);
      continue;
    }
    if (count && !sf_clear(m, system, point->entries, count, &place)) return 1;
    way->done = trial;
    way->step = step * (report->second < way->brief ? 4.0 : 2.0);
    sf_copy_state(m, &place.state, state);
    sf_copy(place.tangent, point->entries, m->entry_count);
  }
  return !(way->done >= 1.0);
}

/* Equilibria of one model for many loads and data, whose rows are those of sf_inputs.
 *
 * Each state begins as the one of a case before, or where nothing is followed as it stands in its row; where that does
 * not lead to one that is clearly stable, it is followed from zero loads.  Found are 1 for what was followed, 2 for
 * what was near, 0 for what is left to the caller.  Returns 2 where factors have no room, with the number of cases that
 * are done in cases->done.
 */
int sf_solve_cases(const sf_model *m, sf_system *system, sf_cases *cases, const sf_way *way, const sf_limits *limits,
                   const sf_limits *near_limits, const sf_count_of *count, sf_point *point, double *memory) {
  int numbers = m->given + 3 * way->turning + m->angles, size = sf_state_size(m), g, broken;
  sf_state state;
  sf_report report;
  sf_place place;
  sf_make_place(m, memory, &place);
  for (g = 0; g < cases->groups; ++g) numbers += cases->count[g];
  for (; cases->done < cases->cases; ++cases->done) {
    int i = cases->done, before = cases->near ? cases->near[i] : -1;
    const double *row = cases->row + (size_t)i * numbers;
    double *own = cases->state + (size_t)i * size;
    sf_count_of counted = *count;
    sf_way own_way = *way;
    /* No case depends on those before it. */
    system->lost = 0;
    counted.shift *= cases->stiffer[i];
    cases->found[i] = 0;
    cases->residual[i] = NAN;
    for (g = 0; g < cases->groups; ++g) {
      sf_copy(cases->datum[g], row, cases->count[g]);
      row += cases->count[g];
    }
    sf_lay_out(m, own, &state);
    if (before >= 0 && cases->found[before]) sf_copy(own, cases->state + (size_t)before * size, size);
    own_way.begun = NULL;
    own_way.rate = row;
    own_way.longest = cases->longest[i];
    if (!cases->follows || (before >= 0 && cases->found[before])) {
      sf_hold(m, &own_way, 1.0, &state);
      broken = sf_correct(m, system, row, NULL, NULL, near_limits, &state, point, place.correcting, &report);
      if (broken) return broken;
      if (report.good && sf_clear(m, system, point->entries, &counted, &place)) {
        cases->found[i] = 2;
        cases->residual[i] = report.residual;
      }
    }
    if (cases->follows && !cases->found[i]) {
      sf_copy(own, cases->zero, size);
      sf_give_part(m, &own_way, 0.0, place.given);
      sf_at(m, &state, place.given, point);
      broken = sf_follow(m, system, &own_way, limits, &counted, point->entries, &state, point, memory, &report);
      if (broken == 2) return broken;
      if (!broken) {
        cases->found[i] = 1;
        cases->residual[i] = report.residual;
      }
    }
  }
  return 0;
}
