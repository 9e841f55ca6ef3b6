
/* Derivatives of all results by all arguments at a solution, @NAME@_RESULTS rows of @NAME@_ARGUMENTS numbers; those by
 * what makes the structure singular are not finite. */
void @name@_sensitivities(@name@_memory *memory, const double *arguments, const double *state, double *derivatives);
