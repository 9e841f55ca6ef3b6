static const entry results[] = {
@result_entries@
  {0, 0, 0, 0}};

