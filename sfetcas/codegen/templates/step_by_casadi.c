static int sf_all_finite(const double *x, int n) {
  int i;
  for (i = 0; i < n; ++i)
    if (x[i] - x[i] != 0.0) return 0;
  return 1;
}

static void sf_copy(double *to, const double *from, int n) {
  int i;
  for (i = 0; i < n; ++i) to[i] = from[i];
}

static int sf_advanced(@name@_memory *m, double h, const double *arguments, const double *state) {
  m->arg[0] = state;
  m->arg[1] = &h;
  m->arg[2] = arguments;
  m->res[0] = m->after;
  m->res[1] = &m->size;
  m->res[2] = &m->iterations;
  m->res[3] = &m->gap;
  return @name@_advance(m->arg, m->res, m->iw, m->w, 0);
}

