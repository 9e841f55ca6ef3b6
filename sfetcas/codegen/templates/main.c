/* Solves @title@ once: ./main loads.tip.value.1=2.5 factor=3 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "@name@.h"

@entries_of_arguments@@entries_of_results@static double p[@NAME@_ARGUMENTS + 1], state[@NAME@_STATE + 1], found[@NAME@_RESULTS + 1];
static @name@_memory memory;

@put@
int main(int count, char **texts) {
  const entry *one;
  @name@_report report;
  int i;
  @name@_defaults(p);
  for (i = 1; i < count; ++i)
    if (!put(texts[i])) {
      fprintf(stderr, "found %s, accepted: name=value, or name.i=value for one number of several, of\n", texts[i]);
      list();
      return 2;
    }
  @name@_solve(&memory, p, state, 0, found, &report);
  printf("%s; %d iterations, residual %.1e, error about %.0e\n", @name@_message(report.status), report.iterations,
         report.residual, report.error);
  if (report.status != @NAME@_SOLVED && report.status != @NAME@_UNSTABLE) return 3;
  for (one = results; one->name; ++one) {
    printf("%s [%s]:", one->name, one->unit);
    for (i = 0; i < one->size; ++i) printf(" %.12g", found[one->first + i]);
    printf("\n");
  }
  return 0;
}
