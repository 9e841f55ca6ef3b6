/* The arguments of the terms of a group, lane by lane, and their results; included by equations.c. */

static void sf_gather(const sf_model *m, const sf_group *group, int element, int term, const sf_state *s,
                      const double *given, const sf_point *p, const sf_work *work, double *in, int lanes) {
  const double *from;
  int i, k, c = m->components, axes = m->axes;
#define PUT(value) \
  do { \
    *in = (value); \
    in += lanes; \
  } while (0)
  for (i = 0; i < group->turns; ++i) {
    int turn = group->turn[(size_t)term * group->turns + i];
    if (turn >= 0) {
      from = s->q + (size_t)turn * c;
      for (k = 0; k < c; ++k) PUT(from[k]);
    } else {
      /* The ground does not turn. */
      for (k = 0; k < c; ++k) PUT(k == 0 && m->space ? 1.0 : 0.0);
    }
  }
  for (i = 0; i < group->places; ++i) {
    int place = group->place[(size_t)term * group->places + i];
    from = p->place + (size_t)place * axes;
    for (k = 0; k < axes; ++k) PUT(place >= 0 ? from[k] : 0.0);
  }
  from = group->datum + (size_t)term * group->data;
  for (k = 0; k < group->data; ++k) PUT(from[k]);
  if (group->angle >= 0) *(in - lanes) = s->unwrapped[group->angle + term];
  from = given + group->load + (size_t)term * group->loads;
  for (k = 0; k < group->loads; ++k) PUT(from[k]);
  if (element) {
    from = work->constant + (size_t)m->owner[term] * axes;
    for (k = 0; k < axes; ++k) PUT(from[k]);
  } else {
    for (k = 0; k < group->rows; ++k) PUT(s->lam[group->row[(size_t)term * group->rows + k]]);
  }
#undef PUT
}

static void sf_terms(const sf_model *m, const sf_group *group, int element, const sf_state *s, const double *given,
                     sf_point *p, const sf_work *work) {
  const sf_tape *tape = group->tape;
  int first, lanes, l;
  for (first = 0; first < group->terms; first += lanes) {
    int left = group->terms - first;
    lanes = sf_lanes(tape, left);
    left = left < lanes ? left : lanes;
    for (l = 0; l < lanes; ++l)
      sf_gather(m, group, element, first + (l < left ? l : left - 1), s, given, p, work, work->in + l, lanes);
    sf_lanes_run(lanes, tape, work->in, p->result + group->result + (size_t)first * tape->results, left, work->slots);
  }
}
