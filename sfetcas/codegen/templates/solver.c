/* ---- the solver: tables for the core, and what they are made of ---- */

typedef int (*@name@_function)(const double **, double **, int *, double *, int);

static int sf_call(@name@_memory *m, @name@_function f, const double *a, const double *b, const double *c, double *r) {
  m->arg[0] = a;
  m->arg[1] = b;
  m->arg[2] = c;
  m->res[0] = r;
  return f(m->arg, m->res, m->iw, m->w, 0);
}

static int sf_accepted(const double *p) {
  int i;
  for (i = 0; i < @NAME@_ARGUMENTS; ++i)
    if (!sf_is_finite(p[i]) || !(p[i] >= sf_low[i]) || !(p[i] <= sf_high[i])) return 0;
  return 1;
}

static void sf_none(double *x, int n) {
  int i;
  for (i = 0; i < n; ++i) x[i] = NAN;
}

int @name@_solve(@name@_memory *m, const double *arguments, double *state, int warm, double *results,
                 @name@_report *report) {
  sf_model model = sf_the_model;
  sf_inputs inputs = sf_the_inputs;
  sf_group groups[SF_GROUPS];
  double *data[SF_VARYING + 1], *numbers = m->numbers, *row, *own;
  int *whole = m->whole, i, begins = warm ? 2 : SF_STARTED, status = @NAME@_BAD_ARGUMENT;
  sf_factors factors;
  sf_pivoted pivoted;
  sf_system system;
  sf_point point;
  sf_sought sought;
  double error = NAN;
  for (i = 0; i < SF_GROUPS; ++i) groups[i] = sf_groups[i];
  model.group = groups;
  for (i = 0; i < SF_VARYING; ++i) {
    data[i] = sf_numbers(&numbers, (size_t)sf_counts[i]);
    groups[sf_varying[i]].datum = data[i];
  }
  inputs.count = sf_counts;
  inputs.datum = data;
  row = sf_numbers(&numbers, SF_INPUTS);
  own = sf_numbers(&numbers, SF_STATE);
  sf_lend_point(&model, model.results, &point, &numbers);
  sf_lend(&factors, &pivoted, &numbers, &whole);
  factors.entries = model.entry_count;
  factors.order = sf_order;
  factors.place = sf_place_in_order;
  factors.value = sf_numbers(&numbers, SF_FILLED);
  factors.pivot = sf_numbers(&numbers, SF_TOTAL);
  factors.column = sf_numbers(&numbers, SF_TOTAL);
  factors.parent = sf_wholes(&whole, SF_TOTAL);
  factors.lower = sf_wholes(&whole, SF_TOTAL + 1);
  factors.lower_row = sf_wholes(&whole, SF_FILLED);
  factors.mark = sf_wholes(&whole, SF_TOTAL);
  factors.path = sf_wholes(&whole, SF_TOTAL);
  factors.used = sf_wholes(&whole, SF_TOTAL);
  sf_count(&factors);
  system.factors = &factors;
  system.pivoted = &pivoted;
  sought.iterations = 0;
  sought.negative = SF_NOT_DEFINED;
  sought.residual = HUGE_VAL;
  if (results) sf_none(results, @NAME@_RESULTS);
  sf_call(m, @name@_prepare, arguments, 0, 0, m->given);
  if (begins) sf_copy(own, warm ? state : sf_start, SF_STATE);
  if (sf_accepted(arguments)) {
@find@  }
  if (results && status <= @NAME@_UNSTABLE &&
      (sf_call(m, @name@_results, arguments, own, m->given, results) || !sf_all_finite(results, @NAME@_RESULTS))) {
    /* A result beyond what numbers can say, or a stiffness of what is singular. */
    sf_none(results, @NAME@_RESULTS);
    status = @NAME@_NOT_FINITE;
  }
#if SF_MARGINS
  if (status <= @NAME@_UNSTABLE) {
    sf_call(m, @name@_margins, arguments, own, m->given, m->margins);
    for (i = 0; i < SF_MARGINS; ++i)
      if (!(m->margins[i] >= 0.0)) status = @NAME@_TOUCHES;
    if (results && status == @NAME@_TOUCHES) sf_none(results, @NAME@_RESULTS);
  }
#endif
  if (report) {
    if (status <= @NAME@_UNSTABLE) sf_call(m, @name@_error, own, m->given, 0, &error);
    report->error = error;
    report->status = status;
    report->iterations = sought.iterations;
    report->negative = status <= @NAME@_UNSTABLE ? sought.negative : SF_NOT_DEFINED;
    report->residual = sought.residual;
  }
  if (status <= @NAME@_UNSTABLE) sf_copy(state, own, SF_STATE);
  return status;
}
