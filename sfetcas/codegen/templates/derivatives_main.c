/* Evaluates @title@ at the answer: ./main loads.tip.value.1=2.5 factor=3 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "@name@.h"

@entries_of_arguments@
static double p[@NAME@_ARGUMENTS + 1], x[@NAME@_UNKNOWNS + 1], g[@NAME@_CONSTRAINTS + 1], slope[@NAME@_UNKNOWNS + 1];
static @name@_memory memory;

@put@

static double largest(const double *values, int n) {
  double found = 0.0;
  int i;
  for (i = 0; i < n; ++i)
    if (fabs(values[i]) > found) found = fabs(values[i]);
  return found;
}

int main(int count, char **texts) {
  double energy;
  int i;
  @name@_defaults(p);
  for (i = 1; i < count; ++i)
    if (!put(texts[i])) {
      fprintf(stderr, "found %s, accepted: name=value, or name.i=value for one number of several, of\n", texts[i]);
      list();
      return 2;
    }
  @name@_guess(x);
  @name@_energy(&memory, p, x, &energy);
  @name@_gradient(&memory, p, x, slope);
  @name@_constraints(&memory, p, x, g);
  printf("energy %.15g, largest derivative %.3g, largest constraint %.3g\n", energy, largest(slope, @NAME@_UNKNOWNS),
         largest(g, @NAME@_CONSTRAINTS));
  return 0;
}
