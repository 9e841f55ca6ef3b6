/* ---- Newton's method from afar ---------------------------------------------------------------
 *
 * The same decisions on the same numbers as sfetcas.solvers.globalised, where they are explained.
 */

typedef int (*@name@_function)(const double **, double **, int *, double *, int);

#define SF_TINY 1e-300
#define SF_FIRMEST 1e12
#define SF_FAILED (-1000000)
#define SF_NOT_DEFINED (-1)

/* The state that is looked at, and the equations there. */
typedef struct {
  double *state, *residual, *entries;
  double size, potential, gaps;
} sf_here;

/* What a call works on; all arrays are in the memory that the caller gives. */
typedef struct {
  @name@_memory *m;
  const double *given;
  int left;
} sf_run;

static int sf_finite(double x) { return x - x == 0.0; }

static int sf_all_finite(const double *x, int n) {
  int i;
  for (i = 0; i < n; ++i)
    if (!sf_finite(x[i])) return 0;
  return 1;
}

static int sf_accepted(const double *p) {
  int i;
  for (i = 0; i < @NAME@_ARGUMENTS; ++i)
    if (!sf_finite(p[i]) || !(p[i] >= sf_low[i]) || !(p[i] <= sf_high[i])) return 0;
  return 1;
}

static double sf_largest(const double *x, int n) {
  double found = 0.0;
  int i;
  for (i = 0; i < n; ++i) {
    double a = fabs(x[i]);
    if (a != a) return a;
    if (a > found) found = a;
  }
  return found;
}

static void sf_copy(double *to, const double *from, int n) {
  int i;
  for (i = 0; i < n; ++i) to[i] = from[i];
}

#if SF_DOWNHILL
static double sf_dot(const double *a, const double *b, int n) {
  double found = 0.0;
  int i;
  for (i = 0; i < n; ++i) found += a[i] * b[i];
  return found;
}
#endif

static int sf_call(@name@_memory *m, @name@_function f, const double *a, const double *b, const double *c, double *r) {
  m->arg[0] = a;
  m->arg[1] = b;
  m->arg[2] = c;
  m->res[0] = r;
  return f(m->arg, m->res, m->iw, m->w, 0);
}

static void sf_at(sf_run *run, sf_here *here) {
  @name@_memory *m = run->m;
  m->arg[0] = here->state;
  m->arg[1] = run->given;
  m->res[0] = here->residual;
  m->res[1] = &here->size;
  m->res[2] = &here->potential;
  m->res[3] = &here->gaps;
  m->res[4] = here->entries;
  @name@_at(m->arg, m->res, m->iw, m->w, 0);
}

#if SF_DOWNHILL
static void sf_merit(sf_run *run, const double *state, double *potential, double *gaps) {
  @name@_memory *m = run->m;
  m->arg[0] = state;
  m->arg[1] = run->given;
  m->res[0] = potential;
  m->res[1] = gaps;
  @name@_merit(m->arg, m->res, m->iw, m->w, 0);
}
#endif

static void sf_move(sf_run *run, const double *state, const double *step, double share, double *there) {
  sf_call(run->m, @name@_move, state, step, &share, there);
}

static void sf_swap(sf_here *a, sf_here *b) {
  sf_here c = *a;
  *a = *b;
  *b = c;
}

/* Factors of a matrix made firmer; its negative pivots, less those of the closings. */
static int sf_factor(sf_run *run, const double *entries, double firm) {
  @name@_memory *m = run->m;
  int i, negative = 0;
  sf_copy(m->target, entries, SF_ENTRIES);
  for (i = 0; i < SF_TOTAL; ++i) m->target[sf_diagonal[i]] += (SF_PROXIMAL + firm) * sf_mass[i];
  sf_copy(m->matrix, m->target, SF_ENTRIES);
  for (i = 0; i < SF_TOTAL; ++i) m->matrix[sf_diagonal[i]] += SF_SOFT * sf_soft[i];
#if SF_SYMMETRIC
  casadi_ldl(sf_pattern, m->matrix, sf_lower, m->lower, m->pivots, sf_order, m->w);
  for (i = 0; i < SF_TOTAL; ++i) {
    if (m->pivots[i] == 0.0) return SF_FAILED;
    negative += m->pivots[i] < 0.0;
  }
#if SF_PIVOTED
  sf_copy(m->matrix, m->target, SF_ENTRIES);
  for (i = 0; i < SF_TOTAL; ++i) m->matrix[sf_diagonal[i]] += SF_HARD * sf_soft[i];
#endif
  /* Nor are places that slide along what they touch, in which nothing is least, counted. */
  return negative - (SF_TOTAL - SF_UNKNOWNS) - SF_SLIDING;
#else
  return negative;
#endif
}

