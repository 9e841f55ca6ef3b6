/* Puts "name=value" or "name.i=value" to its place; 0 where there is none. */
static int put(const char *text) {
  const char *equals = strrchr(text, '=');
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

static void list(void) {
  const entry *one;
  int i;
  for (one = arguments; one->name; ++one) {
    fprintf(stderr, "  %s [%s], here", one->name, one->unit);
    for (i = 0; i < one->size; ++i) fprintf(stderr, " %.10g", p[one->first + i]);
    fprintf(stderr, "\n");
  }
}

