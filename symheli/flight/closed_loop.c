/* Flights under feedback, LANES side by side: sensors, a scheduled controller, a delay, servos, and
   the Runge-Kutta steps between two samples. The text of rk4.c comes before this one, with what is
   generated for it: NX states, NE of them in Euler form, of which the first 8 are measured.
   Every lane goes through the same operations in the same order, alone or beside others. */

#define SEEN 9  /* u v w p q r phi theta, airspeed */
#define TOLD 10 /* what a controller is told: the first 8 of these, rotor speed and its integral */
#define ORDER 3 /* states of a servo, zeros where it has fewer */
#define COLUMNS (NE + 4 + 4 + 1) /* states as read, inputs, commands, airspeed as it is */

struct loops {
  /* Courses, `longest` samples each, the last one repeated: x0 and u0 (NE + 4), p (1), the
     controller's matrices (entries; NULL: from its pieces); the state at the start (NX). */
  const double *reference, *scheduling, *matrices, *start;
  long longest;
  const long *course, *samples; /* of each flight */
  /* flight, sample; entries from one flight and one sample to the next, 0 where they share it */
  const double *wind; long wind_flight, wind_sample;    /* 3 */
  const double *added; long added_flight, added_sample; /* 4 */
  const double *white, *white_air; /* 8, and 1 for the airspeed; NULL: no noise */
  const double *p; long p_flight;                       /* NP */
  const double *changed; /* NP of each flight from a sample on; NULL: as p */
  const long *change_at;
  /* Sensors, SEEN each, the noise by flight; delay and period in samples. */
  const double *noise; long noise_flight;
  const double *bias, *quantum;
  const long *delay, *period;
  /* Controller with `own` states: (own + 4) x (own + TOLD) entries, polynomials of p - break
     between `pieces` + 1 breaks: piece, power from the highest (degree + 1), entry. */
  long own, pieces, degree, by_reading, governed;
  const double *breaks, *coefficients;
  /* Servos: A (4, ORDER, ORDER), B, C and the state that holds 1 rad (4, ORDER), the fastest change
     of a command in a step, resolution; NULL: none. */
  const double *A, *B, *C, *settled, *change, *resolution;
  const double *travel;
  long late; /* steps from a command to the servo */
  double *out; /* flight, kept sample (slots), COLUMNS */
  long *lost;  /* flight: the sample at which it was, or -1 */
  long slots, every, substeps;
  double step, level; /* s; rad */
  const volatile int *stop;
};

struct block {
  long first, lanes, longest, entries, recent, issued;
  long course[LANES], samples[LANES], lost[LANES];
  lane x[NX], wind[3], parameters[NP + 1], euler[NE], air[1], reading[SEEN];
  lane initial[4], command[4], reached[4], followed[4], servo[4][ORDER];
  lane *own, *next, *matrix, *history, *commands;
};

static lane *lanes_of(long count)
{
  return calloc(count ? count : 1, sizeof(lane));
}

static void finish(struct block *b)
{
  if (!b) return;
  free(b->own), free(b->next), free(b->matrix), free(b->history), free(b->commands), free(b);
}

static void deflections(const struct loops *f, struct block *b)
{
  for (int i = 0; i < 4; ++i) {
    const double *C = f->C + ORDER * i;
    for (int l = 0; l < LANES; ++l) {
      double y = C[0] * b->servo[i][0][l];
      y = FUSED(C[1], b->servo[i][1][l], y);
      y = FUSED(C[2], b->servo[i][2][l], y);
      b->reached[i][l] = within(y, f->travel[i]);
    }
  }
}

