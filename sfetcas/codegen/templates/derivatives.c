
static void sf_copy(double *to, const double *from, int n) {
  int i;
  for (i = 0; i < n; ++i) to[i] = from[i];
}

static void sf_call(@name@_memory *m, int (*f)(const double **, double **, int *, double *, int), const double *p,
                    const double *x, double *found, int n) {
  int i;
  m->arg[0] = p;
  m->arg[1] = x;
  m->res[0] = found;
  if (f(m->arg, m->res, m->iw, m->w, 0))
    for (i = 0; i < n; ++i) found[i] = NAN;
}

void @name@_guess(double *x) { sf_copy(x, sf_guess, @NAME@_UNKNOWNS); }

void @name@_energy(@name@_memory *m, const double *p, const double *x, double *energy) {
  sf_call(m, @name@_of_energy, p, x, energy, 1);
}

void @name@_gradient(@name@_memory *m, const double *p, const double *x, double *gradient) {
  sf_call(m, @name@_of_gradient, p, x, gradient, @NAME@_UNKNOWNS);
}

void @name@_constraints(@name@_memory *m, const double *p, const double *x, double *constraints) {
  sf_call(m, @name@_of_constraints, p, x, constraints, @NAME@_CONSTRAINTS);
}

void @name@_jacobian(@name@_memory *m, const double *p, const double *x, double *entries) {
  sf_call(m, @name@_of_jacobian, p, x, entries, @NAME@_JACOBIAN);
}

void @name@_hessian(@name@_memory *m, const double *p, const double *x, double weight, const double *multipliers,
@indent@double *entries) {
  m->arg[2] = &weight;
  m->arg[3] = multipliers;
  sf_call(m, @name@_of_hessian, p, x, entries, @NAME@_HESSIAN);
}

const int *@name@_jacobian_pattern(void) { return sf_jacobian; }

const int *@name@_hessian_pattern(void) { return sf_hessian; }

void @name@_defaults(double *arguments) {
  static const double defaults[] = {@defaults@};
  sf_copy(arguments, defaults, @NAME@_ARGUMENTS);
}
