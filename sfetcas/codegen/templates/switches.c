/* ---- strings and stops: which of them act ---- */

/* What acts at an equilibrium: what has a force and no opening. */
static void sf_acting(const double *state, double *acting) {
  int i;
  for (i = 0; i < SF_SWITCHES; ++i)
    acting[i] = fabs(state[sf_multiplier_of[i]]) > fabs(state[sf_opening_of[i]]) ? 1.0 : 0.0;
}

static void sf_switch(double *given, const double *acting) {
  int i;
  for (i = 0; i < SF_SWITCHES; ++i) given[sf_flag_of[i]] = acting[i];
}

static void sf_switch_as(double *given, const double *state) {
  double acting[SF_SWITCHES];
  sf_acting(state, acting);
  sf_switch(given, acting);
}

/* The constraint that is wrong the most, strings first, what acts first; -1: none. */
static int sf_worst(@name@_memory *m, const double *state, const double *acting) {
  int i, strings, active;
  for (strings = 1; strings >= 0; --strings)
    for (active = 1; active >= 0; --active) {
      double most = 0.0;
      for (i = 0; i < SF_SWITCHES; ++i) {
        int now = acting[i] != 0.0;
        double margin = (now ? state[sf_multiplier_of[i]] : -state[sf_opening_of[i]]) * sf_sign_of[i];
        m->margins[i] = sf_string[i] == strings && now == active && margin < 0.0 ? -margin : 0.0;
        if (m->margins[i] > most) most = m->margins[i];
      }
      for (i = 0; most > SF_BEYOND && i < SF_SWITCHES; ++i)
        if (m->margins[i] >= (1.0 - SF_ALIKE) * most) return i;
    }
  return -1;
}