/* Flights first .. first + lanes - 1 at their start; NULL where memory is short. */
static struct block *begin(const struct loops *f, long first, long lanes)
{
  struct block *b = calloc(1, sizeof *b);
  if (!b) return NULL;
  b->first = first, b->lanes = lanes, b->recent = 1;
  for (int j = 0; j < SEEN; ++j) {
    const long reach = f->delay[j] + (f->period[j] > 1 ? f->period[j] : 1);
    if (reach > b->recent) b->recent = reach < f->longest ? reach : f->longest;
  }
  b->issued = f->late / f->substeps + 2;
  b->entries = (f->own + 4) * (f->own + TOLD);
  b->own = lanes_of(f->own), b->next = lanes_of(f->own), b->matrix = lanes_of(b->entries);
  b->history = lanes_of(b->recent * SEEN), b->commands = lanes_of(b->issued * 4);
  if (!b->own || !b->next || !b->matrix || !b->history || !b->commands) return finish(b), NULL;
  for (int l = 0; l < LANES; ++l) { /* the last flight fills the lanes that are left over */
    const long flight = first + (l < lanes ? l : lanes - 1), course = f->course[flight];
    const double *reference = f->reference + course * f->longest * (NE + 4);
    b->course[l] = course, b->samples[l] = f->samples[flight], b->lost[l] = -1;
    if (b->samples[l] > b->longest) b->longest = b->samples[l];
    for (int i = 0; i < NX; ++i) b->x[i][l] = f->start[course * NX + i];
    for (int i = 0; i < NP; ++i) b->parameters[i][l] = f->p[flight * f->p_flight + i];
    for (int i = 0; i < 4; ++i) b->initial[i][l] = b->followed[i][l] = reference[NE + i];
  }
  memcpy(b->reached, b->initial, sizeof b->reached);
  if (f->A) {
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < ORDER; ++j)
        for (int l = 0; l < LANES; ++l)
          b->servo[i][j][l] = f->settled[ORDER * i + j] * b->initial[i][l];
    deflections(f, b);
  }
  return b;
}

/* Euler form and airspeed, and who is lost: beyond `level` of bank or pitch, or out of the range of
   numbers. */
static void look(const struct loops *f, struct block *b, long k)
{
  for (int l = 0; l < LANES; ++l) {
    const long flight = b->first + (l < b->lanes ? l : b->lanes - 1);
    const double *wind = f->wind + flight * f->wind_flight + k * f->wind_sample;
    if (k < b->samples[l] || k == 0)
      for (int i = 0; i < 3; ++i) b->wind[i][l] = wind[i];
  }
  for (int l = 0; l < LANES; ++l) {
    const double q0 = b->x[6][l], q1 = b->x[7][l], q2 = b->x[8][l], q3 = b->x[9][l];
    const double n = b->wind[0][l], e = b->wind[1][l], d = b->wind[2][l];
    const double u = b->x[0][l] - ((1 - 2 * (q2 * q2 + q3 * q3)) * n +
                                   2 * (q1 * q2 + q0 * q3) * e + 2 * (q1 * q3 - q0 * q2) * d);
    const double v = b->x[1][l] - (2 * (q1 * q2 - q0 * q3) * n +
                                   (1 - 2 * (q1 * q1 + q3 * q3)) * e + 2 * (q2 * q3 + q0 * q1) * d);
    const double w = b->x[2][l] - (2 * (q1 * q3 + q0 * q2) * n + 2 * (q2 * q3 - q0 * q1) * e +
                                   (1 - 2 * (q1 * q1 + q2 * q2)) * d);
    b->air[0][l] = sqrt(u * u + v * v + w * w);
  }
  euler_form((const lane *)b->x, b->euler);
  for (int l = 0; l < LANES; ++l) {
    double sum = 0;
    for (int i = 0; i < NX; ++i) sum += b->x[i][l] * 0; /* not a number where one is not finite */
    const int flying =
        sum == 0 && fabs(b->euler[6][l]) <= f->level && fabs(b->euler[7][l]) <= f->level;
    if (!flying && b->lost[l] < 0 && k < b->samples[l]) b->lost[l] = k;
  }
}

/* What the sensors say at sample k. */
static void measure(const struct loops *f, struct block *b, long k)
{
  look(f, b, k);
  lane *now = b->history + (k % b->recent) * SEEN;
  memcpy(now, b->euler, 8 * sizeof(lane));
  memcpy(now[8], b->air[0], sizeof(lane));
  for (int j = 0; j < SEEN; ++j) {
    const long before = k < f->delay[j] ? 0 : k - f->delay[j];
    const long source = f->period[j] > 1 ? before - before % f->period[j] : before;
    const lane *then = (const lane *)b->history + (source % b->recent) * SEEN + j;
    const int noisy = j < 8 ? f->white != NULL : f->white_air != NULL;
    const double *white = noisy ? (j < 8 ? f->white + j : f->white_air) : NULL;
    const double bias = f->bias[j], quantum = f->quantum[j];
    const long width = j < 8 ? 8 : 1;
    for (int l = 0; l < LANES; ++l) {
      const long flight = b->first + (l < b->lanes ? l : b->lanes - 1);
      const double drawn =
          noisy && source < b->samples[l] ? white[(flight * f->longest + source) * width] : 0;
      b->reading[j][l] =
          (*then)[l] + FUSED(f->noise[flight * f->noise_flight + j], drawn, bias);
    }
    if (quantum > 0)
      for (int l = 0; l < LANES; ++l) b->reading[j][l] = rint(b->reading[j][l] / quantum) * quantum;
  }
}

