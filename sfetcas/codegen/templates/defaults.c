
void @name@_defaults(double *arguments) {
  static const double defaults[] = {@defaults@};
  sf_copy(arguments, defaults, @NAME@_ARGUMENTS);
}

const char *@name@_message(int status) {
  switch (status) {
@messages@
    default: return "no status of this solver";
  }
}
