/* Derivatives of a flown trajectory, step by step as it was flown (any explicit tableau), LANES
   directions or functionals side by side. Generated functions come before this text: either held,
   rates, tangent_held, tangent_rates, adjoint_held, adjoint_rates, or parameter_held and
   parameter_rates, whose directions move the parameters too. */

struct line {
  /* sample + 1, NX; sample, 4; sample, 3; NP; every step taken */
  const double *states, *u, *wind, *p, *steps;
  const long *per_sample;
  const double *a, *b;                                   /* tableau: stages x stages, stages */
  /* most steps in one sample; directions or functionals in all */
  long samples, stages, longest, width;
  /* NX, width; sample, 4, width; sample, 3, width */
  const double *dx0, *du, *dwind;
  const double *dp;                                      /* NP, width; of parameter_rates */
  double *dx;                                            /* sample + 1, NX, width */
  const double *weights;                                 /* sample + 1, NX, width */
  /* NX, width; sample, 4, width; sample, 3, width */
  double *x_bar, *u_bar, *wind_bar;
};

static void spread(lane *to, const double *from, int size)
{
  for (int i = 0; i < size; ++i)
    for (int l = 0; l < LANES; ++l) to[i][l] = from[i];
}

static void load(lane *to, const double *from, const struct line *f, long first, int size)
{
  for (int i = 0; i < size; ++i)
    for (int l = 0; l < LANES; ++l)
      to[i][l] = first + l < f->width ? from[i * f->width + first + l] : 0.0;
}

static void store(double *to, const lane *from, const struct line *f, long first, int size)
{
  for (int i = 0; i < size; ++i)
    for (int l = 0; l < LANES && first + l < f->width; ++l)
      to[i * f->width + first + l] = from[i][l];
}

/* q/|q| in x[6..9], and the derivative of that applied to `change`: symmetric, so the same for
   tangents and adjoints */
static void normalise(lane *x, lane *change)
{
  for (int l = 0; l < LANES; ++l) {
    const double scale =
        1.0 / sqrt(x[6][l] * x[6][l] + x[7][l] * x[7][l] + x[8][l] * x[8][l] + x[9][l] * x[9][l]);
    double along = 0;
    for (int i = 6; i < 10; ++i) x[i][l] *= scale;
    if (!change) continue;
    for (int i = 6; i < 10; ++i) along = FUSED(x[i][l], change[i][l], along);
    for (int i = 6; i < 10; ++i) change[i][l] = FUSED(-x[i][l], along, change[i][l]) * scale;
  }
}

/* to = x + h sum_j weights[j] k[j] */
static void combine(lane *to, const lane *x, double h, const double *weights, lane (*k)[NX],
                    long count)
{
  for (int i = 0; i < NX; ++i)
    for (int l = 0; l < LANES; ++l) {
      double sum = 0;
      for (long j = 0; j < count; ++j) sum = FUSED(weights[j], k[j][i][l], sum);
      to[i][l] = FUSED(h, sum, x[i][l]);
    }
}

#ifdef PARAMETER_NK
enum { NT = PARAMETER_NK };
#define change_rates parameter_rates
#else
enum { NT = TANGENT_NK };
#define change_rates tangent_rates
#endif

/* Tangents of `width` directions along the flight; 1 where memory is short. */
int tangent(const struct line *f)
{
  lane(*k)[NX] = malloc(2 * f->stages * sizeof *k), (*dk)[NX] = k + f->stages;
  lane x[NX], dx[NX], y[NX], dy[NX], u[4], du[4], wind[3], dwind[3], p[NP + 1], kept[NT];
#ifdef PARAMETER_NK
  lane dp[NP + 1];
#endif
  if (!k) return 1;
  spread(p, f->p, NP);
  for (long first = 0; first < f->width; first += LANES) {
    const double *h = f->steps;
    load(dx, f->dx0, f, first, NX);
    store(f->dx, (const lane *)dx, f, first, NX);
#ifdef PARAMETER_NK
    load(dp, f->dp, f, first, NP);
#endif
    for (long sample = 0; sample < f->samples; ++sample) {
      spread(x, f->states + sample * NX, NX);
      spread(u, f->u + sample * 4, 4);
      spread(wind, f->wind + sample * 3, 3);
      load(du, f->du + sample * 4 * f->width, f, first, 4);
      load(dwind, f->dwind + sample * 3 * f->width, f, first, 3);
#ifdef PARAMETER_NK
      parameter_held((const lane *)u, (const lane *)wind, (const lane *)p, (const lane *)du,
                     (const lane *)dwind, (const lane *)dp, kept);
#else
      tangent_held((const lane *)u, (const lane *)wind, (const lane *)p, (const lane *)du,
                   (const lane *)dwind, kept);
#endif
      for (const double *end = h + f->per_sample[sample]; h < end; ++h) {
        for (long s = 0; s < f->stages; ++s) {
          combine(y, (const lane *)x, *h, f->a + s * f->stages, k, s);
          combine(dy, (const lane *)dx, *h, f->a + s * f->stages, dk, s);
          change_rates((const lane *)y, (const lane *)dy, (const lane *)kept, k[s], dk[s]);
        }
        combine(x, (const lane *)x, *h, f->b, k, f->stages);
        combine(dx, (const lane *)dx, *h, f->b, dk, f->stages);
        normalise(x, dx);
      }
      store(f->dx + (sample + 1) * NX * f->width, (const lane *)dx, f, first, NX);
    }
  }
  free(k);
  return 0;
}

