typedef struct {
  const char *name;
  int first, size;
  const char *unit;
} entry;

static const entry arguments[] = {
@argument_entries@
  {0, 0, 0, 0}};

