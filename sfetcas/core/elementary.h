/* Elementary functions with the same bits on every machine; those of math libraries differ by last digits.
 *
 * Arguments are reduced in parts that products are exact with, and what is left goes into series long enough that the
 * next term is below rounding.  Sine, cosine, exponential, logarithm and arc tangent are right to a last digit, what is
 * made of them to a few.  Included by what needs them; only operations that IEEE prescribes are used: sqrt, fmod,
 * remainder, floor, ceil, nearbyint, ldexp and frexp are exact or rounded once.
 */

#ifndef SFETCAS_ELEMENTARY_H
#define SFETCAS_ELEMENTARY_H

#include <math.h>

/* Half of pi in four parts, the first three of 27 bits, and the number of quarters of a turn that they are exact with. */
#define SF_QUARTER_1 1.570796325802803
#define SF_QUARTER_2 9.920935739593517e-10
#define SF_QUARTER_3 5.721188709663575e-18
#define SF_QUARTER_4 1.6446256936324258e-26
#define SF_QUARTERS 6.7e7
#define SF_LN2_1 0.6931471803691238
#define SF_LN2_2 1.9082149292705877e-10

static double sf_series_sin(double x, double below) {
  double z = x * x, sum;
  sum = -1.0 / 1307674368000.0 * z + 1.0 / 6227020800.0;
  sum = sum * z - 1.0 / 39916800.0;
  sum = sum * z + 1.0 / 362880.0;
  sum = sum * z - 1.0 / 5040.0;
  sum = sum * z + 1.0 / 120.0;
  sum = sum * z - 1.0 / 6.0;
  return x + (x * z * sum + below * (1.0 - 0.5 * z));
}

static double sf_series_cos(double x, double below) {
  double z = x * x, sum, half = 0.5 * z, first = 1.0 - half;
  sum = 1.0 / 20922789888000.0 * z - 1.0 / 87178291200.0;
  sum = sum * z + 1.0 / 479001600.0;
  sum = sum * z - 1.0 / 3628800.0;
  sum = sum * z + 1.0 / 40320.0;
  sum = sum * z - 1.0 / 720.0;
  sum = sum * z + 1.0 / 24.0;
  return first + (((1.0 - first) - half) + (z * z * sum - x * below));
}

/* An angle less whole quarters of a turn, in two parts, and how many these are, up to whole turns.
 *
 * Beyond 1e8 rad, where neighbouring numbers are 1e-8 apart, whole turns are taken off as a number that is rounded.
 */
static int sf_reduced(double x, double *rest, double *below) {
  double k, a, b, c;
  if (fabs(x) <= 0.78) {
    *rest = x;
    *below = 0.0;
    return 0;
  }
  if (!(fabs(x) < SF_QUARTERS * SF_QUARTER_1)) x = fmod(x, 4.0 * SF_QUARTER_1);
  k = nearbyint(x / SF_QUARTER_1);
  a = x - k * SF_QUARTER_1;
  b = k * SF_QUARTER_2;
  c = a - b;
  *below = ((a - c) - b) - (k * SF_QUARTER_3 + k * SF_QUARTER_4);
  *rest = c + *below;
  *below = (c - *rest) + *below;
  return (int)(k - 4.0 * floor(0.25 * k));
}

/* The sine of an angle and a number of quarters of a turn. */
static double sf_sine(double x, int ahead) {
  double rest, below;
  if (!(x - x == 0.0)) return NAN;
  switch ((sf_reduced(x, &rest, &below) + ahead) % 4) {
    case 0: return sf_series_sin(rest, below);
    case 1: return sf_series_cos(rest, below);
    case 2: return -sf_series_sin(rest, below);
    default: return -sf_series_cos(rest, below);
  }
}

static double sf_sin(double x) { return sf_sine(x, 0); }

static double sf_cos(double x) { return sf_sine(x, 1); }

static double sf_tan(double x) { return sf_sin(x) / sf_cos(x); }

