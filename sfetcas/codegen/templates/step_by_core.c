/* ---- the step: tables for the core, and what they are made of ---- */

static int sf_advanced(@name@_memory *m, double h, const double *arguments, const double *state) {
  sf_model model = sf_the_model;
  sf_motion motion = sf_the_motion;
  sf_flat flat = sf_the_flat;
  sf_group groups[SF_GROUPS], further[SF_GROUPS], turning = sf_the_turning;
  double *data[SF_VARYING + 1], *numbers = m->numbers, *inputs;
  int *whole = m->whole, i, broken;
  sf_factors factors;
  sf_pivoted pivoted;
  sf_system system;
  sf_point point;
  sf_advance_of step;
  for (i = 0; i < SF_GROUPS; ++i) {
    groups[i] = sf_groups[i];
    further[i] = sf_further[i];
  }
  turning.datum = groups[0].datum;
  for (i = 0; i < SF_VARYING; ++i) {
    data[i] = sf_numbers(&numbers, (size_t)(motion.stages * sf_counts[i]));
    groups[sf_varying[i]].datum = further[sf_varying[i]].datum = data[i];
    if (!sf_varying[i]) turning.datum = data[i];
  }
  model.group = groups;
  motion.rows = further;
  motion.turning = &turning;
  flat.datum = data;
  inputs = sf_numbers(&numbers, (size_t)(motion.stages * SF_INPUTS));
  for (i = 0; i < motion.stages; ++i) {
    m->arg[0] = arguments + i * @NAME@_ARGUMENTS;
    m->res[0] = inputs + i * SF_INPUTS;
    if (@name@_inputs(m->arg, m->res, m->iw, m->w, 0)) return 1;
  }
  sf_lend_point(&model, SF_RESULTS, &point, &numbers);
  point.residual = sf_numbers(&numbers, SF_TOTAL);
  point.scale = point.entries = 0;
  sf_lend(&factors, &pivoted, &numbers, &whole);
  factors.entries = SF_ENTRIES;
  system.factors = &factors;
  system.pivoted = &pivoted;
  system.soft = 0;
  system.symmetric = system.lost = system.often = 0;
  system.solved = SF_SOLVED_TO;
  step.iterations = 0;
  step.size = step.gap = NAN;
  broken =
      sf_take_step(&model, &motion, &flat, &system, h / SF_TIME, inputs, state, m->after, &point, numbers, &step);
  m->size = step.size;
  m->gap = step.gap;
  m->iterations = step.iterations;
  return broken;
}

