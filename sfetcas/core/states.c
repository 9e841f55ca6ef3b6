/* States: rotations by vectors about the fixed axes, displacements, and angles that count turns. */

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"
#include "elementary.h"

#define SF_TINY 1e-300
#define SF_PI 3.14159265358979323846

/* Numbers of a state, and where its parts are among so many. */
static int sf_state_size(const sf_model *m) {
  return m->components * m->rotations + m->displacements + m->rows + m->angles;
}

static void sf_lay_out(const sf_model *m, double *numbers, sf_state *state) {
  state->q = numbers;
  state->y = state->q + m->components * m->rotations;
  state->lam = state->y + m->displacements;
  state->unwrapped = state->lam + m->rows;
}

static void sf_copy(double *to, const double *from, int n) {
  if (n > 0) memcpy(to, from, (size_t)n * sizeof(double));
}

static int sf_is_finite(double x) { return x - x == 0.0; }

static int sf_all_finite(const double *x, int n) {
  int i;
  for (i = 0; i < n; ++i)
    if (!sf_is_finite(x[i])) return 0;
  return 1;
}

static void sf_copy_state(const sf_model *m, const sf_state *from, sf_state *to) {
  sf_copy(to->q, from->q, m->components * m->rotations);
  sf_copy(to->y, from->y, m->displacements);
  sf_copy(to->lam, from->lam, m->rows);
  sf_copy(to->unwrapped, from->unwrapped, m->angles);
}

static void sf_product(const double *a, const double *b, double *c) {
  c[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  c[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  c[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  c[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

static double sf_dot3(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void sf_cross(const double *a, const double *b, double *c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

static void sf_rotated(const double *q, const double *v, double *r) {
  double t[3], u[3];
  int i;
  sf_cross(q + 1, v, t);
  for (i = 0; i < 3; ++i) t[i] *= 2.0;
  sf_cross(q + 1, t, u);
  for (i = 0; i < 3; ++i) r[i] = v[i] + q[0] * t[i] + u[i];
}

/* The unit quaternion of a rotation by a vector. */
static void sf_turned(const double *v, double *q) {
  double angle = sqrt(sf_dot3(v, v)), half = 0.5 * angle;
  /* sin(x / 2) / x to rounding for small x, too. */
  double share = angle > 1e-8 ? sf_sin(half) / angle : 0.5;
  q[0] = sf_cos(half);
  q[1] = share * v[0];
  q[2] = share * v[1];
  q[3] = share * v[2];
}

static const double *sf_side(const double *q, int number) {
  static const double ground[4] = {1.0, 0.0, 0.0, 0.0};
  return number < 0 ? ground : q + (size_t)4 * number;
}

/* Of all values of an angle with the same rotation the one nearest to a value. */
static double sf_counted(const sf_model *m, int i, const double *q, double near) {
  const double *counted = m->counted + (size_t)i * 8;
  const int *counting = m->counting + (size_t)i * 3;
  const double *a = sf_side(q, counting[0]), *b = sf_side(q, counting[1]);
  double conjugate[4], relative[4], sine, cosine, share = counted[6], raw, period;
  conjugate[0] = a[0];
  conjugate[1] = -a[1];
  conjugate[2] = -a[2];
  conjugate[3] = -a[3];
  sf_product(conjugate, b, relative);
  if (counting[2]) {
    double seen[3], beside[3];
    sf_rotated(relative, counted + 3, seen);
    sf_cross(counted, counted + 3, beside);
    sine = sf_dot3(beside, seen);
    cosine = sf_dot3(counted + 3, seen);
  } else {
    sine = sf_dot3(counted, relative + 1);
    cosine = relative[0];
  }
  raw = share * sf_atan2(sine, cosine);
  period = 2.0 * SF_PI * share;
  return raw + period * nearbyint((near - raw) / period);
}

/* The state after a share of an increment of all unknowns and multipliers. */
int sf_move(const sf_model *m, const sf_state *from, const double *step, double share, sf_state *to) {
  int i, k;
  for (i = 0; i < m->angles; ++i) {
    /* Of the angles first how far they turn from where they are. */
    const int *counting = m->counting + (size_t)i * 3;
    double turn[3] = {0.0, 0.0, 0.0}, axis[3];
    int side;
    for (side = 0; side < 2; ++side)
      if (counting[side] >= 0)
        for (k = 0; k < 3; ++k) {
          int unknown = m->unknown[counting[side] * 3 + k];
          double by = unknown < 0 ? 0.0 : share * step[unknown] * m->share[counting[side] * 3 + k];
          turn[k] += side ? by : -by;
        }
    sf_rotated(sf_side(from->q, counting[0]), m->counted + (size_t)i * 8, axis);
    to->unwrapped[i] = sf_counted(m, i, from->q, from->unwrapped[i]) + sf_dot3(axis, turn);
  }
  for (i = 0; i < m->rotations; ++i) {
    double turn[3] = {0.0, 0.0, 0.0}, by[4], q[4], size;
    for (k = 0; k < m->turning; ++k) {
      int unknown = m->unknown[i * m->turning + k];
      if (unknown >= 0) turn[k] = share * step[unknown] * m->share[i * m->turning + k];
    }
    if (!m->space) {
      to->q[i] = from->q[i] + turn[0];
      continue;
    }
    sf_turned(turn, by);
    sf_product(by, from->q + (size_t)4 * i, q);
    size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (k = 0; k < 4; ++k) to->q[(size_t)4 * i + k] = q[k] / size;
  }
  for (i = 0; i < m->displacements; ++i) to->y[i] = from->y[i] + share * step[m->rotation_unknowns + i];
  for (i = 0; i < m->rows; ++i) to->lam[i] = from->lam[i] + share * step[m->unknowns + i];
  for (i = 0; i < m->angles; ++i) to->unwrapped[i] = sf_counted(m, i, to->q, to->unwrapped[i]);
  return 0;
}

/* Rotations at their prescribed values, by vectors. */
static void sf_prescribe(const sf_model *m, int turning, const int *turned, const double *vector, sf_state *state) {
  int i;
  for (i = 0; i < turning; ++i, vector += 3)
    if (m->space)
      sf_turned(vector, state->q + (size_t)4 * turned[i]);
    else
      state->q[turned[i]] = vector[2];
}