/* exp(x) - 1 for |x| < 0.36. */
static double sf_series_exp(double x) {
  double sum = 1.0 / 87178291200.0;
  int n;
  static const double share[] = {1.0 / 6227020800.0, 1.0 / 479001600.0, 1.0 / 39916800.0, 1.0 / 3628800.0,
                                 1.0 / 362880.0,     1.0 / 40320.0,     1.0 / 5040.0,     1.0 / 720.0,
                                 1.0 / 120.0,        1.0 / 24.0,        1.0 / 6.0,        0.5};
  for (n = 0; n < 12; ++n) sum = sum * x + share[n];
  return x + x * x * sum;
}

static double sf_exp(double x) {
  double k, high, low, rest;
  if (x != x) return x;
  if (x > 709.8) return HUGE_VAL;
  if (x < -745.2) return 0.0;
  k = nearbyint(x / SF_LN2_1);
  high = x - k * SF_LN2_1;
  low = k * SF_LN2_2;
  rest = high - low;
  low = (high - rest) - low;
  return ldexp(1.0 + (sf_series_exp(rest) + low), (int)k);
}

static double sf_log(double x) {
  double s, z, sum, f, half;
  int power, n;
  if (x != x || x < 0.0) return NAN;
  if (x == 0.0) return -HUGE_VAL;
  if (x > 1.7976931348623157e308) return x;
  x = frexp(x, &power);
  if (x < 0.70710678118654752) {
    x *= 2.0;
    --power;
  }
  /* 2 artanh(s) = f - f^2 / 2 + s (f^2 / 2 + s^2 ...) */
  f = x - 1.0;
  s = f / (2.0 + f);
  z = s * s;
  half = 0.5 * f * f;
  sum = 2.0 / 23.0;
  for (n = 21; n >= 3; n -= 2) sum = sum * z + 2.0 / n;
  return power * SF_LN2_1 - ((half - (s * (half + z * sum) + power * SF_LN2_2)) - f);
}

static double sf_expm1(double x) {
  if (fabs(x) < 0.34) return sf_series_exp(x);
  return sf_exp(x) - 1.0;
}

static double sf_log1p(double x) {
  double above = 1.0 + x;
  if (above == 1.0) return x;
  if (!(above > 0.0) || above > 1e300) return sf_log(above);
  return sf_log(above) * (x / (above - 1.0));
}

static double sf_atan(double x) {
  static const double high[] = {0.0, 0.12435499454676144, 0.24497866312686414, 0.35877067027057225, 0.4636476090008061,
                                0.5585993153435624, 0.6435011087932844, 0.7188299996216245, 0.7853981633974483};
  static const double low[] = {0.0, -3.1253241424539383e-18, 1.0698755618734451e-17, -2.4623815582638635e-17,
                               2.2698777452961687e-17, -5.4556305485916264e-18, 1.5834785051444286e-17,
                               -2.1478388444456983e-17, 3.061616997868383e-17};
  double size = fabs(x), t, z, sum, near;
  int i, inverse = size > 1.0;
  if (x != x) return x;
  if (inverse) size = 1.0 / size;
  i = (int)(8.0 * size + 0.5);
  near = 0.125 * i;
  t = (size - near) / (1.0 + size * near);
  z = t * t;
  sum = 1.0 / 13.0;
  sum = sum * z - 1.0 / 11.0;
  sum = sum * z + 1.0 / 9.0;
  sum = sum * z - 1.0 / 7.0;
  sum = sum * z + 1.0 / 5.0;
  sum = sum * z - 1.0 / 3.0;
  sum = high[i] + (t + (t * z * sum + low[i]));
  if (inverse) sum = 1.5707963267948966 - (sum - 6.123233995736766e-17);
  return copysign(sum, x);
}

static double sf_atan2(double y, double x) {
  double sum;
  if (y != y || x != x) return NAN;
  if (y == 0.0) return copysign(1.0, x) > 0.0 ? y : copysign(3.141592653589793, y);
  if (x == 0.0) return copysign(1.5707963267948966, y);
  if (!(x - x == 0.0) && !(y - y == 0.0)) {
    x = copysign(1.0, x);
    y = copysign(1.0, y);
  }
  sum = sf_atan(fabs(y / x));
  if (x < 0.0) sum = 3.141592653589793 - (sum - 1.2246467991473532e-16);
  return copysign(sum, y);
}

