/* Functions of terms as lists of operations, run for several terms at once.
 *
 * Each operation is a loop over lanes, which hold the numbers of terms beside each other: compilers make vector
 * instructions of these loops.  No lane knows of another, so that a term has the same bits in any of them.  Operations
 * of one kind stand together as far as what they need allows: processors guess wrongly which kind comes next.
 */

#include <math.h>
#include <stddef.h>

#include "core.h"
#include "elementary.h"

enum {
  SF_IN, SF_OUT, SF_CONSTANT, SF_ASSIGN, SF_ADD, SF_SUB, SF_MUL, SF_DIV, SF_NEG, SF_SQ, SF_TWICE, SF_SQRT, SF_INV,
  SF_SIN, SF_COS, SF_TAN, SF_ASIN, SF_ACOS, SF_ATAN, SF_ATAN2, SF_EXP, SF_LOG, SF_EXPM1, SF_LOG1P, SF_POW,
  SF_SINH, SF_COSH, SF_TANH, SF_ASINH, SF_ACOSH, SF_ATANH, SF_ERF, SF_HYPOT, SF_FABS, SF_SIGN, SF_COPYSIGN, SF_FMIN,
  SF_FMAX, SF_FMOD, SF_REMAINDER, SF_FLOOR, SF_CEIL, SF_LT, SF_LE, SF_EQ, SF_NE, SF_NOT, SF_AND, SF_OR, SF_IF,
  SF_SPLINE, SF_OPERATIONS
};

/* What is no single instruction, or seldom done. */
static double sf_other(int operation, double x, double y) {
  switch (operation) {
    case SF_SIN: return sf_sin(x);
    case SF_COS: return sf_cos(x);
    case SF_TAN: return sf_tan(x);
    case SF_ASIN: return sf_asin(x);
    case SF_ACOS: return sf_acos(x);
    case SF_ATAN: return sf_atan(x);
    case SF_ATAN2: return sf_atan2(x, y);
    case SF_EXP: return sf_exp(x);
    case SF_LOG: return sf_log(x);
    case SF_EXPM1: return sf_expm1(x);
    case SF_LOG1P: return sf_log1p(x);
    case SF_POW: return sf_pow(x, y);
    case SF_SINH: return sf_sinh(x);
    case SF_COSH: return sf_cosh(x);
    case SF_TANH: return sf_tanh(x);
    case SF_ASINH: return sf_asinh(x);
    case SF_ACOSH: return sf_acosh(x);
    case SF_ATANH: return sf_atanh(x);
    case SF_ERF: return sf_erf(x);
    case SF_HYPOT: return sf_hypot(x, y);
    case SF_SIGN: return x < 0.0 ? -1.0 : x > 0.0 ? 1.0 : x;
    case SF_COPYSIGN: return copysign(x, y);
    case SF_FMIN: return x < y || y != y ? x : y;
    case SF_FMAX: return x > y || y != y ? x : y;
    case SF_FMOD: return fmod(x, y);
    case SF_REMAINDER: return remainder(x, y);
    case SF_FLOOR: return floor(x);
    case SF_CEIL: return ceil(x);
    case SF_LT: return x < y ? 1.0 : 0.0;
    case SF_LE: return x <= y ? 1.0 : 0.0;
    case SF_EQ: return x == y ? 1.0 : 0.0;
    case SF_NE: return x != y ? 1.0 : 0.0;
    case SF_NOT: return x == 0.0 ? 1.0 : 0.0;
    case SF_AND: return x != 0.0 && y != 0.0 ? 1.0 : 0.0;
    case SF_OR: return x != 0.0 || y != 0.0 ? 1.0 : 0.0;
    case SF_IF: return x != 0.0 ? y : 0.0;
    default: return NAN;
  }
}

/* The interval of knots, of n cubic splines, that x is in; beyond them the last one on that side. */
static int sf_interval(int n, const double *knot, double x) {
  int low = 3, high = n;
  while (high - low > 1) {
    int middle = (low + high) / 2;
    if (x < knot[middle])
      high = middle;
    else
      low = middle;
  }
  return low;
}

