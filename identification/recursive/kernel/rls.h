/* Recursive least squares for input-output models with scheduled coefficients.

   One triangular factor an output group, R'DR the information: a square-root filter by
   square-root-free Givens rotations, so that nothing loses its definiteness and no mathematical
   library is needed. C99, freestanding, no allocation: the caller provides rls_state_size() numbers
   of state and rls_work_size() of scratch. -DRLS_SINGLE makes it float. Sums run in a fixed order:
   with -ffp-contract=off and IEEE arithmetic every compiler gets the same numbers to the last
   bit. */
#ifndef RLS_H
#define RLS_H

#ifdef RLS_SINGLE
typedef float rls_real;
#else
typedef double rls_real;
#endif

/* What a regressor multiplies: -y, u, 1 or p(k) - p(k - lag), of signal `channel`; each times every
   function of the basis at p(k - p_lag). */
enum { RLS_OUTPUT, RLS_INPUT, RLS_OFFSET, RLS_INCREMENT };
typedef struct {
    int kind, channel, lag, p_lag;
} rls_entry;

/* Outputs that share one regressor, hence one factor: which outputs, and which entries. */
typedef struct {
    int outputs, entries;
    const int *output, *entry;
} rls_group;

/* Functions of one parameter, polynomial between `pieces` + 1 knots:
   bernstein[piece][function][degree + 1]. The parameter may leave the knots by `slack`. */
typedef struct {
    int functions, degree, pieces;
    rls_real slack;
    const rls_real *knot, *bernstein;
} rls_factor;

/* Products of one function of each parameter: index[function][factor]. Without factors the caller
   provides the functions. `largest` is how large each function becomes. */
typedef struct {
    int functions, factors;
    const rls_factor *factor;
    const int *index;
    const rls_real *largest;
} rls_basis;

/* How old samples lose weight.
   RLS_CONSTANT     by `factor` with each sample that follows
   RLS_VARIABLE     by 1 - (1 - factor) q, but no faster than `lowest`: q is the power of the
                    innovations over the last 1/recent samples against that over the last 1/usual
   RLS_DIRECTIONAL  by `factor` along the new regressor only, and not at all while it is below
                    `quiet` of its largest
   Constant and variable forgetting leave at least the information of `floor` samples with a
   regressor at its largest. */
enum { RLS_CONSTANT, RLS_VARIABLE, RLS_DIRECTIONAL };
typedef struct {
    int kind;
    rls_real factor, lowest, recent, usual, quiet, floor;
} rls_forgetting;

/* `memory` is the largest lag. */
typedef struct {
    int outputs, inputs, parameters, memory, entries, groups;
    const rls_entry *entry;
    const rls_group *group;
    rls_basis basis;
    rls_forgetting forgetting;
} rls_config;

/* What an update says, as bits. */
enum {
    RLS_LEARNT = 1,     /* the regressor was complete: the coefficients have moved */
    RLS_DETERMINED = 2, /* the data fix every coefficient */
    /* so much is known that an ordinary sample is lost to rounding: single precision that never
       forgets */
    RLS_SATURATED = 4,
    /* an infinite or absurdly large number, or p outside the basis: taken as a missing sample */
    RLS_REFUSED = 8
};

int rls_regressors(const rls_config *c); /* entries times functions */
int rls_state_size(const rls_config *c); /* numbers */
int rls_work_size(const rls_config *c);  /* numbers */

/* The state that knows nothing. */
void rls_init(const rls_config *c, rls_real *state, rls_real *work);

/* One sample y, u, p of the same instant. NaN marks a missing one: nothing is learnt and the lags
   start afresh. */
int rls_update(const rls_config *c, rls_real *state, rls_real *work, const rls_real *y,
               const rls_real *u, const rls_real *p);

/* The same with the functions f(p) of a basis without factors. */
int rls_update_with(const rls_config *c, rls_real *state, rls_real *work, const rls_real *y,
                    const rls_real *u, const rls_real *p, const rls_real *f);

/* A regressor phi (rls_regressors) and the outputs y it must explain, for a caller who keeps the
   lags. */
int rls_absorb(const rls_config *c, rls_real *state, rls_real *work, const rls_real *phi,
               const rls_real *y);

/* After a gap: the next update finds no past. */
void rls_forget_past(rls_real *state);

/* theta (rls_regressors, outputs), row by row: the coefficients that explain all samples so far
   best, by their weights; 0 where an output does not have a regressor. */
void rls_coefficients(const rls_config *c, const rls_real *state, rls_real *theta);

/* y minus its prediction (outputs) at the last sample that was learnt. */
const rls_real *rls_innovation(const rls_config *c, const rls_real *work);

#endif
