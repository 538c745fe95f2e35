/* Identified LPV input-output model, sampled at @dt@ s, fitted by "@method@".

     y(k) = theta' phi(k)
     phi: -y, u, 1 and the change of p at their lags, times the functions of p,
          coefficients at p @at@
     functions @basis@

   Each sample: model_predict(&s, u, p, y), then model_observe(&s, y) with y as measured (one step
   ahead) or as predicted (free run, after MODEL_MEMORY measured samples). No allocation, no
   library; SI units and radians.
*/
#ifndef MODEL_H
#define MODEL_H

/* the type of every number, sizes, indices of y, u, p */
/* @sizes@ */

/* What model_predict says. */
enum { MODEL_PREDICTED, MODEL_NO_PAST, MODEL_REFUSED };

/* The present in row 0, the past behind it; a model without inputs keeps room for one. */
typedef struct {
    model_real y[MODEL_MEMORY + 1][MODEL_NY];
    model_real u[MODEL_MEMORY + 1][MODEL_NU > 0 ? MODEL_NU : 1];
    model_real p[MODEL_MEMORY + 1][MODEL_NP];
    model_real f[MODEL_MEMORY + 1][MODEL_NF];
    int filled, fit;
} model_state;

#ifdef __cplusplus
extern "C" {
#endif
/* No past. */
void model_init(model_state *s);
/* y[MODEL_NY] of this instant from u[MODEL_NU], p[MODEL_NP] now and what was before.
   MODEL_NO_PAST: not enough samples yet, y is left alone.
   MODEL_REFUSED: a number that is not finite, or p outside the range of the model; y is left alone
   and the past starts afresh. */
int model_predict(model_state *s, const model_real *u, const model_real *p, model_real *y);
/* c[MODEL_ENTRIES * MODEL_NY] at p[MODEL_NP], row by row: what each signal in phi is multiplied by.
   0 where p is outside the range of the model; c is then left alone. */
int model_coefficients(const model_real *p, model_real *c);
/* What y was at this instant. A number that is not finite marks a missing sample: the past starts
   afresh. */
void model_observe(model_state *s, const model_real *y);
#ifdef __cplusplus
}
#endif
#endif