static void sf_backward(sf_run *run, const double *b, double *x) {
  @name@_memory *m = run->m;
#if !SF_PIVOTED
  sf_copy(x, b, SF_TOTAL);
  casadi_ldl_solve(x, 1, sf_lower, m->lower, m->pivots, sf_order, m->w);
#else
  sf_call(m, @name@_linear, m->matrix, b, 0, x);
#endif
}

/* Solution for the matrix factorised last, into m->step, the softness taken back; 0 where that fails. */
static int sf_solved(sf_run *run, const double *b) {
  @name@_memory *m = run->m;
  double largest = sf_largest(b, SF_TOTAL), last = HUGE_VAL;
  int i, round, found = 0;
  for (i = 0; i < SF_TOTAL; ++i) m->x[i] = 0.0;
  sf_copy(m->rest, b, SF_TOTAL);
  for (round = 0; round < SF_ROUNDS; ++round) {
    double size;
    int gained;
    sf_backward(run, m->rest, m->y);
    for (i = 0; i < SF_TOTAL; ++i) m->x[i] = m->x[i] + m->y[i];
    sf_call(m, @name@_left, m->target, m->x, b, m->rest);
    size = sf_largest(m->rest, SF_TOTAL);
    if (!(size < last)) break;
    sf_copy(m->step, m->x, SF_TOTAL);
    found = 1;
    gained = last > 4.0 * size;
    last = size;
    if (size <= 1e-16 * largest || !gained) break;
  }
  return found && last <= SF_LEFT * largest;
}

static void sf_against(sf_run *run, const sf_here *here) {
  int i;
  for (i = 0; i < SF_TOTAL; ++i) run->m->b[i] = -here->residual[i];
}

static int sf_newton(sf_run *run, const sf_here *here, int *negative) {
  *negative = sf_factor(run, here->entries, 0.0);
  sf_against(run, here);
  return *negative != SF_FAILED && sf_solved(run, run->m->b);
}

#if SF_DOWNHILL
/* A step downhill by a positive matrix, as firm as it takes. */
static int sf_downwards(sf_run *run, const sf_here *here) {
  @name@_memory *m = run->m;
  double firm = 0.0;
  sf_call(m, @name@_convex, here->state, run->given, 0, m->positive);
  sf_against(run, here);
  while (firm < SF_FIRMEST) {
    if (sf_factor(run, m->positive, firm) == 0 && sf_solved(run, m->b)) return 1;
    firm = SF_FIRMER * firm > SF_FIRM ? SF_FIRMER * firm : SF_FIRM;
  }
  return 0;
}

/* Where a step leads, shortened until potential and gaps fall; 0 where they never do. */
static int sf_shortened(sf_run *run, sf_here *here, sf_here *there, double *scale) {
  @name@_memory *m = run->m;
  const double *lam = here->state + SF_MULTIPLIERS;
  double penalty = 0.0, slope, before;
  int i, halving;
  for (i = SF_UNKNOWNS; i < SF_TOTAL; ++i) {
    double a = fabs(lam[i - SF_UNKNOWNS] + m->step[i]);
    if (a > penalty) penalty = a;
  }
  penalty *= 2.0;
  slope = sf_dot(here->residual, m->step, SF_UNKNOWNS);
  slope += sf_dot(lam, here->residual + SF_UNKNOWNS, SF_TOTAL - SF_UNKNOWNS);
  slope -= penalty * here->gaps;
  if (slope > 0.0) slope = 0.0;
  before = here->potential + penalty * here->gaps;
  for (halving = 0; halving < SF_HALVINGS; ++halving) {
    double potential, gaps, wanted;
    sf_move(run, here->state, m->step, *scale, there->state);
    if (halving == 0) {
      sf_at(run, there);
      potential = there->potential;
      gaps = there->gaps;
    } else {
      sf_merit(run, there->state, &potential, &gaps);
    }
    wanted = SF_ARMIJO * (*scale - 0.5 * (*scale * *scale)) * slope;
    if (potential + penalty * gaps - before <= wanted + SF_NOISE * fabs(before)) {
      if (halving) sf_at(run, there);
      sf_swap(here, there);
      return 1;
    }
    *scale *= 0.5;
  }
  return 0;
}

