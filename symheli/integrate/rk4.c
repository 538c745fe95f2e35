/* Flights by the classical Runge-Kutta method, LANES side by side: NX states, NE of them in Euler
   form, NP parameters, NK held values. The generated held(u, wind, p, kept) and rates(x, kept,
   xdot) come before this text. */

struct flights {
  const double *x0;                                      /* flight, NX */
  /* 4; entries from one flight and sample to the next, 0 where they share it */
  const double *u; long u_flight, u_sample;
  const double *wind; long wind_flight, wind_sample;     /* 3 */
  const double *p; long p_flight;                        /* NP */
  /* sample, 4, NE; sample, NE; 4; gains NULL: no feedback */
  const double *gains, *reference, *travel;
  /* flight, kept sample, NX and 4; inputs may be NULL */
  double *states, *inputs;
  long samples, substeps, every, skip_start;
  double step;
  const volatile int *stop;
};

static void normalise(lane *x)
{
  for (int l = 0; l < LANES; ++l) {
    const double first = FUSED(x[7][l], x[7][l], x[6][l] * x[6][l]),
                 second = FUSED(x[9][l], x[9][l], x[8][l] * x[8][l]);
    const double scale = 1.0 / sqrt(first + second);
    for (int i = 6; i < 10; ++i) x[i][l] *= scale;
  }
}

static void runge_kutta(lane *x, const lane *kept, double h)
{
  lane k[NX], y[NX], sum[NX];
  memcpy(y, x, sizeof y);
  memset(sum, 0, sizeof sum);
  for (int stage = 0; stage < 4; ++stage) {
    const double weight = stage == 1 || stage == 2 ? 2.0 : 1.0, next = stage < 2 ? h / 2 : h;
    rates((const lane *)y, kept, k);
    for (int i = 0; i < NX; ++i)
      for (int l = 0; l < LANES; ++l)
        sum[i][l] = FUSED(weight, k[i][l], sum[i][l]), y[i][l] = FUSED(next, k[i][l], x[i][l]);
  }
  for (int i = 0; i < NX; ++i)
    for (int l = 0; l < LANES; ++l) x[i][l] = FUSED(h / 6, sum[i][l], x[i][l]);
  normalise(x);
}

static double within(double value, double most)
{
  return value < -most ? -most : value > most ? most : value;
}

/* NE states in Euler form from NX in quaternion form; heading and position are left out. */
static void euler_form(const lane *x, lane *e)
{
  for (int l = 0; l < LANES; ++l) {
    const double q0 = x[6][l], q1 = x[7][l], q2 = x[8][l], q3 = x[9][l],
                 sine = 2 * FUSED(q0, q2, -q3 * q1);
    for (int j = 0; j < 6; ++j) e[j][l] = x[j][l];
    e[6][l] = elementary_atan2(2 * FUSED(q0, q1, q2 * q3),
                               FUSED(-2.0, FUSED(q1, q1, q2 * q2), 1.0));
    e[7][l] = elementary_asin(within(sine, 1));
    for (int j = 8; j < NE; ++j) e[j][l] = x[j + 5][l];
  }
}

/* u - K (x - reference) in Euler form, within the travel */
static void feed_back(const struct flights *f, long sample, const lane *x, lane *u)
{
  const double *gains = f->gains + sample * 4 * NE, *reference = f->reference + sample * NE;
  lane e[NE];
  euler_form(x, e);
  for (int j = 0; j < NE; ++j)
    for (int i = 0; i < 4; ++i)
      for (int l = 0; l < LANES; ++l)
        u[i][l] = FUSED(-gains[i * NE + j], e[j][l] - reference[j], u[i][l]);
  for (int i = 0; i < 4; ++i) {
    const double most = f->travel[i];
    for (int l = 0; l < LANES; ++l) u[i][l] = within(u[i][l], most);
  }
}

static void load(lane *to, const double *from, long flight, long lanes, long stride, int size)
{
  for (int l = 0; l < LANES; ++l) /* the last flight fills the lanes that are left over */
    for (int i = 0; i < size; ++i)
      to[i][l] = from[(flight + (l < lanes ? l : lanes - 1)) * stride + i];
}

static void store(double *to, const lane *from, long flight, long lanes, long stride, int size)
{
  for (long l = 0; l < lanes; ++l)
    for (int i = 0; i < size; ++i) to[(flight + l) * stride + i] = from[i][l];
}

/* Flies flights first <= i < last; returns 1 where it was stopped. */
int fly(const struct flights *f, long first, long last)
{
  const long kept_samples = f->samples / f->every + 1 - f->skip_start;
  for (long flight = first; flight < last; flight += LANES) {
    const long lanes = last - flight < LANES ? last - flight : LANES;
    lane x[NX], u[4], wind[3], p[NP + 1], kept[NK];
    load(x, f->x0, flight, lanes, NX, NX);
    load(p, f->p, flight, lanes, f->p_flight, NP);
    for (long k = 0;; ++k) {
      const long slot = k / f->every - f->skip_start;
      const int keep = k % f->every == 0 && slot >= 0;
      if (keep) store(f->states + slot * NX, (const lane *)x, flight, lanes, kept_samples * NX, NX);
      if (k == f->samples) break;
      if (*f->stop) return 1;
      load(u, f->u + k * f->u_sample, flight, lanes, f->u_flight, 4);
      load(wind, f->wind + k * f->wind_sample, flight, lanes, f->wind_flight, 3);
      if (f->gains) feed_back(f, k, (const lane *)x, u);
      if (f->inputs && keep)
        store(f->inputs + slot * 4, (const lane *)u, flight, lanes, kept_samples * 4, 4);
      held((const lane *)u, (const lane *)wind, (const lane *)p, kept);
      for (long s = 0; s < f->substeps; ++s) runge_kutta(x, (const lane *)kept, f->step);
    }
  }
  return 0;
}