/* The splines of a degree that are not zero at x between t[0] and t[1], from the first on (Cox, de Boor). */
static void sf_basis(const double *t, double x, int degree, double *value) {
  int d, j;
  value[0] = 1.0;
  for (d = 1; d <= degree; ++d) {
    double last = 0.0;
    for (j = 0; j < d; ++j) {
      const double left = t[j + 1 - d], right = t[j + 1], share = value[j] / (right - left);
      value[j] = last + (right - x) * share;
      last = (x - left) * share;
    }
    value[d] = last;
  }
}

/* Coefficients of the derivative of an order along one axis, in place of four cubic ones each, which stand apart by a
 * step among size of them.  Differences of coefficients keep the digits of what varies little. */
static void sf_differentiate(double *value, int size, int step, const double *t, int order) {
  int degree, j, a, b;
  for (degree = 3; degree > 3 - order; --degree)
    for (j = 0; j < degree; ++j) {
      const double share = degree / (t[j + 1] - t[j + 1 - degree]);
      for (a = j * step; a < size; a += 4 * step)
        for (b = a; b < a + step; ++b) value[b] = share * (value[b + step] - value[b]);
    }
}

/* A component of a derivative of a spline at a place, whose coordinates stand apart by a stride.
 *
 * what: where in tape->spline the spline is, component, orders along each axis, at most three.  The spline: axes,
 * components, coefficients along each axis, and where its knots begin among the constants; its coefficients follow them.
 */
static double sf_look_up(const sf_tape *tape, const int *what, const double *place, int stride) {
  const int *shape = tape->spline + what[0], axes = shape[0], components = shape[1];
  const double *number = tape->constant + shape[2 + axes], *t[3] = {0, 0, 0};
  double basis[3][4] = {{1.0}, {1.0}, {1.0}}, value[64], sum = 0.0;
  int first[3] = {0, 0, 0}, many[3] = {1, 1, 1}, width[3] = {1, 1, 1}, size = 1, i, j, k;
  for (i = 0; i < axes; ++i) {
    const double x = place[(ptrdiff_t)i * stride];
    const int low = sf_interval(shape[2 + i], number, x);
    width[i] = shape[2 + i];
    first[i] = low - 3;
    t[i] = number + low;
    sf_basis(t[i], x, 3 - what[2 + i], basis[i]);
    number += width[i] + 4;
    many[i] = 4;
    size *= 4;
  }
  for (k = 0; k < many[2]; ++k)
    for (j = 0; j < many[1]; ++j)
      for (i = 0; i < many[0]; ++i) {
        const ptrdiff_t at = ((ptrdiff_t)(first[2] + k) * width[1] + first[1] + j) * width[0] + first[0] + i;
        value[(4 * k + j) * 4 + i] = number[at * components + what[1]];
      }
  for (i = 0, j = 1; i < axes; ++i, j *= 4) {
    sf_differentiate(value, size, j, t[i], what[2 + i]);
    many[i] = 4 - what[2 + i];
  }
  for (k = 0; k < many[2]; ++k)
    for (j = 0; j < many[1]; ++j)
      for (i = 0; i < many[0]; ++i) sum += basis[2][k] * basis[1][j] * basis[0][i] * value[(4 * k + j) * 4 + i];
  return sum;
}

#define NAME sf_one
#define LANES 1
#define SF_WIDE
#include "lanes.h"
#undef NAME
#undef LANES
#undef SF_WIDE
/* Wider vector instructions where the processor has them: the same operations, and the same bits. */
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_THREAD__)
#define SF_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define SF_WIDE
#endif
#define NAME sf_eight
#define LANES 8
#include "lanes.h"
#undef NAME
#undef LANES

#define SF_WINDOW 800 /* operations among which those of one kind are looked for; with more they take more slots */

/* The operations of a tape, (operations, 4) numbers: kind, to, a, b, in an order in which those of a kind stand together.
 *
 * Of those that may come next, within a window, the most frequent kind is taken.  memory: 9 operations + slots + 1
 * numbers; *needed: how many slots the order takes.  Returns the number of stretches.
 */
