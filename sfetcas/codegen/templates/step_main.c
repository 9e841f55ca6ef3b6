/* @title@: ./main steps h [name=value ...] prints what each step leads to, a line for each. */
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
  char *end = 0;
  int i, step, steps = count > 1 ? (int)strtol(texts[1], &end, 10) : 10;
  double h = @usual_step@;
  if (count > 1 && *end == 0 && count > 2) h = strtod(texts[2], &end);
  @name@_defaults(p);
  if (end && *end) {
    fprintf(stderr, "found %s, accepted: ./main [steps [h [name=value ...]]], h in s, and names of\n",
            count > 2 && strchr(texts[1], '=') == 0 ? texts[2] : texts[1]);
    list();
    return 2;
  }
  for (i = 3; i < count; ++i)
    if (!put(texts[i])) {
      fprintf(stderr, "found %s, accepted: name=value, or name.i=value for one number of several, of\n", texts[i]);
      list();
      return 2;
    }
  @name@_begin(state);
  printf("t [s]");
  for (one = results; one->name; ++one) printf(" %s[%d] [%s]", one->name, one->size, one->unit);
  printf("\n");
  for (step = 1; step <= steps; ++step) {
    if (@name@_step(&memory, h, p, state, found, &report) != @NAME@_DONE) {
      fprintf(stderr, "step %d: %s\n", step, @name@_message(report.status));
      return 3;
    }
    printf("%.10g", step * h);
    for (i = 0; i < @NAME@_RESULTS; ++i) printf(" %.12g", found[i]);
    printf("\n");
  }
  return 0;
}
