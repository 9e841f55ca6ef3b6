/* Solves @title@ once: ./main loads.tip.value.1=2.5 factor=3 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "@name@.h"

typedef struct {
  const char *name;
  int first, size;
  const char *unit;
} entry;

static const entry arguments[] = {
@argument_entries@
  {0, 0, 0, 0}};

static const entry results[] = {
@result_entries@
  {0, 0, 0, 0}};

static double p[@NAME@_ARGUMENTS + 1], state[@NAME@_STATE + 1], found[@NAME@_RESULTS + 1];
static @name@_memory memory;

/* Puts "name=value" or "name.i=value" to its place; 0 where there is none. */
static int put(const char *text) {
  const char *equals = strchr(text, '=');
  const entry *one;
  if (!equals) return 0;
  for (one = arguments; one->name; ++one) {
    size_t n = strlen(one->name);
    char *end;
    double value = strtod(equals + 1, &end);
    long i = 0;
    if (strncmp(text, one->name, n) != 0 || *end || end == equals + 1) continue;
    if (text[n] == '.') {
      i = strtol(text + n + 1, &end, 10);
      if (end != equals || i < 0 || i >= one->size) continue;
    } else if (text[n] != '=' || one->size != 1) {
      continue;
    }
    p[one->first + i] = value;
    return 1;
  }
  return 0;
}

int main(int count, char **texts) {
  const entry *one;
  @name@_report report;
  int i;
  @name@_defaults(p);
  for (i = 1; i < count; ++i)
    if (!put(texts[i])) {
      fprintf(stderr, "found %s, accepted: name=value, or name.i=value for one number of several, of\n", texts[i]);
      for (one = arguments; one->name; ++one)
        fprintf(stderr, "  %s (%d, %s), here %.10g\n", one->name, one->size, one->unit, p[one->first]);
      return 2;
    }
  @name@_solve(&memory, p, state, 0, found, &report);
  printf("%s; %d iterations, residual %.1e\n", @name@_message(report.status), report.iterations, report.residual);
  if (report.status != @NAME@_SOLVED && report.status != @NAME@_UNSTABLE) return 3;
  for (one = results; one->name; ++one) {
    printf("%s [%s]:", one->name, one->unit);
    for (i = 0; i < one->size; ++i) printf(" %.12g", found[one->first + i]);
    printf("\n");
  }
  return 0;
}
