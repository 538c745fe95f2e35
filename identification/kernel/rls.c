/* See rls.h. Rotations after Gentleman (1973), Least squares computations by Givens transformations without square roots. */
#include "rls.h"

#include <float.h>

#ifdef RLS_SINGLE
#define EPSILON FLT_EPSILON
#define LARGEST 1e15f /* a signal beyond this would overflow when squared and summed */
#define TINY 1e-36f   /* information below this is none */
#else
#define EPSILON DBL_EPSILON
#define LARGEST 1e145
#define TINY 1e-290
#endif
#define LANES 8
#define REAL(number) ((rls_real)(number))
#define PRIOR (EPSILON / 16) /* samples with a regressor at its largest that are pretended at first, saying "coefficient 0" */
#define MILLION 1048576      /* samples are counted in two numbers, each exact in single precision */

/* State: this header, the past (memory + 1 rows of y, u, p, f(p), newest first), the groups. */
enum { COUNT, MILLIONS, FILLED, HEADER = LANES };
/* A group: this header, then the arrays of `group` up to `usual`. */
enum { WEIGHT, TURN, DETERMINED, STEPS, FACTOR, GROUP_HEADER = LANES };

/* n regressors, m outputs; n + m, n and m rounded up to whole LANES. Row i of the unit triangle starts at the multiple of LANES at or
   before its diagonal. [R, Z; 0, S] = sqrt(d) triangle. */
typedef struct {
    int n, m, wide, tall, high;
    rls_real *header, *triangle, *d, *theta, *peak, *energy, *fed, *recent, *usual; /* state */
    rls_real *phi, *x, *s, *gain, *innovation;                                      /* scratch */
} group;

static int padded(int n) { return (n + LANES - 1) / LANES * LANES; }

static int row_start(int i) { return i / LANES * LANES; }

/* Where row i of a triangle with rows of `wide` columns begins. */
static int row_offset(int i, int wide)
{
    const int blocks = i / LANES;
    return i * wide - LANES * (LANES * (blocks * (blocks - 1) / 2) + blocks * (i % LANES));
}

static int row_width(const rls_config *c) { return c->outputs + c->inputs + c->parameters + c->basis.functions; }

static int past_size(const rls_config *c) { return padded((c->memory + 1) * row_width(c)); }

static group open_group(const rls_config *c, int g, rls_real *state, rls_real *work)
{
    group a;
    a.n = c->group[g].entries * c->basis.functions;
    a.m = c->group[g].outputs;
    a.wide = padded(a.n + a.m);
    a.tall = padded(a.n);
    a.high = padded(a.m);
    a.header = state;
    a.triangle = a.header + GROUP_HEADER;
    a.d = a.triangle + row_offset(a.n + a.m, a.wide);
    a.theta = a.d + a.wide;
    a.peak = a.theta + a.m * a.tall;
    a.energy = a.peak + a.tall;
    a.fed = a.energy + a.tall;
    a.recent = a.fed + a.tall;
    a.usual = a.recent + a.high;
    a.phi = work;
    a.x = a.phi + a.tall;
    a.s = a.x + a.wide;
    a.gain = a.s + a.wide;
    a.innovation = a.gain + a.tall;
    return a;
}

static rls_real *end_of_state(const group *a) { return a->usual + a->high; }

static rls_real *end_of_work(const group *a) { return a->innovation + a->high; }

static int groups_state(const rls_config *c) { return HEADER + past_size(c); }

static int groups_work(const rls_config *c) { return padded(rls_regressors(c)) + padded(c->outputs); }

int rls_regressors(const rls_config *c) { return c->entries * c->basis.functions; }

int rls_state_size(const rls_config *c)
{
    int size = groups_state(c);
    for (int g = 0; g < c->groups; g++) {
        const int n = c->group[g].entries * c->basis.functions, m = c->group[g].outputs, wide = padded(n + m);
        size += GROUP_HEADER + row_offset(n + m, wide) + wide + (m + 3) * padded(n) + 2 * padded(m);
    }
    return size;
}

