/* Solves what was solved when this was made, and compares: cold, and again from a neighbouring solution. */
#include <math.h>
#include <stdio.h>

#include "@name@.h"

#define CASES @n_cases@

/* Rounding, which compilers arrange differently, grows by what makes a structure soft. */
#define TOLERANCE 1e-7

static const int statuses[CASES] = {@case_statuses@};
static const double arguments[CASES][@sz_p@] = {
@case_arguments@};
static const double expected[CASES][@sz_r@] = {
@case_results@};
/* What each result is compared by: the largest of its kind in all cases. */
static const double units[@sz_r@] = {
@units@};

static double state[@NAME@_STATE + 1], found[@NAME@_RESULTS + 1], bad[@NAME@_ARGUMENTS + 1];
static @name@_memory memory;

static double difference(int i) {
  double worst = 0.0;
  int k;
  for (k = 0; k < @NAME@_RESULTS; ++k) {
    double d = fabs(found[k] - expected[i][k]) / units[k];
    /* What is not a number is as wrong as can be. */
    if (!(d <= worst)) worst = d;
  }
  return worst;
}

int main(void) {
  int i, k, failed = 0, same = 0;
  double worst = 0.0;
  for (i = 0; i < CASES; ++i) {
    int status = @name@_solve(&memory, arguments[i], state, 0, found, 0), warm, equal = 1;
    double d = difference(i);
    if (status != statuses[i] || (status <= @NAME@_UNSTABLE && !(d <= TOLERANCE))) {
      printf("case %d: %s, difference %.1e\n", i, @name@_message(status), d);
      ++failed;
      continue;
    }
    if (status > @NAME@_UNSTABLE) continue;
    for (k = 0; k < @NAME@_RESULTS; ++k) equal &= found[k] == expected[i][k];
    same += equal;
    warm = @name@_solve(&memory, arguments[i], state, 1, found, 0);
    d = difference(i);
    if (warm != statuses[i] || !(d <= TOLERANCE)) {
      printf("case %d, warm: %s, difference %.1e\n", i, @name@_message(warm), d);
      ++failed;
    }
    if (!(d <= worst)) worst = d;
  }
  for (k = 0; k < @NAME@_ARGUMENTS; ++k) bad[k] = NAN;
  if (@NAME@_ARGUMENTS > 0 && @name@_solve(&memory, bad, state, 0, found, 0) != @NAME@_BAD_ARGUMENT) {
    printf("what is not a number was not refused\n");
    ++failed;
  }
  printf("%d of %d cases agree, %d of them to the last bit; largest relative difference %.1e\n", CASES - failed, CASES,
         same, worst);
  return failed != 0;
}
