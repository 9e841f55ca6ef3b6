/* Evaluates what was evaluated when this was made, and compares. */
#include <math.h>
#include <stdio.h>

#include "@name@.h"

#define CASES @n_cases@
#define NUMBERS @n_numbers@

/* Rounding, which compilers arrange differently. */
#define TOLERANCE 1e-10

static const double arguments[CASES][@sz_p@] = {
@case_arguments@};
static const double places[CASES][@sz_x@] = {
@case_places@};
static const double multipliers[CASES][@sz_g@] = {
@case_multipliers@};
/* Energy, derivatives, constraints, their derivatives, second derivatives. */
static const double expected[CASES][NUMBERS] = {
@case_results@};

static double found[NUMBERS + 1];
static @name@_memory memory;

int main(void) {
  const int *rows = @name@_hessian_pattern();
  int i, k, failed = 0, same = 0;
  double worst = 0.0;
  failed += rows[@NAME@_UNKNOWNS] != @NAME@_HESSIAN;
  rows = @name@_jacobian_pattern();
  failed += rows[@NAME@_UNKNOWNS] != @NAME@_JACOBIAN;
  for (i = 0; i < CASES; ++i) {
    double *at = found, d = 0.0, size = 0.0;
    int equal = 1;
    @name@_energy(&memory, arguments[i], places[i], at);
    at += 1;
    @name@_gradient(&memory, arguments[i], places[i], at);
    at += @NAME@_UNKNOWNS;
    @name@_constraints(&memory, arguments[i], places[i], at);
    at += @NAME@_CONSTRAINTS;
    @name@_jacobian(&memory, arguments[i], places[i], at);
    at += @NAME@_JACOBIAN;
    @name@_hessian(&memory, arguments[i], places[i], 0.7, multipliers[i], at);
    for (k = 0; k < NUMBERS; ++k)
      if (fabs(expected[i][k]) > size) size = fabs(expected[i][k]);
    for (k = 0; k < NUMBERS; ++k) {
      double part = fabs(found[k] - expected[i][k]) / (size > 0.0 ? size : 1.0);
      equal &= found[k] == expected[i][k];
      if (!(part <= d)) d = part;
    }
    failed += !(d <= TOLERANCE);
    same += equal;
    if (!(d <= worst)) worst = d;
  }
  printf("%d of %d cases agree, %d of them to the last bit; largest relative difference %.1e\n", CASES - failed, CASES,
         same, worst);
  return failed != 0;
}
