/* One flight by a pair of explicit Runge-Kutta methods of orders 5 and 4 with step control: NX
   states, NP parameters, SWITCHED_NK held values. The generated switched_held(u, wind, p, kept) and
   switched_rates(x, kept, xdot, switches) come before this text; STAGES, A, B, E (b less b of order
   4), AT_END (the stage at the end of the step), SWITCHES and NEAR too. */

struct flight {
  const double *x0, *u, *wind; long wind_sample;         /* NX; sample, 4; sample or one, 3 */
  const double *p, *atol;                                /* NP; NX */
  double *states, *steps;                                /* sample + 1, NX; capacity */
  long *per_sample, *evaluations;                        /* accepted steps of each sample; one */
  long samples, capacity;
  double dt, rtol, largest;
};

/* sum_j weights[j] k[j] of so many stages */
static inline void weighted(double *sum, const double *weights, lane (*k)[NX], int stages)
{
  for (int i = 0; i < NX; ++i) sum[i] = 0;
  for (int j = 0; j < stages; ++j)
    for (int i = 0; i < NX; ++i) sum[i] = FUSED(weights[j], k[j][i][0], sum[i]);
}

/* A step from x: its end, normalised, in `end`, the switching functions in `before` and `after`;
   the error in units of the tolerance. Where it is not the first from x, k[0] and `before` are
   there. */
static double pair(const struct flight *f, const lane *x, const lane *kept, lane (*k)[NX], double h,
                   int first, lane *end, lane *before, lane *after)
{
  double sum[NX];
  lane between[SWITCHES];
  for (int s = first ? 0 : 1; s < STAGES; ++s) {
    weighted(sum, A[s], k, s);
    for (int i = 0; i < NX; ++i) end[i][0] = FUSED(h, sum[i], x[i][0]);
    switched_rates((const lane *)end, kept, k[s], s == 0 ? before : s == AT_END ? after : between);
  }
  weighted(sum, B, k, STAGES);
  for (int i = 0; i < NX; ++i) end[i][0] = FUSED(h, sum[i], x[i][0]);
  weighted(sum, E, k, STAGES);
  double total = 0, error[NX];
  for (int i = 0; i < NX; ++i) {
    const double start = fabs(x[i][0]), stop = fabs(end[i][0]);
    error[i] = h * sum[i] / FUSED(f->rtol, start > stop ? start : stop, f->atol[i]);
  }
  for (int i = 0; i < NX; ++i) total = FUSED(error[i], error[i], total);
  const double scale = 1.0 / sqrt(end[6][0] * end[6][0] + end[7][0] * end[7][0] +
                                  end[8][0] * end[8][0] + end[9][0] * end[9][0]);
  for (int i = 6; i < 10; ++i) end[i][0] *= scale;
  return sqrt(total / NX);
}

/* The share of a step after which the first switching function that changes its sign is zero, by a
   straight line; 1 where none does, or so near an end that the step may stay as it is. */
static double first_switch(const lane *before, const lane *after)
{
  double first = 1;
  for (int i = 0; i < SWITCHES; ++i) {
    if (!(before[i][0] * after[i][0] < 0)) continue;
    const double share = before[i][0] / (before[i][0] - after[i][0]);
    if (share > NEAR && share < 1 - NEAR && share < first) first = share;
  }
  return first;
}

/* Number of steps taken, or -1 - sample where the steps run out or become too small. */
long fly(const struct flight *f)
{
  lane x[NX], end[NX], u[4], wind[3], p[NP + 1], kept[SWITCHED_NK], k[STAGES][NX];
  lane before[SWITCHES], after[SWITCHES];
  long taken = 0, evaluations = 0;
  const double longest = f->dt < f->largest ? f->dt : f->largest;
  double wanted = longest, previous = 1e-4;
  for (int i = 0; i < NX; ++i) x[i][0] = f->states[i] = f->x0[i];
  for (int i = 0; i < NP; ++i) p[i][0] = f->p[i];
  for (long sample = 0; sample < f->samples; ++sample) {
    for (int i = 0; i < 4; ++i) u[i][0] = f->u[4 * sample + i];
    for (int i = 0; i < 3; ++i) wind[i][0] = f->wind[f->wind_sample * sample + i];
    switched_held((const lane *)u, (const lane *)wind, (const lane *)p, kept);
    const long first = taken;
    double left = f->dt, cut = INFINITY; /* where a switch is */
    int fresh = 1, rejected = 0;
    while (left > 0) {
      /* equal steps to the end of the sample, as few as the wanted step allows */
      const double count = ceil(left / wanted * (1 - 1e-12)), even = left / count;
      const int last = count <= 1 && cut >= left;
      const double h = even < cut ? even : cut;
      if (taken == f->capacity || !(h >= 1e-12 * f->dt)) return -1 - sample;
      const double error =
          pair(f, (const lane *)x, (const lane *)kept, k, h, fresh, end, before, after);
      evaluations += STAGES - 1 + fresh;
      fresh = 0;
      const double share = first_switch((const lane *)before, (const lane *)after);
      if (share < 1) {
        cut = h * share;
        continue;
      }
      if (!(error <= 1)) { /* also where it is not a number */
        const double shrink = error < 1e300 ? 0.9 * pow(error, -0.17) : 0.1;
        wanted = h * (shrink > 0.2 ? shrink : 0.2);
        rejected = 1;
        continue;
      }
      if (!last || wanted < longest) { /* proportional and integral */
        double grow = 0.9 * pow(error > 1e-10 ? error : 1e-10, -0.17) * pow(previous, 0.04);
        grow = grow < 0.2 ? 0.2 : grow > 5 ? 5 : grow;
        if (rejected && grow > 1) grow = 1;
        /* a step cut short says little about the next */
        if (!(last || h < even) || wanted < h * grow) wanted = h * grow;
        if (wanted > longest) wanted = longest;
      }
      previous = error > 1e-4 ? error : 1e-4;
      rejected = 0;
      f->steps[taken++] = h;
      left = last ? 0 : left - h;
      cut = INFINITY;
      memcpy(x, end, sizeof x);
      fresh = 1;
    }
    f->per_sample[sample] = taken - first;
    for (int i = 0; i < NX; ++i) f->states[(sample + 1) * NX + i] = x[i][0];
  }
  *f->evaluations = evaluations;
  return taken;
}
