/* Takes the steps that were taken when this was made, and compares. */
#include <math.h>
#include <stdio.h>

#include "@name@.h"

#define STEPS @n_cases@

/* Rounding, which compilers arrange differently, grows from step to step. */
#define TOLERANCE 1e-7

static const double h = @usual_step@;
static const double arguments[STEPS][@NAME@_TIMES * @sz_one@] = {
@case_arguments@};
static const double expected[STEPS][@sz_r@] = {
@case_results@};
/* What each result is compared by: the largest of its kind in all steps. */
static const double units[@sz_r@] = {
@units@};

static double state[@NAME@_STATE + 1], before[@NAME@_STATE + 1], found[@NAME@_RESULTS + 1];
static @name@_memory memory;

int main(void) {
  int i, k, failed = 0, same = 0;
  double worst = 0.0;
  @name@_begin(state);
  for (i = 0; i < STEPS; ++i) {
    int status = @name@_step_through(&memory, h, arguments[i], state, found, 0), equal = 1;
    double d = 0.0;
    for (k = 0; k < @NAME@_RESULTS; ++k) {
      double part = fabs(found[k] - expected[i][k]) / units[k];
      equal &= found[k] == expected[i][k];
      /* What is not a number is as wrong as can be. */
      if (!(part <= d)) d = part;
    }
    if (status != @NAME@_DONE || !(d <= TOLERANCE)) {
      printf("step %d: %s, difference %.1e\n", i + 1, @name@_message(status), d);
      ++failed;
    }
    same += equal;
    if (!(d <= worst)) worst = d;
  }
  for (k = 0; k < @NAME@_STATE; ++k) before[k] = state[k];
  if (@name@_step(&memory, NAN, arguments[0], state, found, 0) != @NAME@_BAD_ARGUMENT) ++failed;
  if (@name@_step(&memory, -1.0, arguments[0], state, found, 0) != @NAME@_BAD_ARGUMENT) ++failed;
  for (k = 0; k < @NAME@_STATE; ++k) failed += before[k] != state[k];
  printf("%d of %d steps agree, %d of them to the last bit; largest relative difference %.1e\n", STEPS - failed, STEPS,
         same, worst);
  return failed != 0;
}
