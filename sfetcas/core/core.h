/* The core of sfetcas: a model given as tables is evaluated, assembled, factorised and solved.
 *
 * C99 with the math library alone.  Nothing is made for a scene: kinds of terms come as tapes, lists of operations, and
 * a model as index tables and numbers.  All sums are taken in the order of the tables, and no operations are fused, so
 * that the same tables give the same bits on any machine with IEEE arithmetic.
 *
 * Functions return 0 where they did what they say, else another number that each explains.  They keep nothing between
 * calls but what is in the structures, and change only what is not const in them.
 */

#ifndef SFETCAS_CORE_H
#define SFETCAS_CORE_H

#define SF_VERSION 9

#ifdef _WIN32
#define SF_PUBLIC __declspec(dllexport)
#else
#define SF_PUBLIC
#endif

/* ---- tapes ------------------------------------------------------------------------------------ */

/* An operation on numbers in slots; SF_IN, SF_OUT and SF_CONSTANT have the other number in a. */
typedef struct {
  int to, a, b;
} sf_operation;

/* So many operations of one kind, one after the other. */
typedef struct {
  int operation, count;
} sf_stretch;

/* A function of one term: from its arguments, one after the other, to its results, one after the other.
 *
 * Where the same operations are compiled, too, as in generated code, these are used for one term at a time.
 */
typedef struct {
  int stretches, slots, arguments, results, constants;
  const sf_stretch *stretch;
  const sf_operation *code;
  const double *constant;
  const int *spline; /* what is looked up in which spline, and their shapes, see sf_look_up */
  void (*compiled)(const double *arguments, double *results);
} sf_tape;

/* ---- sparse matrices ---------------------------------------------------------------------------- */

/* A constant matrix by its rows. */
typedef struct {
  int rows, columns;
  const int *start, *column;
  const double *value;
} sf_map;

/* Sums over places in a row of numbers, each with a weight: what the i-th number is made of. */
typedef struct {
  int count;
  const int *start, *from;
  const double *weight;
} sf_sums;

/* ---- models ------------------------------------------------------------------------------------- */

/* All terms of one kind. */
typedef struct {
  const sf_tape *tape;
  int terms, turns, places, data, loads, rows;
  const int *turn;      /* (terms, turns) rotations, -1: the ground */
  const int *place;     /* (terms, places) places, -1: the ground */
  const double *datum;  /* (terms, data) */
  int angle;            /* first of the angles that stand last in the data, -1: none */
  const int *row;       /* (terms, rows) multipliers; of elements those of a list beside, by element */
  int load, result;     /* where loads and results begin */
  int rests;            /* results before the rows: energy and stored energy */
  int gradient, jacobian; /* where these begin among the results of a term */
  int proportional;     /* whether its forces are proportional to its loads, whatever the displacements */
} sf_group;

/* A model: the equations of statics, see sfetcas/mechanics/equations.py, where the same is written in NumPy. */
typedef struct {
  int space, components, turning, axes; /* components of a rotation, of a rotation vector, of a place */
  int rotations, places, displacements, rows, closings, angles;
  int unknowns, rotation_unknowns, total;
  int elements, points, segments;
  int groups;
  const sf_group *group; /* the first are the elements */
  const int *owner;      /* (elements,) segment of each element */
  const double *weight;  /* (elements, points) */
  sf_map Y, Z, ZT, W, WT, WTa, YTa; /* WTa, YTa: magnitudes of transposes */
  /* Where what is given begins: pulls, loads of the other groups, shifts of places and of closings, what is beside the
   * terms in the residual, forces.  All of it is linear in loads and motions. */
  int given, pull, shift, opening, beside, force;
  int results; /* numbers that all terms give together, and one more: 1 */
  sf_sums entries, sides, sizes;
  const int *side_of;    /* (sides of the sums,) the element of a size, -1 */
  const double *noise;   /* (total,) */
  int retained;          /* groups of axes components that are judged together */
  const int *retain;     /* (retained, axes) unknowns */
  int sliding;
  const int *slide;      /* (sliding, 1 + axes) unknown, and multipliers of its force */
  double unloaded;
  /* States. */
  const int *unknown;       /* (rotations, turning) unknown of each component of a rotation vector, -1 */
  const double *share;      /* (rotations, turning) its weight */
  const double *counted;    /* (angles, 8): axis, across, share, 0 */
  const int *counting;      /* (angles, 3): sides, whether across is not zero */
  /* The Newton matrix. */
  int entry_count;
  const int *entry_row, *entry_column, *diagonal;
} sf_model;

