/* Functions of terms as lists of operations, run for several terms at once.
 *
 * Each operation is a loop over lanes, which hold the numbers of terms beside each other: what choosing an operation
 * costs is shared by them, and compilers make vector instructions of the loops.  No lane knows of another, so that a
 * term has the same bits in any of them.
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
  SF_OPERATIONS
};

#define NAME sf_one
#define LANES 1
#include "lanes.h"
#undef NAME
#undef LANES
#define NAME sf_four
#define LANES 4
#include "lanes.h"
#undef NAME
#undef LANES
#define NAME sf_eight
#define LANES 8
#include "lanes.h"
#undef NAME
#undef LANES

/* Lanes for what is left to do: the fewest that take it at once. */
static int sf_lanes(int left) { return left >= 8 || left > 4 ? 8 : left > 1 ? 4 : 1; }

static void sf_lanes_run(int lanes, const sf_tape *tape, const double *in, double *out, int left, double *w) {
  if (lanes == 8)
    sf_eight(tape, in, out, left, w);
  else if (lanes == 4)
    sf_four(tape, in, out, left, w);
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
    lanes = sf_lanes(left);
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
