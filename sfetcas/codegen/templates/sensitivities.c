
void @name@_sensitivities(@name@_memory *m, const double *arguments, const double *state, double *derivatives) {
  sf_call(m, @name@_prepare, arguments, 0, 0, m->given);
@switched@  sf_call(m, @name@_sensitivity, arguments, state, m->given, derivatives);
}