/* Numbers that a state has: rotations, displacements, multipliers, angles that are counted. */
typedef struct {
  double *q, *y, *lam, *unwrapped;
} sf_state;

/* What the equations are at a state. */
typedef struct {
  double potential, stored;
  double *residual, *scale; /* (total,) */
  double *entries;          /* (entry_count,) */
  double *result;           /* (results,) of all terms */
  double *place;            /* (places, axes) displacements that terms saw */
  double *pull;             /* (elements, points, axes) whole pull */
  double *work;             /* sf_work_size(model) numbers */
} sf_point;

SF_PUBLIC int sf_version(void);
SF_PUBLIC int sf_sizes(int *sizes);
SF_PUBLIC int sf_arrange(int operations, const int *code, sf_stretch *stretch, sf_operation *arranged, int *memory,
                         int *needed);
SF_PUBLIC int sf_run(const sf_tape *tape, int count, const double *arguments, double *results, double *work);
SF_PUBLIC int sf_tape_work(const sf_tape *tape);
SF_PUBLIC int sf_work_size(const sf_model *model);
SF_PUBLIC int sf_evaluate(const sf_model *model, const sf_state *state, const double *given, sf_point *point);
SF_PUBLIC int sf_at(const sf_model *model, const sf_state *state, const double *given, sf_point *point);
SF_PUBLIC int sf_slope(const sf_model *model, const sf_state *state, const double *rate, const sf_point *point,
                       double *slope, double *results);
SF_PUBLIC int sf_move(const sf_model *model, const sf_state *from, const double *step, double share, sf_state *to);

/* ---- linear systems ------------------------------------------------------------------------------- */

/* Factors L D L^T of symmetric matrices of one pattern without pivoting, and what solving takes; see factors.c. */
typedef struct {
  int n, entries;
  const int *start, *row;    /* the whole matrix, column by column, n + 1 and entries */
  const int *order, *place;  /* (n,) the unknown that is eliminated at each place; its inverse */
  int filled;
  int *parent, *lower, *lower_row; /* (n,) tree; (n + 1,) and (filled,) L by columns */
  double *value, *pivot;           /* (filled,) and (n,) */
  int *mark, *path, *used;         /* (n,) each */
  double *column;                  /* (n,) */
  double least;                    /* the smallest pivot over what was added up for it */
} sf_factors;

/* Factors of any matrix of the pattern with pivoting, see pivoted.h; room: entries that L and U may have, each. */
typedef struct {
  int n;
  const int *start, *row, *order;
  int room;
  int *place, *row_of, *mark, *reached, *stack, *at; /* (n,) each */
  int *lower, *upper;                                /* (n + 1,) each */
  int *lower_row, *upper_row;                        /* (room,) each */
  double *lower_value, *upper_value;                 /* (room,) each */
  double *pivot, *x;                                 /* (n,) each */
  int known;                                         /* 1: pivots may serve the next matrix, 2: factors, too */
} sf_pivoted;

/* Matrices of one pattern, and how they are solved. */
typedef struct {
  sf_factors *factors;
  sf_pivoted *pivoted;
  const double *soft; /* (n,) added to the diagonal where there is no pivoting */
  int symmetric, lost, often;
  double solved;
} sf_system;

SF_PUBLIC int sf_count(sf_factors *factors);
SF_PUBLIC int sf_factorise(sf_factors *factors, const double *entries, int *negative);
SF_PUBLIC int sf_backward(const sf_factors *factors, int columns, double *x, double *work);
SF_PUBLIC int sf_solve(sf_system *system, const double *entries, int columns, const double *b, double *x,
                       double *work);

/* ---- linear complementarity ------------------------------------------------------------------------ */

SF_PUBLIC int sf_lemke(int n, double *table, int *basis, int out, int pivots, double flat, double rounding,
                       double size);

/* ---- Newton's method ------------------------------------------------------------------------------- */

/* What controls a correction: the limits, tolerances and weights of sfetcas/solvers/newton.py. */
typedef struct {
  int iterations, returns;
  int slides;                                  /* unknowns that say where on a member something slides */
  const int *slide;                            /* (slides,) */
  double most, slid, contraction, brief, turned, near; /* slid: by how much in a step; brief: short in Python */
  double converged, exact, balanced, least, epsilon, placed;
  double proximal, dual;
  const double *weight;                        /* (rotation_unknowns,) of the proximal term */
} sf_limits;