/* Downhill to an equilibrium, stable or not. */
static int sf_descended(sf_run *run, sf_here *here, sf_here *there, int *negative) {
  double scale = 1.0;
  int first = 1, turns_freely = 0, i;
  for (i = SF_MOMENT; i < SF_MOMENT + SF_MOMENTS; ++i) turns_freely |= run->given[i] != 0.0;
  sf_at(run, here);
  while (run->left) {
    double length, most;
    int found;
    --run->left;
    if (!sf_finite(here->size)) return @NAME@_NOT_FINITE;
    found = sf_newton(run, here, negative);
    if (!first && here->size <= SF_ROUNDING) return @NAME@_SOLVED;
    first = 0;
    if (found && sf_largest(run->m->step, SF_TURNING) < SF_NEAR) {
      /* Near an equilibrium, stable or not, Newton's own step leads to it. */
      sf_move(run, here->state, run->m->step, 1.0, there->state);
      sf_at(run, there);
      if (here->size <= SF_CONVERGED && !(there->size <= SF_GAIN * here->size)) {
        if (there->size < here->size) sf_swap(here, there);
        *negative = sf_factor(run, here->entries, 0.0);
        return @NAME@_SOLVED;
      }
      if (there->size < here->size || *negative == 0) {
        sf_swap(here, there);
        continue;
      }
    }
    if (!found || *negative != 0) found = sf_downwards(run, here);
    if (!found) return @NAME@_STALLED;
    length = sf_largest(run->m->step, SF_TURNING);
    if (!sf_finite(length)) return @NAME@_STALLED;
    most = turns_freely ? HUGE_VAL : SF_TURN;
    most /= length > SF_TINY ? length : SF_TINY;
    scale = 4.0 * scale < 1.0 ? 4.0 * scale : 1.0;
    if (most < scale) scale = most;
    if (!sf_shortened(run, here, there, &scale)) return @NAME@_STALLED;
  }
  return @NAME@_ITERATIONS;
}

/* The state moved along its softest shape to the side of lower energy. */
static void sf_nudged(sf_run *run, sf_here *here, sf_here *there) {
  @name@_memory *m = run->m;
  double firm = SF_FIRM, length, up, down, gaps, larger, ratio;
  int i, sweep;
  sf_at(run, here);
  while (sf_factor(run, here->entries, firm) != 0 && firm < SF_FIRMEST) firm *= SF_FIRMER;
  /* From a shape that a rule of the scene gives: what comes of it lies to the same side. */
  for (i = 0; i < SF_TOTAL; ++i) m->x[i] = sf_seed[i];
  for (sweep = 0; sweep < SF_SWEEPS; ++sweep) {
    for (i = 0; i < SF_TOTAL; ++i) m->y[i] = sf_mass[i] * m->x[i];
    sf_backward(run, m->y, m->x);
    for (i = SF_UNKNOWNS; i < SF_TOTAL; ++i) m->x[i] = 0.0;
    length = sf_largest(m->x, SF_TOTAL);
    if (!(length > SF_TINY)) length = SF_TINY;
    for (i = 0; i < SF_TOTAL; ++i) m->x[i] = m->x[i] / length;
  }
  length = sf_largest(m->x, SF_TURNING);
  ratio = SF_NUDGE / (length > SF_TINY ? length : SF_TINY);
  for (i = 0; i < SF_TOTAL; ++i) m->step[i] = m->x[i] * ratio;
  sf_move(run, here->state, m->step, 1.0, there->state);
  sf_merit(run, there->state, &up, &gaps);
  sf_move(run, here->state, m->step, -1.0, there->state);
  sf_merit(run, there->state, &down, &gaps);
  larger = fabs(up) > fabs(down) ? fabs(up) : fabs(down);
  /* A symmetric pair differs by rounding only: then the first side, so that answers repeat. */
  if (!(up - down > 1e-9 * larger)) sf_move(run, here->state, m->step, 1.0, there->state);
  sf_swap(here, there);
}
#endif

