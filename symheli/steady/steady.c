/* Steady flights by Newton's method, LANES side by side: NZ unknowns, NX states, NC numbers of the
   flight condition, NP parameters, NS switching functions, NK held values. Before this text come
   held(demand, p, kept), system_of(z, kept, residual, slopes), point_of(z, demand, p, x, wind,
   xdot, residual, switches, torque) and slopes_of(x, u, wind, p, A, B, E), generated, and which
   equations are balanced. */

static void load(lane *to, const double *from, long first, long lanes, long stride, int size)
{
  for (int l = 0; l < LANES; ++l) /* the last point fills the lanes that are left over */
    for (int i = 0; i < size; ++i)
      to[i][l] = from[(first + (l < lanes ? l : lanes - 1)) * stride + i];
}

static void store(double *to, const lane *from, long first, long lanes, int size)
{
  for (long l = 0; l < lanes; ++l)
    for (int i = 0; i < size; ++i) to[(first + l) * size + i] = from[i][l];
}

static void largest(const lane *values, lane most)
{
  for (int l = 0; l < LANES; ++l) most[l] = 0;
  for (int i = 0; i < NX; ++i)
    for (int l = 0; l < LANES; ++l) { /* a NaN stays */
      const double size = fabs(values[i][l]);
      most[l] = most[l] >= size ? most[l] : most[l] != most[l] ? most[l] : size;
    }
}

/* M d = b by elimination, the largest entry of each column its pivot; M and b are used up */
static void solve(lane M[NZ][NZ], lane b[NZ])
{
  for (int k = 0; k < NZ; ++k) {
    for (int i = k + 1; i < NZ; ++i)
      for (int l = 0; l < LANES; ++l) {
        const int swap = fabs(M[i][k][l]) > fabs(M[k][k][l]);
        for (int j = k; j < NZ; ++j) {
          const double above = M[k][j][l], below = M[i][j][l];
          M[k][j][l] = swap ? below : above;
          M[i][j][l] = swap ? above : below;
        }
        const double above = b[k][l], below = b[i][l];
        b[k][l] = swap ? below : above;
        b[i][l] = swap ? above : below;
      }
    lane scale;
    for (int l = 0; l < LANES; ++l) scale[l] = 1 / M[k][k][l];
    for (int i = k + 1; i < NZ; ++i)
      for (int l = 0; l < LANES; ++l) {
        const double factor = M[i][k][l] * scale[l];
        for (int j = k + 1; j < NZ; ++j) M[i][j][l] -= factor * M[k][j][l];
        b[i][l] -= factor * b[k][l];
      }
    for (int l = 0; l < LANES; ++l) M[k][k][l] = scale[l];
  }
  for (int k = NZ - 1; k >= 0; --k)
    for (int l = 0; l < LANES; ++l) {
      double left = b[k][l];
      for (int j = k + 1; j < NZ; ++j) left -= M[k][j][l] * b[j][l];
      b[k][l] = left * M[k][k][l];
    }
}

/* Full Newton steps in each lane while its largest residual falls, until it is below `enough`. */
static void newton(lane *z, const lane *kept, lane miss, long steps, double enough)
{
  lane residual[NX], next[NZ], left, going, M[NZ][NZ], b[NZ];
  system_of((const lane *)z, kept, residual, M[0]);
  largest((const lane *)residual, miss);
  for (int l = 0; l < LANES; ++l) going[l] = 1;
  for (long step = 0; step < steps; ++step) {
    double any = 0;
    for (int i = 0; i < NZ; ++i)
      for (int l = 0; l < LANES; ++l) b[i][l] = residual[balanced[i]][l];
    solve(M, b);
    for (int i = 0; i < NZ; ++i)
      for (int l = 0; l < LANES; ++l) next[i][l] = z[i][l] - b[i][l];
    system_of((const lane *)next, kept, residual, M[0]);
    largest((const lane *)residual, left);
    for (int l = 0; l < LANES; ++l) {
      const int better = going[l] != 0 && left[l] < miss[l];
      for (int i = 0; i < NZ; ++i) z[i][l] = better ? next[i][l] : z[i][l];
      miss[l] = better ? left[l] : miss[l];
      going[l] = better && !(left[l] < enough) ? 1.0 : 0.0;
    }
    for (int l = 0; l < LANES; ++l) any += going[l];
    if (any == 0) break;
  }
}