/* The factor of loads and motions as a further unknown, and the equation that keeps steps orthogonal to a direction. */
typedef struct {
  const double *begun, *rate; /* (given,) at factor 0, and by the factor */
  const double *row;          /* (total,) weighted direction */
  double unit;                /* its part along the factor */
  double apart;               /* change of the factor in differences, where not all loads act on nodes; else 0 */
  double passing;             /* relative residual that suffices where gaps are closed; 0: none */
  double factor;              /* changed */
} sf_border;

/* How a correction ended. */
typedef struct {
  int good, iterations, refused, steps;        /* steps: of how many the length is told */
  double residual, tolerance, first, second;   /* lengths of the first two steps, rad */
} sf_report;

SF_PUBLIC double sf_relative(const sf_model *model, const sf_point *point, double least);
SF_PUBLIC int sf_correct_size(const sf_model *model);
SF_PUBLIC int sf_correct(const sf_model *model, sf_system *system, const double *given, const double *tangent,
                         sf_border *border, const sf_limits *limits, sf_state *state, sf_point *point, double *memory,
                         sf_report *report);

/* ---- Newton's method from afar ----------------------------------------------------------------------- */

/* How a solve ended: Code of sfetcas/solvers/globalised.py. */
#define SF_SOLVED 0
#define SF_UNSTABLE 1
#define SF_ITERATIONS 2
#define SF_STALLED 3
#define SF_NOT_FINITE 4
#define SF_BAD_ARGUMENT 5
#define SF_NOT_DEFINED (-1) /* number of negative eigenvalues where loads have no potential */

/* What an equilibrium depends on, in a row of numbers: data of groups of terms that vary, group by group; what is given;
 * vectors of rotations that are prescribed; and values near which angles count turns in the undeformed state. */
typedef struct {
  int groups;
  const int *count;      /* (groups,) of how many numbers their data are */
  double *const *datum;  /* (groups,) where the model has them */
  int turning;
  const int *turned;     /* (turning,) numbers of the rotations that are prescribed */
  const int *held;       /* (angles,) whether angles are, too */
  int couples;
  const int *couple;     /* (couples,) groups of terms whose loads are moments */
  const double *rest;    /* (numbers of a state,) the undeformed one */
  const double *begun, *reached; /* a row and its equilibrium, from which others are followed; NULL: from zero loads */
} sf_inputs;

/* What controls the method: Rules of sfetcas/solvers/globalised.py, and what follows from a model. */
typedef struct {
  const double *mass, *sides, *seed; /* (total,) of shifts, of the softness, start of the lowest mode or NULL */
  const sf_tape *convex;             /* positive matrices of elements; NULL: none */
  int stiffness;                     /* where matrices begin among the results of an element */
  int iterations, corrections, rounds, halvings, escapes, sweeps;
  int symmetric, minimisable, downhill, pivoted, sliding;
  double converged, rounding, gain, turn, near, proximal, soft, hard, firm, firmer, left, armijo, noise, nudge, far;
  double shortest, level, least, miscounted;
} sf_rules;

/* How it ended. */
typedef struct {
  int status, negative, iterations;
  double residual;
} sf_sought;

SF_PUBLIC int sf_find_size(const sf_model *model, const sf_rules *rules, const sf_inputs *inputs);
SF_PUBLIC int sf_find(const sf_model *model, sf_system *system, const sf_rules *rules, const sf_inputs *inputs,
                      const double *row, int begins, double *state, sf_point *point, double *memory,
                      sf_sought *sought);

/* ---- loads that grow, and many cases ---------------------------------------------------------------- */

/* How it is told that all eigenvalues are clearly above zero, see sfetcas/solvers/stability.py. */
typedef struct {
  const double *weight; /* (total,) of eigenvalues; zero where an unknown has none */
  double shift, softest, soft, rounding, graded, broken, blurred, signs;
  int rounds;
} sf_count_of;

/* A way of loads and motions, and the limits of sfetcas/solvers/continuation.py.
 *
 * After what is given come the vectors (turning, 3) of rotations that are prescribed.
 */
typedef struct {
  const double *begun, *rate; /* (given,) where it begins, NULL: nothing, and by the part of the way */
  int turning;
  const int *turned;          /* (turning,) numbers of these rotations */
  double done, step;          /* changed: the part that is done, the length of the next step */
  int tries;                  /* changed: steps that may still be tried */
  double longest, linear, unbalanced, still, shortest, least, brief;
} sf_way;

