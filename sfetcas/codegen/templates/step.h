/* @title@
 *
 * Time steps of a structure of very flexible members, by @method@, for given
@arguments_in_words@.
 * C99, nothing but libm; no memory is allocated, nothing global is written: any number of threads, each with a memory
 * of its own. Made by sfetcas with CasADi @casadi@; README.md and manifest.json say what everything means.
 */
#ifndef @NAME@_H
#define @NAME@_H

#ifdef __cplusplus
extern "C" {
#endif

enum {
  @NAME@_ARGUMENTS = @n_arguments@, /* numbers */
  @NAME@_TIMES = @n_times@, /* at which a step asks for them */
  @NAME@_RESULTS = @n_results@,
  @NAME@_STATE = @n_states@
};

/* Where arguments begin. */
@argument_places@
/* Where results begin; rows before columns. */
@result_places@
/* How a step ended. */
enum {
@statuses@
};

/* What a step works on: its numbers mean nothing outside of it. */
typedef struct {
  const double *arg[@sz_arg@];
  double *res[@sz_res@];
  int iw[@sz_iw@];
  double w[@sz_w@];
  double after[@sz_state@], arguments[@sz_p@], size, iterations, gap;@core_declared@
} @name@_memory;

typedef struct {
  int status;
  int iterations; /* of Newton's method */
  double gap;     /* what closings and joints miss at the end, over the unit of length */
} @name@_report;

/* The values that the arguments have when the motion begins. */
void @name@_defaults(double *arguments);

/* The state in which the motion begins. */
void @name@_begin(double *state);

/* Loads or motions jump or have a kink here: the next step begins afresh, its prediction knows nothing of the last. */
void @name@_refresh(double *state);

/* Shares of a step at which it asks for the arguments: @NAME@_TIMES numbers, the last of them 1. */
void @name@_times(double *shares);

/* Step.
 *
 * h          length of the step, s, at least @shortest@
 * arguments  @NAME@_ARGUMENTS numbers, the same throughout the step
 * state      @NAME@_STATE numbers, before and after; as it was where the step failed
 * results    @NAME@_RESULTS numbers after the step, or 0; not a number where it failed
 * report     what became of it, or 0
 *
 * The status is returned. A step that fails may be tried again with a shorter length.
 */
int @name@_step(@name@_memory *memory, double h, const double *arguments, double *state, double *results,
@indent@@name@_report *report);

/* The same with arguments that change in the step: @NAME@_TIMES sets of @NAME@_ARGUMENTS numbers, one after the other. */
int @name@_step_through(@name@_memory *memory, double h, const double *arguments, double *state, double *results,
@indent_through@@name@_report *report);

/* What a state tells, where the arguments have these values. */
void @name@_tell(@name@_memory *memory, const double *arguments, const double *state, double *results);

/* A sentence for a status. */
const char *@name@_message(int status);

#ifdef __cplusplus
}
#endif

#endif
