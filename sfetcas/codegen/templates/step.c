
static int sf_accepted(const double *p) {
  int i;
  for (i = 0; i < @NAME@_ARGUMENTS * @NAME@_TIMES; ++i)
    if (p[i] - p[i] != 0.0 || !(p[i] >= sf_low[i % @sz_one@]) || !(p[i] <= sf_high[i % @sz_one@])) return 0;
  return 1;
}

void @name@_begin(double *state) { sf_copy(state, sf_begin, @NAME@_STATE); }

void @name@_refresh(double *state) { state[@NAME@_STATE - 1] = 0.0; }

void @name@_times(double *shares) { sf_copy(shares, sf_loaded, @NAME@_TIMES); }

void @name@_tell(@name@_memory *m, const double *arguments, const double *state, double *results) {
  m->arg[0] = state;
  m->arg[1] = arguments;
  m->res[0] = results;
  @name@_results(m->arg, m->res, m->iw, m->w, 0);
}

int @name@_step_through(@name@_memory *m, double h, const double *arguments, double *state, double *results,
@indent_through@@name@_report *report) {
  int status = @NAME@_DONE, i;
  if (results)
    for (i = 0; i < @NAME@_RESULTS; ++i) results[i] = NAN;
  if (!(h >= SF_SHORTEST) || h - h != 0.0 || !sf_accepted(arguments) || !sf_all_finite(state, @NAME@_STATE)) {
    status = @NAME@_BAD_ARGUMENT;
    m->iterations = 0.0;
    m->gap = NAN;
  } else {
    if (sf_advanced(m, h, arguments, state) || !(m->size <= SF_CONVERGED) || !sf_all_finite(m->after, @NAME@_STATE))
      status = @NAME@_NOT_CONVERGED;
  }
  if (results && status == @NAME@_DONE) {
    @name@_tell(m, arguments + (@NAME@_TIMES - 1) * @NAME@_ARGUMENTS, m->after, results);
    if (!sf_all_finite(results, @NAME@_RESULTS)) {
      for (i = 0; i < @NAME@_RESULTS; ++i) results[i] = NAN;
      status = @NAME@_NOT_CONVERGED;
    }
  }
  if (report) {
    report->status = status;
    report->iterations = m->iterations - m->iterations == 0.0 ? (int)m->iterations : 0;
    report->gap = m->gap;
  }
  if (status == @NAME@_DONE) sf_copy(state, m->after, @NAME@_STATE);
  return status;
}

int @name@_step(@name@_memory *m, double h, const double *arguments, double *state, double *results,
@indent@@name@_report *report) {
  int i;
  for (i = 0; i < @NAME@_TIMES; ++i) sf_copy(m->arguments + i * @NAME@_ARGUMENTS, arguments, @NAME@_ARGUMENTS);
  return @name@_step_through(m, h, m->arguments, state, results, report);
}