/* Cases of one model. */
typedef struct {
  int cases, done, follows; /* done: changed; follows: whether loads are followed from zero */
  int groups;               /* of terms with data that vary */
  const int *count;         /* (groups,) of how many numbers */
  double *const *datum;     /* (groups,) where the model has them */
  const double *row, *zero; /* (cases, numbers of sf_inputs); the state without loads */
  const int *near;          /* (cases,) a case before from which each begins, -1: none; or NULL */
  const double *longest;    /* (cases,) that of the way of each */
  const double *stiffer;    /* (cases,) by which the shift of eigenvalues is larger */
  double *state;            /* (cases, numbers of a state) */
  int *found;               /* (cases,) */
  double *residual;         /* (cases,) */
} sf_cases;

SF_PUBLIC int sf_follow_size(const sf_model *model);
SF_PUBLIC int sf_negative(const sf_model *model, const sf_system *system, const double *entries,
                          const sf_count_of *count, double *memory);
SF_PUBLIC int sf_follow(const sf_model *model, sf_system *system, sf_way *way, const sf_limits *limits,
                        const sf_count_of *count, const double *tangent, sf_state *state, sf_point *point,
                        double *memory, sf_report *report);
SF_PUBLIC int sf_solve_cases(const sf_model *model, sf_system *system, sf_cases *cases, const sf_way *way,
                             const sf_limits *limits, const sf_limits *near_limits, const sf_count_of *count,
                             sf_point *point, double *memory);

SF_PUBLIC int sf_lowest_size(const sf_model *model);
SF_PUBLIC int sf_lowest(const sf_model *model, sf_system *system, const double *entries, const double *weight,
                        double shift, double least, double dual, double *values, double *vectors, double *memory);

/* ---- curves of equilibria ------------------------------------------------------------------------------ */

/* What is told of a point of a curve. */
typedef struct {
  double factor, arc, residual;
  int iterations, negative, doubtful;
} sf_told_of;

/* A curve, its points so far, and the numbers of sfetcas/solvers/tracing.py and arclength.py that rule its steps. */
typedef struct {
  const double *begun, *rate;        /* (given,) at factor 0, and by the factor */
  const double *metric, *probe;      /* (total,) weights of lengths; a load that answers where an eigenvalue is near zero */
  const int *column, *line, *entry;  /* of the rows by the unknowns: where columns begin, rows, entries of the matrix */
  double unit, low, high, stride;    /* of the factor: what counts as a radian, its range, by how much in a step */
  double longest, shortest;          /* steps, rad or shares of the unit */
  double turning, sharpest;          /* angle between tangents that is aimed at, cosine of the largest */
  double far, passing, doubt, effort, roughly, usual, apart;
  int known, loop;                   /* points before the first one here; how many there are before it may close */
  int room, points;                  /* points that there is room for; changed: those that there are, one at first */
  double length;                     /* changed: of the next step */
  const double *before;              /* changed: (total + 1,) tangent at the point before the last, NULL: none */
  double arc_before;                 /* changed: its arc length */
  double *state, *tangent;           /* (room, numbers of a state) and (room, total + 1), the factor last */
  const double *first;               /* a state */
  double first_factor;
  sf_told_of *told;                  /* (room,) */
} sf_curve;

SF_PUBLIC int sf_independent(const sf_model *model, const int *column, const int *line, const int *entry,
                             const double *entries, double roughly, double usual, double *products);
SF_PUBLIC int sf_trace_size(const sf_model *model);
SF_PUBLIC int sf_trace(const sf_model *model, sf_system *system, sf_curve *curve, const sf_limits *limits,
                       const sf_count_of *count, sf_point *point, double *memory, sf_report *report);

/* ---- steps of motions -------------------------------------------------------------------------------- */

#define SF_STAGES 4 /* stages of a method at most */
#define SF_KEPT 4   /* rates that a method keeps from step to step at most */

/* Quantities of one kind that carry mass or are damped: rows of terms, whose multipliers are the forces. */
typedef struct {
  sf_group group;
  const double *mass, *damping; /* (terms, rows) */
  int vectors;                  /* how many of the rows, from the first on, are those of vectors */
} sf_observables;