/* Trims begin <= k < end, in order, those before being there. after[k]: an earlier one whose
   solution is the start of k (where it misses by `found` or more, the one which that was after, and
   so on); -1: its own row of z. z: count x NZ, starts and then solutions; demand: count x NC; p:
   rows of p_stride; miss: count, largest residuals. */
void trims(long begin, long end, const long *after, const double *demand, const double *p,
           long p_stride, double *z, double *miss, long steps, double enough, double found)
{
  for (long first = begin, last; first < end; first = last) {
    lane unknown[NZ], asked[NC], par[NP], kept[NK], left;
    /* as many as depend on none of each other */
    for (last = first; last < end && last < first + LANES && after[last] < first; ++last) {
      long start = after[last];
      while (start >= 0 && !(miss[start] < found)) start = after[start];
      if (start >= 0) memcpy(z + last * NZ, z + start * NZ, NZ * sizeof *z);
    }
    load(unknown, z, first, last - first, NZ, NZ);
    load(asked, demand, first, last - first, NC, NC);
    load(par, p, first, last - first, p_stride, NP);
    held((const lane *)asked, (const lane *)par, kept);
    newton(unknown, (const lane *)kept, left, steps, enough);
    store(z, (const lane *)unknown, first, last - first, NZ);
    store(miss, (const lane *)&left, first, last - first, 1);
  }
}

/* What is known at given unknowns: x (count x NX), wind (3), xdot (NX), residual (NX), switches
   (NS), torque (1). */
void points(long count, const double *z, const double *demand, const double *p, long p_stride,
            double *x, double *wind, double *xdot, double *residual, double *switches,
            double *torque)
{
  for (long first = 0; first < count; first += LANES) {
    const long lanes = count - first < LANES ? count - first : LANES;
    lane unknown[NZ], asked[NC], par[NP], x_[NX], w[3], f[NX], r[NX], s[NS + 1], q[1];
    load(unknown, z, first, lanes, NZ, NZ);
    load(asked, demand, first, lanes, NC, NC);
    load(par, p, first, lanes, p_stride, NP);
    point_of((const lane *)unknown, (const lane *)asked, (const lane *)par, x_, w, f, r, s, q);
    store(x, (const lane *)x_, first, lanes, NX);
    store(wind, (const lane *)w, first, lanes, 3);
    store(xdot, (const lane *)f, first, lanes, NX);
    store(residual, (const lane *)r, first, lanes, NX);
    store(switches, (const lane *)s, first, lanes, NS);
    store(torque, (const lane *)q, first, lanes, 1);
  }
}

/* A (count x NX x NX), B (count x NX x 4) and E (count x NX x 3) at given points. */
void slopes(long count, const double *x, const double *u, const double *wind, const double *p,
            long p_stride, double *A, double *B, double *E)
{
  for (long first = 0; first < count; first += LANES) {
    const long lanes = count - first < LANES ? count - first : LANES;
    lane x_[NX], u_[4], w[3], par[NP], a[NX * NX], b[NX * 4], e[NX * 3];
    load(x_, x, first, lanes, NX, NX);
    load(u_, u, first, lanes, 4, 4);
    load(w, wind, first, lanes, 3, 3);
    load(par, p, first, lanes, p_stride, NP);
    slopes_of((const lane *)x_, (const lane *)u_, (const lane *)w, (const lane *)par, a, b, e);
    store(A, (const lane *)a, first, lanes, NX * NX);
    store(B, (const lane *)b, first, lanes, NX * 4);
    store(E, (const lane *)e, first, lanes, NX * 3);
  }
}
