/* One flight by the pair of Dormand and Prince, orders 5 and 4, with step control: NX states, NP
   parameters, NK held values. The generated held(u, wind, p, kept) and rates(x, kept, xdot) come
   before this text, STAGES, A, B and E (b - b of order 4) too. */

struct flight {
  const double *x0, *u, *wind; long wind_sample;         /* NX; sample, 4; sample or one, 3 */
  const double *p, *atol;                                /* NP; NX */
  double *states, *steps;                                /* sample + 1, NX; capacity */
  long *per_sample;                                      /* accepted steps of each sample */
  long samples, capacity;
  double dt, rtol, largest;
};

/* Start from x, rates k[0]: the end, normalised, in `end`; returns the error in units of the
   tolerance. */
static double dormand_prince(const struct flight *f, const lane *x, const lane *kept, lane (*k)[NX],
                             double h, lane *end)
{
  for (int s = 1; s < STAGES; ++s) {
    for (int i = 0; i < NX; ++i) {
      double sum = 0;
      for (int j = 0; j < s; ++j) sum = FUSED(A[s][j], k[j][i][0], sum);
      end[i][0] = FUSED(h, sum, x[i][0]);
    }
    rates((const lane *)end, kept, k[s]); /* the last stage is the end itself: its row of A is B */
  }
  double total = 0;
  for (int i = 0; i < NX; ++i) {
    double sum = 0;
    for (int j = 0; j < STAGES; ++j) sum = FUSED(E[j], k[j][i][0], sum);
    const double before = fabs(x[i][0]), after = fabs(end[i][0]);
    const double error = h * sum / (f->atol[i] + f->rtol * (before > after ? before : after));
    total = FUSED(error, error, total);
  }
  const double scale = 1.0 / sqrt(end[6][0] * end[6][0] + end[7][0] * end[7][0] +
                                  end[8][0] * end[8][0] + end[9][0] * end[9][0]);
  for (int i = 6; i < 10; ++i) end[i][0] *= scale;
  return sqrt(total / NX);
}

/* Number of steps taken, or -1 - sample where the steps run out or become too small. */
long fly(const struct flight *f)
{
  lane x[NX], end[NX], u[4], wind[3], p[NP + 1], kept[NK], k[STAGES][NX];
  long taken = 0;
  double wanted = f->dt < f->largest ? f->dt : f->largest, previous = 1e-4;
  for (int i = 0; i < NX; ++i) x[i][0] = f->states[i] = f->x0[i];
  for (int i = 0; i < NP; ++i) p[i][0] = f->p[i];
  for (long sample = 0; sample < f->samples; ++sample) {
    for (int i = 0; i < 4; ++i) u[i][0] = f->u[4 * sample + i];
    for (int i = 0; i < 3; ++i) wind[i][0] = f->wind[f->wind_sample * sample + i];
    held((const lane *)u, (const lane *)wind, (const lane *)p, kept);
    const long first = taken;
    double left = f->dt;
    int fresh = 1, rejected = 0;
    while (left > 0) {
      const int last = wanted >= left * (1 - 1e-12);
      const double h = last ? left : wanted;
      if (taken == f->capacity || h < 1e-12 * f->dt) return -1 - sample;
      if (fresh) rates((const lane *)x, (const lane *)kept, k[0]);
      const double error = dormand_prince(f, (const lane *)x, (const lane *)kept, k, h, end);
      fresh = 0;
      if (!(error <= 1)) { /* also where it is not a number */
        const double shrink = error < 1e300 ? 0.9 * pow(error, -0.17) : 0.1;
        wanted = h * (shrink > 0.2 ? shrink : 0.2);
        rejected = 1;
        continue;
      }
      /* proportional and integral */
      double grow = 0.9 * pow(error > 1e-10 ? error : 1e-10, -0.17) * pow(previous, 0.04);
      grow = grow < 0.2 ? 0.2 : grow > 5 ? 5 : grow;
      if (rejected && grow > 1) grow = 1;
      previous = error > 1e-4 ? error : 1e-4;
      rejected = 0;
      /* a step cut at the sample's end says little about the next */
      wanted = last && wanted > h * grow ? wanted : h * grow;
      if (wanted > f->largest) wanted = f->largest;
      f->steps[taken++] = h;
      left = last ? 0 : left - h;
      memcpy(x, end, sizeof x);
      fresh = 1;
    }
    f->per_sample[sample] = taken - first;
    for (int i = 0; i < NX; ++i) f->states[(sample + 1) * NX + i] = x[i][0];
  }
  return taken;
}