/* Motions of a model of all stages of a step: copies of everything, stage after stage within each part.
 *
 * Quantities are linear ones, then those of the observables.  Of what moved by X - X_0 since the begin of a step of
 * length h, and of the rates r_k that a method keeps times h^p_k, its numbers give h X', h^2 X'' and the next rates.
 */
typedef struct {
  int stages, kept, quantities, linear, groups; /* quantities of one stage, of them linear; groups of observables */
  const int *part;                  /* (groups + 2,) where the parts of the quantities of one stage begin */
  const double *at;                 /* (stages,) places of the stages in a step, over its length */
  const double *velocity, *acceleration, *after;                /* (stages, stages) twice, (kept, stages) */
  const double *velocity_kept, *acceleration_kept, *after_kept; /* (stages, kept) twice, (kept, kept) */
  const int *power;                 /* (kept,) p: 1 or 2 */
  const sf_group *turning;          /* tangents of elements, turned */
  int tangent;                      /* where undeformed ones, (points, axes), begin in the data of an element */
  const sf_group *seen, *rows;      /* values of the observables; of the rows of the model's groups */
  const sf_observables *observables;
  sf_map by_place, by_tangent, onto_pull, onto_places, mass, drag;
  sf_sums shares, entries;
  int couples;                      /* where what the matrix has beside results of terms begins */
  int massive;                      /* elements of one stage whose inner nodes have mass or drag */
  const int *inside, *point_of;     /* (massive,) their numbers; point of each column of their derivatives */
  const double *inner_mass, *inner_drag, *first_mass, *first_drag; /* (massive, points, points) and (massive, points) */
  int masses, drags;
  const double *place_mass, *place_drag; /* entries of their matrices */
  int entry_count, iterations;
  int driven;
  const int *drive;                 /* (driven,) numbers of rotations that are prescribed */
  int sliding, further;             /* groups of places that may slide; numbers of theirs beside what is given */
  const sf_group *slide;            /* forces and their derivatives by places, multipliers of gaps, and velocities */
  const double *cross;              /* (axes, axes) twice the spin of rotating axes as a product; NULL in fixed ones */
  sf_map coriolis;                  /* forces of the rates of all quantities in rotating axes */
  int weights;                      /* pairs of places that share a mass, in rotating axes */
  const double *weight;
  double dual, last_change, lost;
} sf_motion;

/* One step: what it begins from, what is given at its stages, and what it found. */
typedef struct {
  double h, ratio;                  /* its length, over that of the step before; 0 for a restart */
  const double *given, *vector;     /* of all stages: (given,), (driven, 3) */
  const double *q, *y, *lam, *turn, *shift, *x, *rate; /* at the begin; lam for all stages; of the stages of the last */
  double *unwrapped;                /* values near which angles are counted */
  const double *acting, *held;      /* (rows,) whether rows of all stages act, and at which values; NULL: all, at 0 */
  double *last_q, *last_y, *rows, *turns, *shifts, *there, *rates;
  double size, gap;
  int iterations;
} sf_advance_of;

/* What a step takes and tells as rows of numbers: numbers of sf_inputs for each stage, and flat states. */
typedef struct {
  int inputs, groups;    /* numbers of a row; groups with data that vary */
  const int *count;      /* (groups,) of how many numbers at one stage */
  double *const *datum;  /* (groups,) where the model has those of all stages */
  const int *given;      /* (stages, given) where what is given at each stage stands among that of all */
  const int *row;        /* (stages, rows) the same of multipliers */
  int angles, counts;    /* angles of a state, and of all terms at all stages */
  const int *angle;      /* (counts,) which of the state's these are */
  const int *pivots;     /* of the matrix of some step, as of sf_pivots: most steps have them; NULL */
} sf_flat;

SF_PUBLIC int sf_advance_size(const sf_model *model, const sf_motion *motion);
SF_PUBLIC int sf_advance(const sf_model *model, const sf_motion *motion, sf_system *system, sf_advance_of *step,
                         sf_point *point, double *memory);
SF_PUBLIC int sf_pivots(const sf_pivoted *factors, int *pivots);
SF_PUBLIC int sf_take_step_size(const sf_model *model, const sf_motion *motion, const sf_flat *flat);
SF_PUBLIC int sf_take_step(const sf_model *model, const sf_motion *motion, const sf_flat *flat, sf_system *system,
                           double h, const double *inputs, const double *state, double *after, sf_point *point,
                           double *memory, sf_advance_of *step);

#endif