static double sf_asin(double x) {
  return fabs(x) <= 1.0 ? sf_atan2(x, sqrt((1.0 - x) * (1.0 + x))) : NAN;
}

static double sf_acos(double x) {
  return fabs(x) <= 1.0 ? sf_atan2(sqrt((1.0 - x) * (1.0 + x)), x) : NAN;
}

static double sf_sinh(double x) {
  double more = sf_expm1(fabs(x)), sum;
  if (fabs(x) > 709.0) {
    more = sf_exp(0.5 * fabs(x));
    return copysign(0.5 * more * more, x);
  }
  sum = 0.5 * (more + more / (more + 1.0));
  return x != x ? x : copysign(sum, x);
}

static double sf_cosh(double x) {
  double more = sf_exp(fabs(x));
  if (fabs(x) > 709.0) {
    more = sf_exp(0.5 * fabs(x));
    return 0.5 * more * more;
  }
  return 0.5 * (more + 1.0 / more);
}

static double sf_tanh(double x) {
  double more;
  if (fabs(x) > 20.0) return copysign(1.0, x);
  more = sf_expm1(2.0 * fabs(x));
  return x != x ? x : copysign(more / (more + 2.0), x);
}

static double sf_asinh(double x) {
  double size = fabs(x), sum;
  sum = size > 1e150 ? sf_log(size) + SF_LN2_1 + SF_LN2_2
                     : sf_log1p(size + size * size / (1.0 + sqrt(1.0 + size * size)));
  return x != x ? x : copysign(sum, x);
}

static double sf_acosh(double x) {
  double more = x - 1.0;
  if (!(x >= 1.0)) return NAN;
  return x > 1e150 ? sf_log(x) + SF_LN2_1 + SF_LN2_2 : sf_log1p(more + sqrt(more * (2.0 + more)));
}

static double sf_atanh(double x) {
  double size = fabs(x);
  if (!(size <= 1.0)) return NAN;
  return copysign(0.5 * sf_log1p(2.0 * size / (1.0 - size)), x);
}

static double sf_hypot(double x, double y) {
  double most = fabs(x), least = fabs(y), share;
  if (least > most) {
    most = fabs(y);
    least = fabs(x);
  }
  if (most == 0.0 || !(most - most == 0.0)) return most + least;
  share = least / most;
  return most * sqrt(1.0 + share * share);
}

/* Powers; of whole numbers up to 64 by products. */
static double sf_pow(double x, double y) {
  double whole = nearbyint(y), found = 1.0, power = x;
  int n, odd;
  if (y == 0.0 || x == 1.0) return 1.0;
  if (x != x || y != y) return NAN;
  if (whole == y && fabs(y) <= 64.0) {
    for (n = (int)fabs(y); n; n >>= 1) {
      if (n & 1) found *= power;
      power *= power;
    }
    return y < 0.0 ? 1.0 / found : found;
  }
  odd = whole == y && fabs(y) < 9e15 && fmod(fabs(y), 2.0) == 1.0;
  if (x < 0.0 && whole != y) return NAN;
  if (y == 0.5) return sqrt(x);
  found = sf_exp(y * sf_log(fabs(x)));
  return x < 0.0 && odd ? -found : found;
}

/* The error function, by a series of positive terms. */
static double sf_erf(double x) {
  double size = fabs(x), z = x * x, term = size, sum = size;
  int n;
  if (x != x) return x;
  if (size > 6.0) return copysign(1.0, x);
  for (n = 1; n < 200 && term > 1e-18 * sum; ++n) {
    term *= 2.0 * z / (2 * n + 1);
    sum += term;
  }
  return copysign(1.1283791670955126 * sf_exp(-z) * sum, x);
}

#endif
