/* All of the core as one unit. */

#include "tape.c"
#include "states.c"
#include "equations.c"
#include "factors.c"
#include "newton.c"
#include "follow.c"
#include "afar.c"
#include "trace.c"
#include "lowest.c"
#include "motion.c"
#include "pivots.c"

int sf_version(void) { return SF_VERSION; }

/* Sizes of what is handed over, by which a program finds that it was made for another core. */
int sf_sizes(int *sizes) {
  sizes[0] = (int)sizeof(sf_operation);
  sizes[1] = (int)sizeof(sf_tape);
  sizes[2] = (int)sizeof(sf_group);
  sizes[3] = (int)sizeof(sf_model);
  sizes[4] = (int)sizeof(sf_point);
  sizes[5] = (int)sizeof(sf_factors);
  sizes[6] = (int)sizeof(sf_pivoted);
  sizes[7] = (int)sizeof(sf_system);
  sizes[8] = (int)sizeof(sf_limits);
  sizes[9] = (int)sizeof(sf_border);
  sizes[10] = (int)sizeof(sf_report);
  sizes[11] = (int)sizeof(sf_count_of);
  sizes[12] = (int)sizeof(sf_way);
  sizes[13] = (int)sizeof(sf_cases);
  sizes[14] = (int)sizeof(sf_rules);
  sizes[15] = (int)sizeof(sf_sought);
  sizes[16] = (int)sizeof(sf_inputs);
  sizes[17] = (int)sizeof(sf_curve);
  sizes[18] = (int)sizeof(sf_told_of);
  sizes[19] = (int)sizeof(sf_stretch);
  sizes[20] = (int)sizeof(sf_observables);
  sizes[21] = (int)sizeof(sf_motion);
  sizes[22] = (int)sizeof(sf_advance_of);
  sizes[23] = (int)sizeof(sf_flat);
  sizes[24] = SF_OPERATIONS;
  return 0;
}
