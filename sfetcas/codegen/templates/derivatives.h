/* @title@
 *
 * Energy, constraints and their derivatives, of an equilibrium of very flexible members as a nonlinear program: x
 * minimises the energy while all constraints are zero. Made for given
@arguments_in_words@.
 * C99, nothing but libm; no memory is allocated, nothing global is written: any number of threads, each with a memory
 * of its own. Made by sfetcas with CasADi @casadi@; README.md and manifest.json say what everything means.
 *
 * All is dimensionless: lengths in @unit_of_length@ m, energies in @unit_of_energy@ N m, counted from any zero. Unknowns are the components of the rotations of the nodes
 * (quaternions, or angles in the plane), then displacements; multipliers are zero or one number for each constraint.
 */
#ifndef @NAME@_H
#define @NAME@_H

#ifdef __cplusplus
extern "C" {
#endif

enum {
  @NAME@_ARGUMENTS = @n_arguments@, /* numbers */
  @NAME@_UNKNOWNS = @n_states@,
  @NAME@_CONSTRAINTS = @n_constraints@,
  @NAME@_JACOBIAN = @n_jacobian@, /* entries of the derivatives of the constraints */
  @NAME@_HESSIAN = @n_hessian@   /* entries of the second derivatives, both triangles */
};

/* Where arguments begin. */
@argument_places@
/* What a call works on: its numbers mean nothing outside of it. */
typedef struct {
  const double *arg[@sz_arg@];
  double *res[@sz_res@];
  int iw[@sz_iw@];
  double w[@sz_w@];
} @name@_memory;

/* The values that the arguments have in the scene. */
void @name@_defaults(double *arguments);

/* The answer of the scene, where its last factor acts: a place to begin. */
void @name@_guess(double *x);

void @name@_energy(@name@_memory *memory, const double *arguments, const double *x, double *energy);
void @name@_gradient(@name@_memory *memory, const double *arguments, const double *x, double *gradient);
void @name@_constraints(@name@_memory *memory, const double *arguments, const double *x, double *constraints);

/* Entries of the derivatives of the constraints, column by column, at the places of the pattern. */
void @name@_jacobian(@name@_memory *memory, const double *arguments, const double *x, double *entries);

/* Entries of the second derivatives of weight * energy + multipliers . constraints. */
void @name@_hessian(@name@_memory *memory, const double *arguments, const double *x, double weight,
@indent@const double *multipliers, double *entries);

/* Patterns: the columns' first entries (one more than columns, the last the number of entries), then the rows. */
const int *@name@_jacobian_pattern(void);
const int *@name@_hessian_pattern(void);

#ifdef __cplusplus
}
#endif

#endif