/* Newton's method from a near state. */
static int sf_corrected(sf_run *run, sf_here *here, sf_here *there, int most, int *negative) {
  double last = HUGE_VAL;
  int first = 1, count;
  sf_at(run, here);
  for (count = 0; count < most && run->left; ++count) {
    double length;
    int found;
    --run->left;
    if (!sf_finite(here->size)) return @NAME@_NOT_FINITE;
    found = sf_newton(run, here, negative);
    if (!SF_SYMMETRIC) *negative = SF_NOT_DEFINED;
    if (!first && here->size <= SF_ROUNDING) return @NAME@_SOLVED;
    if (!found) return @NAME@_STALLED;
    length = sf_largest(run->m->step, SF_TURNING);
    if (!(length <= SF_FAR) || length > (last > SF_NEAR ? last : SF_NEAR)) return @NAME@_STALLED;
    first = 0;
    last = length;
    sf_move(run, here->state, run->m->step, 1.0, there->state);
    sf_at(run, there);
    if (here->size <= SF_CONVERGED && !(there->size <= SF_GAIN * here->size)) {
      if (there->size < here->size) sf_swap(here, there);
      return @NAME@_SOLVED;
    }
    sf_swap(here, there);
  }
  return here->size <= SF_CONVERGED ? @NAME@_SOLVED : @NAME@_ITERATIONS;
}

/* By whole steps to an equilibrium that need not be left. */
static int sf_near(sf_run *run, sf_here *here, sf_here *there, int *negative, int *status) {
  *status = sf_corrected(run, here, there, SF_CORRECTIONS, negative);
  if (*status != @NAME@_SOLVED) return 0;
#if SF_MINIMISABLE
  if (*negative > 0) {
    *status = @NAME@_UNSTABLE;
    return SF_ESCAPES == 0 || !SF_DOWNHILL;
  }
#endif
  return 1;
}

/* Downhill from a state, and out of what is unstable. */
static int sf_from(sf_run *run, sf_here *here, sf_here *there, int *negative) {
#if SF_DOWNHILL
  int escape;
  for (escape = 0; escape <= SF_ESCAPES; ++escape) {
    int status = sf_descended(run, here, there, negative);
    if (status != @NAME@_SOLVED || *negative <= 0) return status;
    if (escape < SF_ESCAPES) sf_nudged(run, here, there);
  }
  return @NAME@_UNSTABLE;
#else
  return sf_corrected(run, here, there, run->left, negative);
#endif
}

/* What is given with a share of the loads, or on the way from what it was at the start. */
static void sf_shared(sf_run *run, const double *given, double share) {
  double *shared = run->m->shared;
  int i;
#if SF_BEGUN
  for (i = 0; i < SF_GIVEN; ++i) shared[i] = sf_begun[i] + share * (given[i] - sf_begun[i]);
#else
  for (i = 0; i < SF_LOADS; ++i) shared[i] = given[i];
  for (i = SF_LOADS; i < SF_GIVEN; ++i) shared[i] = share * given[i];
#endif
}

/* Where the loads lead, growing from zero, or what is given as it becomes another. */
static int sf_followed(sf_run *run, sf_here *here, sf_here *there, int *negative) {
  @name@_memory *m = run->m;
  const double *given = run->given;
  double share = 0.0, step = 1.0;
  int status = @NAME@_ITERATIONS;
  run->given = m->shared;
  sf_shared(run, given, 0.0);
  if (SF_BEGUN)
    sf_copy(m->reached, sf_start, SF_STATE);
  else
    sf_call(m, @name@_begin, m->shared, 0, 0, m->reached);
  while (share < 1.0 && run->left) {
    double next = share + step < 1.0 ? share + step : 1.0;
    sf_shared(run, given, next);
    sf_call(m, @name@_hold, m->reached, m->shared, 0, here->state);
    status = sf_corrected(run, here, there, SF_CORRECTIONS, negative);
    if (status == @NAME@_SOLVED) {
      share = next;
      step = 2.0 * step;
      sf_copy(m->reached, here->state, SF_STATE);
      continue;
    }
    step *= 0.5;
    if (step < SF_SHORTEST) break;
  }
  run->given = given;
  if (share < 1.0) return status == @NAME@_SOLVED ? @NAME@_ITERATIONS : status;
#if SF_DOWNHILL
  if (*negative > 0 && SF_ESCAPES > 0) {
    sf_nudged(run, here, there);
    return sf_from(run, here, there, negative);
  }
#endif
  return status;
}