int sf_arrange(int operations, const int *code, sf_stretch *stretch, sf_operation *arranged, int *memory, int *needed) {
  int n = operations, *a = memory, *b = a + n, *begin = b + n, *after = begin + n + 1, *waits = after + 2 * n;
  int *uses = waits + n, *slot = uses + n, *unused = slot + n, *last = unused + n;
  int i, k, first = 0, made = 0, frees = 0, total = 0;
  for (i = 0; i <= n; ++i) begin[i] = 0;
  for (i = 0; i < n; ++i) {
    const int *one = code + 4 * (size_t)i;
    /* What gave the numbers that it takes. */
    a[i] = one[0] == SF_IN || one[0] == SF_CONSTANT ? -1 : last[one[2]];
    b[i] = one[0] == SF_IN || one[0] == SF_CONSTANT || one[0] == SF_OUT ? -1 : last[one[3]];
    if (one[0] != SF_OUT) last[one[1]] = i;
    waits[i] = (a[i] >= 0) + (b[i] >= 0);
    uses[i] = 0;
    if (a[i] >= 0) ++begin[a[i] + 1];
    if (b[i] >= 0) ++begin[b[i] + 1];
  }
  for (i = 0; i < n; ++i) begin[i + 1] += begin[i];
  for (i = 0; i < n; ++i) {
    if (a[i] >= 0) after[begin[a[i]] + uses[a[i]]++] = i;
    if (b[i] >= 0) after[begin[b[i]] + uses[b[i]]++] = i;
  }
  *needed = 0;
  while (total < n) {
    int ready[SF_OPERATIONS] = {0}, kind = 0, end;
    /* Done are those that wait for less than nothing. */
    while (waits[first] < 0) ++first;
    end = n - first < SF_WINDOW ? n : first + SF_WINDOW;
    for (i = first; i < end; ++i)
      if (waits[i] == 0) ++ready[code[4 * (size_t)i]];
    for (k = 1; k < SF_OPERATIONS; ++k)
      if (ready[k] > ready[kind]) kind = k;
    stretch[made].operation = kind;
    stretch[made].count = total;
    for (i = first; i < end; ++i) {
      const int *one = code + 4 * (size_t)i;
      if (waits[i] || one[0] != kind) continue;
      waits[i] = -1;
      arranged[total].a = a[i] >= 0 ? slot[a[i]] : one[2];
      arranged[total].b = b[i] >= 0 ? slot[b[i]] : 0;
      if (a[i] >= 0 && !--uses[a[i]]) unused[frees++] = slot[a[i]];
      if (b[i] >= 0 && !--uses[b[i]]) unused[frees++] = slot[b[i]];
      slot[i] = one[1];
      if (kind != SF_OUT) slot[i] = frees ? unused[--frees] : (*needed)++;
      arranged[total++].to = slot[i];
      for (k = begin[i]; k < begin[i + 1]; ++k) --waits[after[k]];
    }
    stretch[made].count = total - stretch[made].count;
    ++made;
  }
  return made;
}

/* Lanes for what is left to do. */
static int sf_lanes(const sf_tape *tape, int left) { return left > 1 && !tape->compiled ? 8 : 1; }

static void sf_lanes_run(int lanes, const sf_tape *tape, const double *in, double *out, int left, double *w) {
  if (tape->compiled)
    tape->compiled(in, out);
  else if (lanes == 8)
    sf_eight(tape, in, out, left, w);
  else
    sf_one(tape, in, out, left, w);
}

/* Numbers that running a tape takes: slots and arguments of eight lanes. */
int sf_tape_work(const sf_tape *tape) { return 8 * (tape->slots + tape->arguments); }

/* The results (count, results) of terms with arguments (count, arguments). */
int sf_run(const sf_tape *tape, int count, const double *arguments, double *results, double *work) {
  int first, lanes, l, k;
  for (first = 0; first < count; first += lanes) {
    int left = count - first;
    double *in = work + (size_t)8 * tape->slots;
    lanes = sf_lanes(tape, left);
    left = left < lanes ? left : lanes;
    for (l = 0; l < lanes; ++l) {
      /* Lanes without a term repeat the last one: what they give is not looked at. */
      const double *x = arguments + (size_t)(first + (l < left ? l : left - 1)) * tape->arguments;
      for (k = 0; k < tape->arguments; ++k) in[(size_t)k * lanes + l] = x[k];
    }
    sf_lanes_run(lanes, tape, in, results + (size_t)first * tape->results, left, work);
  }
  return 0;
}
