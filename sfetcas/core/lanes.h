/* The loop over a tape for LANES terms at once; included by tape.c for several numbers of lanes. */

#define EACH for (l = 0; l < LANES; ++l)
#define UNARY(OPERATION, EXPRESSION) \
  case OPERATION: { \
    double x[LANES]; \
    EACH x[l] = a[l]; \
    EACH r[l] = (EXPRESSION); \
    break; \
  }
#define BINARY(OPERATION, EXPRESSION) \
  case OPERATION: { \
    double x[LANES], y[LANES]; \
    EACH x[l] = a[l]; \
    EACH y[l] = b[l]; \
    EACH r[l] = (EXPRESSION); \
    break; \
  }

static void NAME(const sf_tape *tape, const double *in, double *out, int left, double *w) {
  const sf_operation *step = tape->code, *end = tape->code + tape->operations;
  const int results = tape->results;
  for (; step < end; ++step) {
    double *r = w + (size_t)step->to * LANES;
    const double *a = w + (size_t)step->a * LANES, *b = w + (size_t)step->b * LANES;
    int l;
    switch (step->operation) {
      case SF_IN: {
        const double *x = in + (size_t)step->a * LANES;
        EACH r[l] = x[l];
        break;
      }
      case SF_OUT: {
        const double *x = w + (size_t)step->a * LANES;
        double *o = out + step->to;
        for (l = 0; l < left; ++l) o[(size_t)l * results] = x[l];
        break;
      }
      case SF_CONSTANT: {
        const double x = tape->constant[step->a];
        EACH r[l] = x;
        break;
      }
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
      UNARY(SF_SIN, sf_sin(x[l]))
      UNARY(SF_COS, sf_cos(x[l]))
      UNARY(SF_TAN, sf_tan(x[l]))
      UNARY(SF_ASIN, sf_asin(x[l]))
      UNARY(SF_ACOS, sf_acos(x[l]))
      UNARY(SF_ATAN, sf_atan(x[l]))
      BINARY(SF_ATAN2, sf_atan2(x[l], y[l]))
      UNARY(SF_EXP, sf_exp(x[l]))
      UNARY(SF_LOG, sf_log(x[l]))
      UNARY(SF_EXPM1, sf_expm1(x[l]))
      UNARY(SF_LOG1P, sf_log1p(x[l]))
      BINARY(SF_POW, sf_pow(x[l], y[l]))
      UNARY(SF_SINH, sf_sinh(x[l]))
      UNARY(SF_COSH, sf_cosh(x[l]))
      UNARY(SF_TANH, sf_tanh(x[l]))
      UNARY(SF_ASINH, sf_asinh(x[l]))
      UNARY(SF_ACOSH, sf_acosh(x[l]))
      UNARY(SF_ATANH, sf_atanh(x[l]))
      UNARY(SF_ERF, sf_erf(x[l]))
      BINARY(SF_HYPOT, sf_hypot(x[l], y[l]))
      UNARY(SF_FABS, fabs(x[l]))
      UNARY(SF_SIGN, x[l] < 0.0 ? -1.0 : x[l] > 0.0 ? 1.0 : x[l])
      BINARY(SF_COPYSIGN, copysign(x[l], y[l]))
      BINARY(SF_FMIN, x[l] < y[l] || y[l] != y[l] ? x[l] : y[l])
      BINARY(SF_FMAX, x[l] > y[l] || y[l] != y[l] ? x[l] : y[l])
      BINARY(SF_FMOD, fmod(x[l], y[l]))
      BINARY(SF_REMAINDER, remainder(x[l], y[l]))
      UNARY(SF_FLOOR, floor(x[l]))
      UNARY(SF_CEIL, ceil(x[l]))
      BINARY(SF_LT, x[l] < y[l] ? 1.0 : 0.0)
      BINARY(SF_LE, x[l] <= y[l] ? 1.0 : 0.0)
      BINARY(SF_EQ, x[l] == y[l] ? 1.0 : 0.0)
      BINARY(SF_NE, x[l] != y[l] ? 1.0 : 0.0)
      UNARY(SF_NOT, x[l] == 0.0 ? 1.0 : 0.0)
      BINARY(SF_AND, x[l] != 0.0 && y[l] != 0.0 ? 1.0 : 0.0)
      BINARY(SF_OR, x[l] != 0.0 || y[l] != 0.0 ? 1.0 : 0.0)
      BINARY(SF_IF, x[l] != 0.0 ? y[l] : 0.0)
      default:
        EACH r[l] = NAN;
    }
  }
}

#undef EACH
#undef UNARY
#undef BINARY