/* The controller's matrices at p between the breaks, `stride` numbers apart. */
static void matrices_at(const struct loops *f, double p, double *to, long entries, long stride)
{
  long i = 0;
  while (i < f->pieces - 1 && p >= f->breaks[i + 1]) ++i;
  const double low = f->breaks[0], high = f->breaks[f->pieces];
  const double s = (p < low ? low : p > high ? high : p) - f->breaks[i];
  const double *c = f->coefficients + i * (f->degree + 1) * entries;
  for (long j = 0; j < entries; ++j) {
    double m = c[j];
    for (long d = 1; d <= f->degree; ++d) m = FUSED(m, s, c[d * entries + j]);
    to[j * stride] = m;
  }
}

static void schedule(const struct loops *f, struct block *b, long k)
{
  const long entries = b->entries;
  int shared = !f->by_reading;
  for (int l = 1; l < LANES; ++l) shared = shared && b->course[l] == b->course[0];
  for (int l = 0; l < (shared ? 1 : LANES); ++l) {
    const long at = b->course[l] * f->longest + (k < f->longest ? k : f->longest - 1);
    double *to = &b->matrix[0][l];
    if (f->matrices)
      for (long j = 0; j < entries; ++j) to[j * LANES] = f->matrices[at * entries + j];
    else
      matrices_at(f, f->by_reading ? b->reading[8][l] : f->scheduling[at], to, entries, LANES);
  }
  if (shared)
    for (long j = 0; j < entries; ++j)
      for (int l = 1; l < LANES; ++l) b->matrix[j][l] = b->matrix[j][0];
}

/* command = u0 + C own + D (reading - x0), own = A own + B (reading - x0) */
static void control(const struct loops *f, struct block *b, long k)
{
  const long own = f->own, columns = own + TOLD;
  lane error[TOLD];
  schedule(f, b, k);
  for (int l = 0; l < LANES; ++l) {
    const long at = b->course[l] * f->longest + (k < f->longest ? k : f->longest - 1);
    const double *reference = f->reference + at * (NE + 4);
    for (int j = 0; j < 8; ++j) error[j][l] = b->reading[j][l] - reference[j];
    for (int j = 0; j < 2; ++j)
      error[8 + j][l] = f->governed ? b->euler[NE - 2 + j][l] - reference[NE - 2 + j] : 0;
    for (int i = 0; i < 4; ++i) b->command[i][l] = reference[NE + i];
  }
  for (long i = 0; i < own + 4; ++i) {
    lane *to = i < own ? b->next + i : b->command + (i - own);
    const lane *row = (const lane *)b->matrix + i * columns;
    if (i < own) memset(*to, 0, sizeof(lane));
    for (long j = 0; j < own; ++j)
      for (int l = 0; l < LANES; ++l) (*to)[l] = FUSED(row[j][l], b->own[j][l], (*to)[l]);
    for (int j = 0; j < TOLD; ++j)
      for (int l = 0; l < LANES; ++l) (*to)[l] = FUSED(row[own + j][l], error[j][l], (*to)[l]);
  }
  lane *spare = b->own;
  b->own = b->next, b->next = spare;
}

static void keep(const struct loops *f, const struct block *b, long k, const lane *inputs)
{
  if (k % f->every) return;
  for (long l = 0; l < b->lanes; ++l) {
    if (k >= b->samples[l]) continue;
    double *row = f->out + ((b->first + l) * f->slots + k / f->every) * COLUMNS;
    for (int j = 0; j < 8; ++j) row[j] = b->reading[j][l];
    for (int j = 8; j < NE; ++j) row[j] = b->euler[j][l];
    for (int i = 0; i < 4; ++i) row[NE + i] = inputs[i][l], row[NE + 4 + i] = b->command[i][l];
    row[NE + 8] = b->air[0][l];
  }
}