#ifdef ADJOINT_NK
/* Gradients of `width` functionals, given their derivatives with respect to the states at the
   samples; 1 where memory is short. */
int adjoint(const struct line *f)
{
  const long stages = f->stages;
  /* stages of each step, and its end before it is normalised */
  lane(*y)[NX] = malloc((f->longest * (stages + 1) + 2 * stages) * sizeof *y);
  lane(*k)[NX] = y + f->longest * (stages + 1), (*y_bar)[NX] = k + stages;
  lane x[NX], x_bar[NX], k_bar[NX], u[4], u_bar[4], u_part[4], wind[3], wind_bar[3], wind_part[3],
      p[NP + 1], kept[NK], adjoint_kept[ADJOINT_NK];
  long taken = 0;
  if (!y) return 1;
  spread(p, f->p, NP);
  for (long sample = 0; sample < f->samples; ++sample) taken += f->per_sample[sample];
  for (long first = 0; first < f->width; first += LANES) {
    const double *h = f->steps + taken;
    load(x_bar, f->weights + f->samples * NX * f->width, f, first, NX);
    for (long sample = f->samples - 1; sample >= 0; --sample) {
      const long steps = f->per_sample[sample];
      spread(x, f->states + sample * NX, NX);
      spread(u, f->u + sample * 4, 4);
      spread(wind, f->wind + sample * 3, 3);
      held((const lane *)u, (const lane *)wind, (const lane *)p, kept);
      adjoint_held((const lane *)u, (const lane *)wind, (const lane *)p, adjoint_kept);
      memset(u_bar, 0, sizeof u_bar);
      memset(wind_bar, 0, sizeof wind_bar);
      h -= steps;
      for (long step = 0; step < steps; ++step) {
        lane(*stage)[NX] = y + step * (stages + 1);
        for (long s = 0; s < stages; ++s) {
          combine(stage[s], (const lane *)x, h[step], f->a + s * stages, k, s);
          rates((const lane *)stage[s], (const lane *)kept, k[s]);
        }
        combine(stage[stages], (const lane *)x, h[step], f->b, k, stages);
        memcpy(x, stage[stages], sizeof x);
        normalise(x, NULL);
      }
      for (long step = steps - 1; step >= 0; --step) {
        lane(*stage)[NX] = y + step * (stages + 1);
        normalise(stage[stages], x_bar);
        for (long s = stages - 1; s >= 0; --s) {
          for (int i = 0; i < NX; ++i)
            for (int l = 0; l < LANES; ++l) {
              double sum = f->b[s] * x_bar[i][l];
              for (long j = s + 1; j < stages; ++j) 
                sum = FUSED(f->a[j * stages + s], y_bar[j][i][l], sum);
              k_bar[i][l] = h[step] * sum;
            }
          adjoint_rates((const lane *)stage[s], (const lane *)k_bar, (const lane *)adjoint_kept,
                        y_bar[s], u_part, wind_part);
          for (int i = 0; i < 4; ++i)
            for (int l = 0; l < LANES; ++l) u_bar[i][l] += u_part[i][l];
          for (int i = 0; i < 3; ++i)
            for (int l = 0; l < LANES; ++l) wind_bar[i][l] += wind_part[i][l];
        }
        for (long s = 0; s < stages; ++s)
          for (int i = 0; i < NX; ++i)
            for (int l = 0; l < LANES; ++l) x_bar[i][l] += y_bar[s][i][l];
      }
      load(x, f->weights + sample * NX * f->width, f, first, NX);
      for (int i = 0; i < NX; ++i)
        for (int l = 0; l < LANES; ++l) x_bar[i][l] += x[i][l];
      store(f->u_bar + sample * 4 * f->width, (const lane *)u_bar, f, first, 4);
      store(f->wind_bar + sample * 3 * f->width, (const lane *)wind_bar, f, first, 3);
    }
    store(f->x_bar, (const lane *)x_bar, f, first, NX);
  }
  free(y);
  return 0;
}
#endif
