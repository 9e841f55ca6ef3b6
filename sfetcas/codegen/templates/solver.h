/* @title@
 *
 * The equilibrium of a structure of very flexible members, for given
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
  @NAME@_RESULTS = @n_results@,
  @NAME@_STATE = @n_states@
};

/* Where arguments begin. */
@argument_places@
/* Where results begin; rows before columns. */
@result_places@
/* How a solve ended. */
enum {
@statuses@
};

/* What a solve works on: its numbers mean nothing outside of it. */
typedef struct {
  const double *arg[@sz_arg@];
  double *res[@sz_res@];
  int iw[@sz_iw@];
  double w[@sz_w@];
  double given[@sz_given@], numbers[@sz_numbers@];@margins_declared@
  int whole[@sz_whole@];
} @name@_memory;

typedef struct {
  int status;
  int iterations;  /* of Newton's method */
  int negative;    /* ways out of an unstable equilibrium, 0 of a stable one, -1 where no energy tells */
  double residual; /* of the equilibrium, relative to what is added up in it */
  double error;    /* of positions over the size of the structure, about; grows where the mesh is too coarse */
} @name@_report;

/* The values that the arguments have in the scene. */
void @name@_defaults(double *arguments);

/* Solve.
 *
 * arguments  @NAME@_ARGUMENTS numbers
 * state      @NAME@_STATE numbers: with warm the state to begin with, as an earlier solve left it; afterwards the
 *            solution, or what it was where there is none
 * warm       0 to begin with @start_in_words@
 * results    @NAME@_RESULTS numbers, or 0; not a number where there is no solution
 * report     what became of it, or 0
 *
 * The status is returned.
 */
int @name@_solve(@name@_memory *memory, const double *arguments, double *state, int warm, double *results,
@indent@@name@_report *report);
@sensitivities_declared@
/* A sentence for a status. */
const char *@name@_message(int status);

#ifdef __cplusplus
}
#endif

#endif