/* One step of the servos towards the commands in effect; the mean deflection over it. */
static void servos(const struct loops *f, struct block *b, const lane *effective, lane *mean)
{
  lane before[4];
  memcpy(before, b->reached, sizeof before);
  for (int i = 0; i < 4; ++i) {
    const double *A = f->A + ORDER * ORDER * i, *B = f->B + ORDER * i;
    const double resolution = f->resolution[i], change = f->change[i];
    for (int l = 0; l < LANES; ++l) {
      double wanted = within(effective[i][l], f->travel[i]);
      if (resolution > 0) wanted = rint(wanted / resolution) * resolution;
      const double followed = b->followed[i][l] + within(wanted - b->followed[i][l], change);
      const double x = b->servo[i][0][l], y = b->servo[i][1][l], z = b->servo[i][2][l];
      b->followed[i][l] = followed;
      for (int j = 0; j < ORDER; ++j)
        b->servo[i][j][l] = FUSED(
            A[ORDER * j + 2], z,
            FUSED(A[ORDER * j + 1], y, FUSED(A[ORDER * j], x, B[j] * followed)));
    }
  }
  deflections(f, b);
  for (int i = 0; i < 4; ++i)
    for (int l = 0; l < LANES; ++l) mean[i][l] = 0.5 * (before[i][l] + b->reached[i][l]);
}

/* From sample k to the next under b->command. */
static void advance(const struct loops *f, struct block *b, long k)
{
  lane u[4], kept[NK];
  for (int l = 0; f->changed && l < LANES; ++l) {
    const long flight = b->first + (l < b->lanes ? l : b->lanes - 1);
    if (k == f->change_at[flight])
      for (int i = 0; i < NP; ++i) b->parameters[i][l] = f->changed[flight * NP + i];
  }
  for (int i = 0; i < 4; ++i)
    for (int l = 0; l < LANES; ++l) {
      const long flight = b->first + (l < b->lanes ? l : b->lanes - 1);
      const double added =
          k < b->samples[l] ? f->added[flight * f->added_flight + k * f->added_sample + i] : 0;
      b->command[i][l] = within(b->command[i][l] + added, f->travel[i]);
    }
  memcpy(b->commands + (k % b->issued) * 4, b->command, sizeof b->command);
  for (long s = 0; s < f->substeps; ++s) {
    const long at = k * f->substeps + s - f->late;
    const long asked = at / f->substeps % b->issued;
    const lane *effective = (const lane *)(at < 0 ? b->initial : b->commands + asked * 4);
    if (s == 0) keep(f, b, k, f->A ? (const lane *)b->reached : effective);
    if (f->A) servos(f, b, effective, u);
    else memcpy(u, effective, sizeof u);
    if (s == 0 || f->A || at % f->substeps == 0)
      held((const lane *)u, (const lane *)b->wind, (const lane *)b->parameters, kept);
    runge_kutta(b->x, (const lane *)kept, f->step);
  }
}

static int flying(const struct block *b, long k)
{
  for (long l = 0; l < b->lanes; ++l)
    if (k < b->samples[l] && b->lost[l] < 0) return 1;
  return 0;
}

static void report(const struct loops *f, const struct block *b)
{
  for (long l = 0; l < b->lanes; ++l) f->lost[b->first + l] = b->lost[l];
}

/* Flies flights first <= i < last; returns 1 where it was stopped, -1 where memory is short. */
int fly_loops(const struct loops *f, long first, long last)
{
  for (long flight = first; flight < last; flight += LANES) {
    struct block *b = begin(f, flight, last - flight < LANES ? last - flight : LANES);
    if (!b) return -1;
    for (long k = 0; k < b->longest && flying(b, k); ++k) {
      if (*f->stop) return finish(b), 1;
      measure(f, b, k);
      control(f, b, k);
      advance(f, b, k);
    }
    report(f, b);
    finish(b);
  }
  return 0;
}

/* The same in steps, for a controller from outside: begin; read and command at every
   sample; end. */

void *begin_loops(const struct loops *f, long first, long last)
{
  return begin(f, first, last - first);
}

/* Readings (lanes, SEEN + 2, the last two of the rotor) at sample k; returns whether a flight is
   still under way. */
int read_loops(const struct loops *f, struct block *b, long k, double *readings)
{
  measure(f, b, k);
  for (long l = 0; l < b->lanes; ++l) {
    double *to = readings + l * (SEEN + 2);
    for (int j = 0; j < SEEN; ++j) to[j] = b->reading[j][l];
    for (int j = 0; j < 2; ++j) to[SEEN + j] = b->euler[NE - 2 + j][l];
  }
  return flying(b, k);
}

void command_loops(const struct loops *f, struct block *b, long k, const double *command)
{
  for (int l = 0; l < LANES; ++l)
    for (int i = 0; i < 4; ++i)
      b->command[i][l] = command[(l < b->lanes ? l : b->lanes - 1) * 4 + i];
  advance(f, b, k);
}

void end_loops(const struct loops *f, struct block *b)
{
  report(f, b);
  finish(b);
}