static void sf_none(double *x, int n) {
  int i;
  for (i = 0; i < n; ++i) x[i] = NAN;
}

int @name@_solve(@name@_memory *m, const double *arguments, double *state, int warm, double *results,
                 @name@_report *report) {
  sf_run run;
  sf_here here, there;
  int status, negative = SF_NOT_DEFINED;
  run.m = m;
  run.given = m->given;
  run.left = SF_ITERATIONS;
  here.state = m->states[0];
  here.residual = m->residuals[0];
  here.entries = m->matrices[0];
  there.state = m->states[1];
  there.residual = m->residuals[1];
  there.entries = m->matrices[1];
  here.size = HUGE_VAL;
  if (results) sf_none(results, @NAME@_RESULTS);
  sf_call(m, @name@_prepare, arguments, 0, 0, m->given);
  if (!sf_accepted(arguments) || !sf_all_finite(m->given, SF_GIVEN) ||
      (warm && !sf_all_finite(state, SF_STATE))) {
    status = @NAME@_BAD_ARGUMENT;
  } else {
    if (warm)
      sf_call(m, @name@_hold, state, m->given, 0, here.state);
    else if (SF_STARTED)
      sf_call(m, @name@_hold, sf_start, m->given, 0, here.state);
    else
      sf_call(m, @name@_begin, m->given, 0, 0, here.state);
    if (!warm || !sf_near(&run, &here, &there, &negative, &status)) {
      if (warm) sf_call(m, @name@_hold, state, m->given, 0, here.state);
      status = sf_from(&run, &here, &there, &negative);
    }
    if (status != @NAME@_SOLVED && status != @NAME@_UNSTABLE && run.left) {
      sf_here first = here;
      int unstable = negative, followed;
      sf_copy(m->kept, here.state, SF_STATE);
      followed = sf_followed(&run, &here, &there, &negative);
      if (followed == @NAME@_SOLVED) {
        status = followed;
      } else {
        first.state = m->kept;
        here = first;
        negative = unstable;
      }
    }
  }
  if (SF_MINIMISABLE && status == @NAME@_SOLVED && negative > 0) status = @NAME@_UNSTABLE;
  if ((status == @NAME@_SOLVED || status == @NAME@_UNSTABLE) && !sf_all_finite(here.state, SF_STATE))
    status = @NAME@_NOT_FINITE;
  if (results && (status == @NAME@_SOLVED || status == @NAME@_UNSTABLE) &&
      (sf_call(m, @name@_results, arguments, here.state, m->given, results) ||
       !sf_all_finite(results, @NAME@_RESULTS))) {
    /* A result beyond what numbers can say, or a stiffness of what is singular. */
    sf_none(results, @NAME@_RESULTS);
    status = @NAME@_NOT_FINITE;
  }
#if SF_MARGINS
  if (status == @NAME@_SOLVED || status == @NAME@_UNSTABLE) {
    int i;
    sf_call(m, @name@_margins, arguments, here.state, m->given, m->margins);
    for (i = 0; i < SF_MARGINS; ++i)
      if (!(m->margins[i] >= SF_LEAST)) status = @NAME@_TOUCHES;
    if (results && status == @NAME@_TOUCHES) sf_none(results, @NAME@_RESULTS);
  }
#endif
  if (report) {
    report->status = status;
    report->iterations = SF_ITERATIONS - run.left;
    report->negative = status == @NAME@_SOLVED || status == @NAME@_UNSTABLE ? negative : SF_NOT_DEFINED;
    report->residual = here.size;
  }
  if (status == @NAME@_SOLVED || status == @NAME@_UNSTABLE) sf_copy(state, here.state, SF_STATE);
  return status;
}