int rls_work_size(const rls_config *c)
{
    int size = groups_work(c);
    for (int g = 0; g < c->groups; g++) {
        const int n = c->group[g].entries * c->basis.functions, m = c->group[g].outputs;
        size += 2 * padded(n) + 2 * padded(n + m) + padded(m);
    }
    return size;
}

void rls_init(const rls_config *c, rls_real *state, rls_real *work)
{
    for (int i = rls_state_size(c) - 1; i >= 0; i--) state[i] = 0;
    for (int i = rls_work_size(c) - 1; i >= 0; i--) work[i] = 0;
    state += groups_state(c);
    for (int g = 0; g < c->groups; g++) {
        const group a = open_group(c, g, state, work);
        for (int i = 0; i < a.n + a.m; i++) a.triangle[row_offset(i, a.wide) + i - row_start(i)] = 1;
        state = end_of_state(&a);
    }
}

static inline rls_real absolute(rls_real a) { return a > -a ? a : -a; }

static inline rls_real dot(const rls_real *restrict a, const rls_real *restrict b, int length)
{
    rls_real s[LANES] = {0};
    for (int k = 0; k < length; k += LANES)
        for (int j = 0; j < LANES; j++) s[j] += a[k + j] * b[k + j];
    return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

/* For each row i in turn: x <- x - first[i] row, row <- row + gain[i] x. Four rows at a time save loads and stores of x. */
static inline void rotate(rls_real *rows, int stride, int count, rls_real *restrict x, int length, const rls_real *first, const rls_real *gain)
{
    int i = 0;
    for (; i + 4 <= count; i += 4) {
        rls_real *restrict r0 = rows + i * stride, *restrict r1 = r0 + stride, *restrict r2 = r1 + stride, *restrict r3 = r2 + stride;
        const rls_real f0 = first[i], f1 = first[i + 1], f2 = first[i + 2], f3 = first[i + 3];
        const rls_real g0 = gain[i], g1 = gain[i + 1], g2 = gain[i + 2], g3 = gain[i + 3];
        for (int k = 0; k < length; k++) {
            rls_real t = x[k] - f0 * r0[k];
            r0[k] += g0 * t;
            t -= f1 * r1[k];
            r1[k] += g1 * t;
            t -= f2 * r2[k];
            r2[k] += g2 * t;
            t -= f3 * r3[k];
            r3[k] += g3 * t;
            x[k] = t;
        }
    }
    for (; i < count; i++) {
        rls_real *restrict row = rows + i * stride;
        const rls_real f = first[i], g = gain[i];
        for (int k = 0; k < length; k++) {
            const rls_real t = x[k] - f * row[k];
            x[k] = t;
            row[k] += g * t;
        }
    }
}

/* The same for one row of which little is kept, where row + gain x would cancel: row <- keep row + gain x. */
static inline void renew(rls_real *restrict row, rls_real *restrict x, int length, rls_real first, rls_real gain, rls_real keep)
{
    for (int k = 0; k < length; k++) {
        const rls_real r = row[k], t = x[k];
        x[k] = t - first * r;
        row[k] = keep * r + gain * t;
    }
}

/* What x, of weight 1/w[0], does to `rows` rows of a block: lead, the entry each eliminates; gain; the new d; w[i + 1], the weight that is
   left. 0 where a row must be renewed: then nothing of it is used. */
static inline int plan(const rls_real *block, int stride, int rows, const rls_real *x, const rls_real *d, rls_real kept, rls_real *lead,
                       rls_real *gain, rls_real *new_d, rls_real *w)
{
    rls_real ratio[LANES], old[LANES];
    int plain = 1;
    for (int i = 0; i < rows; i++) {
        rls_real f = x[i];
        for (int k = 0; k < i; k++) f -= lead[k] * block[k * stride + i];
        lead[i] = f;
    }
    for (int i = 0; i < rows; i++) {
        old[i] = kept * d[i];
        ratio[i] = lead[i] / old[i];
    }
    for (int i = 0; i < rows; i++) {
        w[i + 1] = w[i] + lead[i] * ratio[i];
        plain &= (w[i + 1] <= 4 * w[i]) & (old[i] > TINY);
    }
    for (int i = 0; i < rows; i++) {
        gain[i] = ratio[i] / w[i + 1];
        new_d[i] = old[i] + lead[i] * (lead[i] / w[i]);
    }
    return plain;
}

/* The same row by row, where one is new or of little weight: its old content goes, or cancels. Returns the weight that is left. */
static rls_real renew_rows(const group *a, int start, int first, int rows, rls_real kept, rls_real w)
{
    const int length = a->wide - start;
    rls_real *x = a->x + start, *block = a->triangle + row_offset(start, a->wide);
    for (int i = first; i < rows; i++) {
        const rls_real f = x[i], d = kept * a->d[start + i], ratio = f / d, sum = w + f * ratio;
        rls_real gain = 0, *row = block + i * length;
        if (f == 0) {
            a->d[start + i] = d;
        } else if (sum <= 4 * w && d > TINY) {
            gain = ratio / sum;
            a->d[start + i] = d + f * (f / w);
            w = sum;
            rotate(row, length, 1, x, length, &f, &gain);
        } else {
            const int known = d > TINY;
            gain = known ? ratio / sum : 1 / f;
            renew(row, x, length, f, gain, known ? w / sum : 0);
            row[i] = 1;
            a->d[start + i] = (known ? d : 0) + f * (f / w);
            w = known ? sum : 1 / TINY;
        }
        a->s[start + i] = gain;
    }
    return w;
}

/* Rotate x, of weight 1/w, into rows first .. last - 1, whose information is first multiplied by `kept`. Returns what w has become;
   s gets R^-T phi in the scale of the triangle. */
static inline rls_real sweep(const group *a, int first, int last, rls_real kept, rls_real w)
{
    for (int start = row_start(first); start < last; start += LANES) {
        const int length = a->wide - start, rows = last - start < LANES ? last - start : LANES;
        rls_real lead[LANES], gain[LANES], d[LANES], weight[LANES + 1], *x = a->x + start, *block = a->triangle + row_offset(start, a->wide);
        int plain = first <= start;
        weight[0] = w;
        if (plain && rows == LANES) /* the usual case, with a constant for the compiler */
            plain = plan(block, length, LANES, x, a->d + start, kept, lead, gain, d, weight);
        else if (plain)
            plain = plan(block, length, rows, x, a->d + start, kept, lead, gain, d, weight);
        if (plain) {
            rotate(block, length, rows, x, length, lead, gain);
            for (int i = 0; i < rows; i++) a->d[start + i] = d[i];
            for (int i = 0; i < rows; i++) a->s[start + i] = gain[i];
            w = weight[rows];
        } else {
            w = renew_rows(a, start, first > start ? first - start : 0, rows, kept, w);
        }
    }
    return w;
}

/* Whether column i of R stands out of the span of those before it, as far as rounding lets us see. */
static inline int is_known(rls_real d, rls_real energy) { return d > EPSILON * energy; }

/* Solve with the triangle of a block of rows: g <- block^-1 g, 0 where a coefficient is not known. */
static inline void solve_block(const rls_real *block, int stride, int rows, const rls_real *d, const rls_real *energy, rls_real *g)
{
    rls_real t[LANES];
    for (int i = rows - 1; i >= 0; i--) {
        rls_real sum = g[i];
        for (int k = rows - 1; k > i; k--) sum -= block[i * stride + k] * t[k];
        t[i] = is_known(d[i], energy[i]) ? sum : 0;
    }
    for (int i = 0; i < rows; i++) g[i] = t[i];
}

/* gain <- triangle^-1 s; a coefficient that is not known stays as it is, and the others explain the data without it. */
static inline void back_substitute(const group *a)
{
    for (int k = 0; k < a->tall; k++) a->gain[k] = 0;
    for (int start = a->tall - LANES; start >= 0; start -= LANES) {
        const int rows = a->n - start < LANES ? a->n - start : LANES, length = a->wide - start, right = a->tall - start - LANES;
        const rls_real *block = a->triangle + row_offset(start, a->wide), *d = a->d + start, *energy = a->energy + start;
        rls_real *g = a->gain + start;
        for (int i = 0; i < rows; i++) g[i] = a->s[start + i] - dot(block + i * length + LANES, g + LANES, right);
        if (rows == LANES) /* the usual case, with a constant for the compiler */
            solve_block(block, length, LANES, d, energy, g);
        else
            solve_block(block, length, rows, d, energy, g);
    }
}

static inline rls_real power(rls_real base, int exponent)
{
    rls_real result = 1;
    for (; exponent > 0; exponent /= 2) {
        if (exponent % 2) result *= base;
        base *= base;
    }
    return result;
}

/* The information that coefficients are kept awake with, in samples with a regressor at its largest: enough that the floor still stands
   when half of it and then n samples more are forgotten. */
static inline rls_real wakefulness(const rls_forgetting *f, int n)
{
    const rls_real fastest = f->kind == RLS_VARIABLE ? f->lowest : f->factor;
    rls_real kept, floor;
    if (f->kind == RLS_DIRECTIONAL || fastest == 1) return PRIOR;
    kept = power(fastest, n);
    floor = 2 * f->floor / (kept > REAL(1e-12) ? kept : REAL(1e-12));
    return floor > PRIOR ? floor : PRIOR;
}

/* Largest regressors so far. A coefficient whose regressor is seen for the first time is kept awake from the start, at the 0 it has, lest
   the first samples make it wild: nothing is in its row and column yet. */
static inline void new_peaks(const group *a, rls_real samples)
{
    int fresh = 0;
    for (int i = 0; i < a->tall; i++) fresh += (a->peak[i] == 0) & (a->phi[i] != 0);
    for (int i = 0; fresh && i < a->n; i++)
        if (a->peak[i] == 0) a->d[i] = a->energy[i] = a->fed[i] = samples * (a->phi[i] * a->phi[i]);
    for (int i = 0; i < a->tall; i++) {
        const rls_real size = absolute(a->phi[i]);
        a->peak[i] = size > a->peak[i] ? size : a->peak[i];
    }
}

/* The largest ratio of a regressor to its largest. */
static inline rls_real loudness(const group *a)
{
    rls_real loudest = 0;
    for (int i = 0; i < a->n; i++)
        if (absolute(a->phi[i]) > loudest * a->peak[i]) loudest = absolute(a->phi[i]) / a->peak[i];
    return loudest;
}

/* Multiply the information along phi by `factor`, and leave what is known of all other directions: R'DR - (1 - factor) v v' / phi'v with
   v = R'DR phi. Source: Cao and Schwartz (2000), A directional forgetting algorithm based on the decomposition of the information matrix. */
static inline void forget_direction(const group *a, rls_real factor)
{
    rls_real length2 = 0, share, left = factor;
    for (int i = 0; i < a->n; i++) {
        const int start = row_start(i);
        a->s[i] = dot(a->triangle + row_offset(i, a->wide), a->phi + start, a->tall - start);
        length2 += a->d[i] * (a->s[i] * a->s[i]);
    }
    if (!(length2 > TINY)) return;
    share = (1 - factor) / length2;
    for (int k = 0; k < a->wide; k++) a->x[k] = 0;
    for (int i = a->n - 1; i >= 0; i--) {
        const int start = row_start(i);
        const rls_real more = left + share * (a->d[i] * (a->s[i] * a->s[i])), out = share * a->s[i] / left, in = a->d[i] * a->s[i];
        rls_real *restrict row = a->triangle + row_offset(i, a->wide), *restrict x = a->x + start;
        for (int k = 0; k < a->wide - start; k++) {
            const rls_real r = row[k], t = x[k];
            row[k] = r - out * t;
            x[k] = t + in * r;
        }
        a->d[i] *= left / more;
        left = more;
    }
    for (int i = 0; i < a->n; i++) a->energy[i] -= share * (a->x[i] * a->x[i]);
}

/* The first innovations say what is not known yet, not what is usual. */
static inline int is_settled(const rls_forgetting *f, const group *a)
{
    const rls_real weight = a->header[WEIGHT];
    return a->header[STEPS] > 0 || (a->header[DETERMINED] != 0 && (weight >= REAL(2 * a->n) || 2 * weight * (1 - f->factor) >= 1));
}

/* A sample counts in the usual power no more than tenfold, and what is usual comes down with what is recent: a jump or an outlier does not
   pass for usual. Source of the variable factor: Fortescue, Kershenbaum and Ydstie (1981), with both powers taken from the innovations. */
static inline rls_real forgetting_factor(const rls_forgetting *f, const group *a)
{
    rls_real steps, recent, usual, ratio = 0, factor;
    if (f->kind == RLS_DIRECTIONAL) return loudness(a) < f->quiet ? 1 : f->factor;
    if (f->kind == RLS_CONSTANT || !is_settled(f, a)) return f->factor;
    steps = a->header[STEPS] + 1;
    if (steps * f->usual <= 2) a->header[STEPS] = steps;
    recent = steps * f->recent > 1 ? f->recent : 1 / steps;
    usual = steps * f->usual > 1 ? f->usual : 1 / steps;
    for (int j = 0; j < a->m; j++) {
        const rls_real power = a->innovation[j] * a->innovation[j];
        a->recent[j] += recent * (power - a->recent[j]);
        if (a->usual[j] == 0) a->usual[j] = power;
        a->usual[j] += usual * ((power < 10 * a->usual[j] ? power : 10 * a->usual[j]) - a->usual[j]);
        if (a->usual[j] > 4 * a->recent[j]) a->usual[j] = 4 * a->recent[j];
        ratio += a->usual[j] > 0 ? a->recent[j] / a->usual[j] : 1;
    }
    factor = 1 - (1 - f->factor) * (ratio / REAL(a->m));
    return factor < f->lowest ? f->lowest : factor > f->factor ? f->factor : factor;
}

/* Keep coefficient j awake: a measurement that says "as it is now" moves nothing and makes up for what was forgotten. It comes as soon as
   half is gone, n samples after the last turn of j at the earliest. */
static inline void replenish(const group *a, rls_real samples, int j)
{
    const rls_real target = samples * (a->peak[j] * a->peak[j]);
    if (2 * a->fed[j] >= target) return;
    for (int k = 0; k < a->wide; k++) a->x[k] = 0;
    a->x[j] = 1;
    for (int k = 0; k < a->m; k++) a->x[a->n + k] = a->theta[k * a->tall + j];
    sweep(a, j, a->n, 1, 1 / (target - a->fed[j]));
    a->energy[j] += target - a->fed[j];
    a->fed[j] = target;
}

/* Information that is about to underflow is dropped. */
static inline void drop_underflow(const group *a, int j)
{
    rls_real *row = a->triangle + row_offset(j, a->wide);
    for (int k = 0; k < a->wide - row_start(j); k++) row[k] = absolute(row[k]) < TINY ? 0 : row[k];
    if (a->d[j] < TINY) a->d[j] = 0;
    if (j < a->n && a->energy[j] < TINY) a->energy[j] = 0;
    if (j < a->n && a->fed[j] < TINY) a->fed[j] = 0;
}

/* Whether every coefficient is known; at first it must also be known from more than what was fed to keep it awake. */
static inline int is_determined(const group *a)
{
    const rls_real beyond = a->header[DETERMINED] == 0 ? 2 : 0;
    int known = 0;
    for (int i = 0; i < a->n; i++) known += is_known(a->d[i], a->energy[i]) & (a->d[i] > beyond * a->fed[i]);
    return known == a->n;
}

static void learn(const rls_forgetting *f, const group *a, const int *output, const rls_real *y)
{
    const int turn = (int)a->header[TURN];
    const rls_real samples = wakefulness(f, a->n);
    rls_real factor, kept, w;
    for (int j = 0; j < a->m; j++) a->innovation[j] = y[output[j]] - dot(a->phi, a->theta + j * a->tall, a->tall);
    new_peaks(a, samples);
    factor = forgetting_factor(f, a);
    kept = f->kind == RLS_DIRECTIONAL ? 1 : factor;
    replenish(a, samples, turn);
    if (factor < kept) forget_direction(a, factor);
    for (int k = 0; k < a->tall; k++) a->x[k] = a->phi[k];
    for (int k = a->n; k < a->wide; k++) a->x[k] = 0;
    for (int j = 0; j < a->m; j++) a->x[a->n + j] = y[output[j]];
    w = sweep(a, 0, a->n, kept, 1);
    sweep(a, a->n, a->n + a->m, factor, w);
    for (int k = 0; k < a->tall; k++) {
        a->energy[k] = kept * a->energy[k] + a->phi[k] * a->phi[k];
        a->fed[k] *= kept;
    }
    back_substitute(a);
    for (int j = 0; j < a->m; j++)
        for (int k = 0; k < a->tall; k++) a->theta[j * a->tall + k] += a->innovation[j] * a->gain[k];
    a->header[DETERMINED] = REAL(is_determined(a));
    a->header[WEIGHT] = factor * a->header[WEIGHT] + 1;
    a->header[FACTOR] = factor;
    a->header[TURN] = REAL(turn + 1 < a->n ? turn + 1 : 0);
    for (int i = turn; i < a->n + a->m; i += a->n) drop_underflow(a, i);
}

static int status(const rls_config *c, rls_real *state, rls_real *work)
{
    int bits = RLS_DETERMINED;
    state += groups_state(c);
    for (int g = 0; g < c->groups; g++) {
        const group a = open_group(c, g, state, work);
        if (a.header[DETERMINED] == 0) bits &= ~RLS_DETERMINED;
        if (a.header[WEIGHT] * EPSILON >= 1) bits |= RLS_SATURATED;
        state = end_of_state(&a);
    }
    return bits;
}

int rls_absorb(const rls_config *c, rls_real *state, rls_real *work, const rls_real *phi, const rls_real *y)
{
    rls_real *s = state + groups_state(c), *w = work + groups_work(c), *innovation = work + padded(rls_regressors(c));
    const int functions = c->basis.functions;
    for (int g = 0; g < c->groups; g++) {
        const group a = open_group(c, g, s, w);
        for (int i = 0; i < c->group[g].entries; i++)
            for (int k = 0; k < functions; k++) a.phi[i * functions + k] = phi[c->group[g].entry[i] * functions + k];
        learn(&c->forgetting, &a, c->group[g].output, y);
        for (int j = 0; j < a.m; j++) innovation[c->group[g].output[j]] = a.innovation[j];
        s = end_of_state(&a);
        w = end_of_work(&a);
    }
    state[COUNT] += 1;
    if (state[COUNT] >= REAL(MILLION)) {
        state[COUNT] = 0;
        state[MILLIONS] += 1;
    }
    return RLS_LEARNT | status(c, state, work);
}

/* One function of a factor at p, by Bernstein's form of the piece p lies in. */
static rls_real evaluate(const rls_factor *b, int function, rls_real p)
{
    int piece = 0;
    const rls_real *at;
    rls_real x, sum, up = 1;
    while (piece + 1 < b->pieces && p >= b->knot[piece + 1]) piece++;
    x = (p - b->knot[piece]) / (b->knot[piece + 1] - b->knot[piece]);
    at = b->bernstein + (piece * b->functions + function) * (b->degree + 1);
    sum = at[0];
    for (int i = 1; i <= b->degree; i++) {
        up *= x * (REAL(b->degree - i + 1) / REAL(i));
        sum = sum * (1 - x) + up * at[i];
    }
    return sum;
}

static void functions_at(const rls_basis *b, const rls_real *p, rls_real *f)
{
    for (int j = 0; j < b->functions; j++) {
        f[j] = 1;
        for (int i = 0; i < b->factors; i++) f[j] *= evaluate(&b->factor[i], b->index[j * b->factors + i], p[i]);
    }
}

static int is_outside(const rls_basis *b, const rls_real *p)
{
    for (int i = 0; i < b->factors; i++) {
        const rls_factor *one = &b->factor[i];
        if (p[i] < one->knot[0] - one->slack || p[i] > one->knot[one->pieces] + one->slack) return 1;
    }
    return 0;
}

static void regressor(const rls_config *c, const rls_real *past, rls_real *phi)
{
    const int width = row_width(c), p = c->outputs + c->inputs;
    for (int i = 0; i < c->entries; i++) {
        const rls_entry *e = &c->entry[i];
        const rls_real *then = past + e->lag * width, *f = past + e->p_lag * width + p + c->parameters;
        const rls_real signal = e->kind == RLS_OUTPUT   ? -then[e->channel]
                                : e->kind == RLS_INPUT  ? then[c->outputs + e->channel]
                                : e->kind == RLS_OFFSET ? 1
                                                        : past[p + e->channel] - then[p + e->channel];
        for (int k = 0; k < c->basis.functions; k++) *phi++ = signal * f[k];
    }
}

/* 0 usable, 1 missing, 2 refused */
static int defect(const rls_real *value, int count)
{
    int worst = 0;
    for (int i = 0; i < count; i++) {
        if (absolute(value[i]) > LARGEST) return 2;
        if (value[i] != value[i]) worst = 1;
    }
    return worst;
}

int rls_update_with(const rls_config *c, rls_real *state, rls_real *work, const rls_real *y, const rls_real *u, const rls_real *p,
                    const rls_real *f)
{
    rls_real *past = state + HEADER, *next = past;
    const int width = row_width(c), outside = is_outside(&c->basis, p);
    const int wrong = defect(y, c->outputs) | defect(u, c->inputs) | defect(p, c->parameters) | (f ? defect(f, c->basis.functions) : 0);
    if (wrong || outside) {
        rls_forget_past(state);
        return status(c, state, work) | (wrong >= 2 || outside ? RLS_REFUSED : 0);
    }
    for (int i = (c->memory + 1) * width - 1; i >= width; i--) past[i] = past[i - width];
    for (int j = 0; j < c->outputs; j++) *next++ = y[j];
    for (int j = 0; j < c->inputs; j++) *next++ = u[j];
    for (int j = 0; j < c->parameters; j++) *next++ = p[j];
    if (f)
        for (int j = 0; j < c->basis.functions; j++) *next++ = f[j];
    else
        functions_at(&c->basis, p, next);
    if (state[FILLED] < REAL(c->memory + 1)) state[FILLED] += 1;
    if (state[FILLED] < REAL(c->memory + 1)) return status(c, state, work);
    regressor(c, past, work);
    return rls_absorb(c, state, work, work, y);
}

int rls_update(const rls_config *c, rls_real *state, rls_real *work, const rls_real *y, const rls_real *u, const rls_real *p)
{
    return rls_update_with(c, state, work, y, u, p, 0);
}

void rls_forget_past(rls_real *state) { state[FILLED] = 0; }

void rls_coefficients(const rls_config *c, const rls_real *state, rls_real *theta)
{
    const int functions = c->basis.functions;
    state += groups_state(c);
    for (int i = rls_regressors(c) * c->outputs - 1; i >= 0; i--) theta[i] = 0;
    for (int g = 0; g < c->groups; g++) {
        const rls_group *own = &c->group[g];
        const int n = own->entries * functions, wide = padded(n + own->outputs), tall = padded(n);
        const rls_real *from = state + GROUP_HEADER + row_offset(n + own->outputs, wide) + wide;
        for (int j = 0; j < own->outputs; j++)
            for (int i = 0; i < n; i++)
                theta[(own->entry[i / functions] * functions + i % functions) * c->outputs + own->output[j]] = from[j * tall + i];
        state = from + (own->outputs + 3) * tall + 2 * padded(own->outputs);
    }
}

const rls_real *rls_innovation(const rls_config *c, const rls_real *work) { return work + padded(rls_regressors(c)); }
