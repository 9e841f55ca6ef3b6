/* The loop over a tape for LANES terms at once; included by tape.c for several numbers of lanes. */

#define EACH for (l = 0; l < LANES; ++l)
/* One kind of operation, so many times. */
#define STRETCH(OPERATION, WHAT) \
  case OPERATION: \
    for (; code < end; ++code) { \
      double *r = w + (size_t)code->to * LANES; \
      const double *a = w + (size_t)code->a * LANES, *b = w + (size_t)code->b * LANES; \
      int l; \
      WHAT \
      (void)r, (void)a, (void)b; \
    } \
    break;
#define UNARY(OPERATION, EXPRESSION) \
  STRETCH(OPERATION, double x[LANES]; EACH x[l] = a[l]; EACH r[l] = (EXPRESSION);)
#define BINARY(OPERATION, EXPRESSION) \
  STRETCH(OPERATION, double x[LANES]; double y[LANES]; EACH x[l] = a[l]; EACH y[l] = b[l]; EACH r[l] = (EXPRESSION);)

SF_WIDE static void NAME(const sf_tape *tape, const double *in, double *out, int left, double *w) {
  const sf_operation *code = tape->code;
  const int results = tape->results;
  int i;
  for (i = 0; i < tape->stretches; ++i) {
    const sf_operation *end = code + tape->stretch[i].count;
    switch (tape->stretch[i].operation) {
      case SF_IN:
        for (; code < end; ++code) {
          const double *x = in + (size_t)code->a * LANES;
          double *r = w + (size_t)code->to * LANES;
          int l;
          EACH r[l] = x[l];
        }
        break;
      case SF_OUT:
        for (; code < end; ++code) {
          const double *x = w + (size_t)code->a * LANES;
          double *o = out + code->to;
          int l;
          for (l = 0; l < left; ++l) o[(size_t)l * results] = x[l];
        }
        break;
      case SF_CONSTANT:
        for (; code < end; ++code) {
          const double x = tape->constant[code->a];
          double *r = w + (size_t)code->to * LANES;
          int l;
          EACH r[l] = x;
        }
        break;
      case SF_SPLINE:
        for (; code < end; ++code) {
          double *r = w + (size_t)code->to * LANES;
          const double *place = w + (size_t)code->a * LANES;
          int l;
          for (l = 0; l < left; ++l) r[l] = sf_look_up(tape, tape->spline + code->b, place + l, LANES);
          for (; l < LANES; ++l) r[l] = r[left - 1];
        }
        break;
      UNARY(SF_ASSIGN, x[l])
      BINARY(SF_ADD, x[l] + y[l])
      BINARY(SF_SUB, x[l] - y[l])
      BINARY(SF_MUL, x[l] * y[l])
      BINARY(SF_DIV, x[l] / y[l])
      UNARY(SF_NEG, -x[l])
      UNARY(SF_SQ, x[l] * x[l])
      UNARY(SF_TWICE, x[l] + x[l])
      UNARY(SF_SQRT, sqrt(x[l]))
      UNARY(SF_INV, 1.0 / x[l])
      UNARY(SF_FABS, fabs(x[l]))
      default: {
        const int operation = tape->stretch[i].operation;
        for (; code < end; ++code) {
          double *r = w + (size_t)code->to * LANES;
          const double *a = w + (size_t)code->a * LANES, *b = w + (size_t)code->b * LANES;
          double x[LANES], y[LANES];
          int l;
          EACH x[l] = a[l];
          EACH y[l] = b[l];
          for (l = 0; l < left; ++l) r[l] = sf_other(operation, x[l], y[l]);
          for (; l < LANES; ++l) r[l] = r[left - 1];
        }
      }
    }
  }
}

#undef EACH
#undef STRETCH
#undef UNARY
#undef BINARY
