/* See rls.h. Rotations after Gentleman (1973), Least squares computations by Givens transformations
   without square roots.

   All that is remembered of the data is the triangular factor [R, Z; 0, S], which nothing but data
   enters. The coefficients solve R theta = Z. From sample to sample they move along the gain,
   theta += R^-1 (R^-T phi) (y - phi' theta), with far less work; they are solved anew as soon as a
   running bound of what rounding has added since is no longer small, so that they never come apart
   from the factor. */
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
/* Samples with a regressor at its largest that are pretended, saying "coefficient 0": what the data
   leave open stays small, and rounding, which knows EPSILON^2, decides nothing. */
#define PRIOR (32 * EPSILON) /* identification/design/determined.py has the same */
#define ALONG 128 /* samples at most between two solutions of R theta = Z */
/* (rounding errors along the gain that are put up with, in units of EPSILON of the output)^2 */
#define TRUSTED (512 * 512)
#define MILLION 1048576 /* samples are counted in two numbers, each exact in single precision */

/* LANES numbers side by side. `LANEWISE EACH(a) += EACH(b);` adds them all, LANE(a, i) is one of
   them: in one vector where the processor has such long ones, else in parts of what it computes at
   once, and with the same result. */
#if defined(__GNUC__) && !defined(RLS_NO_VECTORS)
#define VECTOR(bytes) __attribute__((vector_size(bytes), aligned(sizeof(rls_real)), may_alias))
#if defined(__AVX512F__) || (defined(__AVX__) && defined(RLS_SINGLE))
#define WHOLE
#define TOGETHER LANES
typedef rls_real lanes VECTOR(LANES * sizeof(rls_real));
typedef lanes part;
#elif defined(__AVX__) || defined(RLS_SINGLE)
#define TOGETHER 4
typedef rls_real part VECTOR(TOGETHER * sizeof(rls_real));
#else
#define TOGETHER 2
typedef rls_real part VECTOR(TOGETHER * sizeof(rls_real));
#endif
#else
#define TOGETHER 1
typedef rls_real part;
#endif
#ifdef WHOLE
#define LANEWISE
#define EACH(of) (of)
#define LANE(of, i) (of)[i]
#else
typedef struct {
    part at[LANES / TOGETHER];
} lanes;
#define LANEWISE for (int k_ = 0; k_ < LANES / TOGETHER; k_++)
#define EACH(of) (of).at[k_]
#if TOGETHER == 1
#define LANE(of, i) (of).at[i]
#else
#define LANE(of, i) (of).at[(i) / TOGETHER][(i) % TOGETHER]
#endif
#endif

#if defined(__GNUC__)
#define INLINED inline __attribute__((always_inline))
#else
#define INLINED inline
#endif

/* Code for processors without long vectors runs at a quarter of its speed as long as anything is
   left in the upper halves of the registers; compilers forget to empty them here. */
#if defined(__GNUC__) && defined(__AVX__)
#define LEAVE_VECTORS() __builtin_ia32_vzeroupper()
#else
#define LEAVE_VECTORS() (void)0
#endif

static const lanes none; /* zeros */

/* Rows of a block that are worked on at a time: with more, the registers would not hold what they
   take, one or two numbers a row in all lanes. */
#define ROWS (TOGETHER > 2 ? TOGETHER : 2)

/* Lanes of two vectors, counted through, without a way through memory. */
#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define SHUFFLE __builtin_shufflevector
#endif
#endif

static inline lanes *lanes_at(rls_real *numbers) { return (lanes *)numbers; }

static inline const lanes *lanes_of(const rls_real *numbers) { return (const lanes *)numbers; }

/* Part by part, as every vector is copied here: a compiler copies a whole struct in shorter moves,
   and a load that finds its number in two stores waits for both to reach the cache. */
static INLINED lanes load(const rls_real *from)
{
    lanes v;
    LANEWISE EACH(v) = EACH(*lanes_of(from));
    return v;
}

static INLINED void store(lanes v, rls_real *to) { LANEWISE EACH(*lanes_at(to)) = EACH(v); }

/* Numbers that were computed one by one, side by side. */
static inline lanes gathered(const rls_real *t)
{
#if TOGETHER == 8
    return (lanes){t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7]};
#elif TOGETHER == 4
    return (lanes){{{t[0], t[1], t[2], t[3]}, {t[4], t[5], t[6], t[7]}}};
#else
    lanes v;
    for (int i = 0; i < LANES; i++) LANE(v, i) = t[i];
    return v;
#endif
}

/* Each lane becomes the sum of those up to it: neighbours first, then pairs, then fours. */
static inline void running_sums(lanes *v)
{
#if defined(SHUFFLE) && TOGETHER == 8
    *v += SHUFFLE(none, *v, 0, 8, 9, 10, 11, 12, 13, 14);
    *v += SHUFFLE(none, *v, 0, 1, 8, 9, 10, 11, 12, 13);
    *v += SHUFFLE(none, *v, 0, 1, 2, 3, 8, 9, 10, 11);
#elif defined(SHUFFLE) && TOGETHER == 4
    v->at[1] += SHUFFLE(v->at[0], v->at[1], 3, 4, 5, 6);
    v->at[0] += SHUFFLE(none.at[0], v->at[0], 0, 4, 5, 6);
    v->at[1] += SHUFFLE(v->at[0], v->at[1], 2, 3, 4, 5);
    v->at[0] += SHUFFLE(none.at[0], v->at[0], 0, 1, 4, 5);
    v->at[1] += v->at[0];
#else
    for (int step = 1; step < LANES; step *= 2)
        for (int i = LANES - 1; i >= step; i--) LANE(*v, i) += LANE(*v, i - step);
#endif
}

/* The lane before, and `first` before all. */
static inline void shift(lanes *v, rls_real first)
{
#if defined(SHUFFLE) && TOGETHER == 8
    *v = SHUFFLE(none + first, *v, 0, 8, 9, 10, 11, 12, 13, 14);
#elif defined(SHUFFLE) && TOGETHER == 4
    v->at[1] = SHUFFLE(v->at[0], v->at[1], 3, 4, 5, 6);
    v->at[0] = SHUFFLE(none.at[0] + first, v->at[0], 0, 4, 5, 6);
#else
    for (int i = LANES - 1; i > 0; i--) LANE(*v, i) = LANE(*v, i - 1);
    LANE(*v, 0) = first;
#endif
}

/* The sum of each of LANES vectors: lanes four apart first, then two, then neighbours. */
static INLINED lanes sums(const lanes *v)
{
#if defined(SHUFFLE) && TOGETHER == 8
    lanes four[4], two[2];
    for (int i = 0; i < 4; i++)
        four[i] = SHUFFLE(v[i], v[i + 4], 0, 1, 2, 3, 8, 9, 10, 11) +
                  SHUFFLE(v[i], v[i + 4], 4, 5, 6, 7, 12, 13, 14, 15);
    for (int i = 0; i < 2; i++)
        two[i] = SHUFFLE(four[i], four[i + 2], 0, 1, 8, 9, 4, 5, 12, 13) +
                 SHUFFLE(four[i], four[i + 2], 2, 3, 10, 11, 6, 7, 14, 15);
    return SHUFFLE(two[0], two[1], 0, 8, 2, 10, 4, 12, 6, 14) +
           SHUFFLE(two[0], two[1], 1, 9, 3, 11, 5, 13, 7, 15);
#elif defined(SHUFFLE) && TOGETHER == 4
    part four[LANES], two[LANES / 2];
    lanes one;
    for (int i = 0; i < LANES; i++) four[i] = v[i].at[0] + v[i].at[1];
    for (int k = 0; k < 2; k++) {
        for (int i = 4 * k; i < 4 * k + 2; i++)
            two[i - 2 * k] = SHUFFLE(four[i], four[i + 2], 0, 1, 4, 5) +
                             SHUFFLE(four[i], four[i + 2], 2, 3, 6, 7);
        one.at[k] = SHUFFLE(two[2 * k], two[2 * k + 1], 0, 4, 2, 6) +
                    SHUFFLE(two[2 * k], two[2 * k + 1], 1, 5, 3, 7);
    }
    return one;
#else
    lanes one;
    for (int i = 0; i < LANES; i++) {
        rls_real s[LANES];
        for (int j = 0; j < LANES; j++) s[j] = LANE(v[i], j);
        for (int half = LANES / 2; half > 0; half /= 2)
            for (int j = 0; j < half; j++) s[j] += s[j + half];
        LANE(one, i) = s[0];
    }
    return one;
#endif
}

/* State: this header, the past (memory + 1 rows of y, u, p, f(p), newest first), the groups. */
enum { COUNT, MILLIONS, FILLED, HEADER = LANES };
/* A group: this header, then the arrays of `group` up to `usual`. */
enum { WEIGHT, TURN, DETERMINED, STEPS, FACTOR, SINCE, GROUP_HEADER = LANES };

/* n regressors, m outputs; n and m rounded up to whole LANES are tall and high, together wide. The
   unit triangle has `wide` rows: n of the regressors and, from `tall` on, m of the outputs, the
   others empty; LANES of them are a block, whose rows all start at the column of its first
   diagonal. [R, Z; 0, S] = sqrt(d) triangle. */
typedef struct {
    int n, m, wide, tall, high;
    /* state */
    rls_real *header, *triangle, *d, *theta, *peak, *energy, *fed, *recent, *usual, *power, *drift;
    /* scratch */
    rls_real *phi, *x, *s, *gain, *solution, *innovation;
} group;

static int padded(int n) { return (n + LANES - 1) / LANES * LANES; }

static int block_start(int i) { return i / LANES * LANES; }

/* Where the block of rows from `start` on begins in a triangle with `wide` columns. */
static int block_offset(int start, int wide) { return start * wide - start * (start - LANES) / 2; }

static int row_width(const rls_config *c)
{
    return c->outputs + c->inputs + c->parameters + c->basis.functions;
}

static int past_size(const rls_config *c) { return padded((c->memory + 1) * row_width(c)); }

static group open_group(const rls_config *c, int g, rls_real *state, rls_real *work)
{
    group a;
    a.n = c->group[g].entries * c->basis.functions;
    a.m = c->group[g].outputs;
    a.tall = padded(a.n);
    a.high = padded(a.m);
    a.wide = a.tall + a.high;
    a.header = state;
    a.triangle = a.header + GROUP_HEADER;
    a.d = a.triangle + block_offset(a.wide, a.wide);
    a.theta = a.d + a.wide;
    a.peak = a.theta + a.m * a.tall;
    a.energy = a.peak + a.tall;
    a.fed = a.energy + a.tall;
    a.recent = a.fed + a.tall;
    a.usual = a.recent + a.high;
    a.power = a.usual + a.high;
    a.drift = a.power + a.high;
    a.phi = work;
    a.x = a.phi + a.tall;
    a.s = a.x + a.wide;
    a.gain = a.s + a.wide;
    a.solution = a.gain + a.tall;
    a.innovation = a.solution + a.tall * a.high;
    return a;
}

static rls_real *block_at(const group *a, int start)
{
    return a->triangle + block_offset(start, a->wide);
}

/* Entry (i, j) of the triangle, j at or behind the start of the block of row i. */
static rls_real *entry(const group *a, int i, int j)
{
    const int start = block_start(i);
    return block_at(a, start) + (i - start) * (a->wide - start) + j - start;
}

static rls_real *end_of_state(const group *a) { return a->drift + a->high; }

static rls_real *end_of_work(const group *a) { return a->innovation + a->high; }

static int groups_state(const rls_config *c) { return HEADER + past_size(c); }

static int groups_work(const rls_config *c)
{
    return padded(rls_regressors(c)) + padded(c->outputs);
}

int rls_regressors(const rls_config *c) { return c->entries * c->basis.functions; }

int rls_state_size(const rls_config *c)
{
    int size = groups_state(c);
    for (int g = 0; g < c->groups; g++) {
        const int tall = padded(c->group[g].entries * c->basis.functions),
                  high = padded(c->group[g].outputs), wide = tall + high;
        size += GROUP_HEADER + block_offset(wide, wide) + wide + (c->group[g].outputs + 3) * tall +
                4 * high;
    }
    return size;
}

int rls_work_size(const rls_config *c)
{
    int size = groups_work(c);
    for (int g = 0; g < c->groups; g++) {
        const int tall = padded(c->group[g].entries * c->basis.functions),
                  high = padded(c->group[g].outputs);
        size += 2 * tall + 2 * (tall + high) + tall * high + high;
    }
    return size;
}

/* Rows of no regressor and no output weigh 1, so that nothing divides by 0. */
static inline void fill_empty_rows(const group *a)
{
    for (int i = a->n; i < a->tall; i++) a->d[i] = 1;
    for (int i = a->tall + a->m; i < a->wide; i++) a->d[i] = 1;
}

void rls_init(const rls_config *c, rls_real *state, rls_real *work)
{
    for (int i = rls_state_size(c) - 1; i >= 0; i--) state[i] = 0;
    for (int i = rls_work_size(c) - 1; i >= 0; i--) work[i] = 0;
    state += groups_state(c);
    for (int g = 0; g < c->groups; g++) {
        const group a = open_group(c, g, state, work);
        for (int i = 0; i < a.wide; i++) *entry(&a, i, i) = 1;
        fill_empty_rows(&a);
        state = end_of_state(&a);
    }
}

static inline rls_real absolute(rls_real a) { return a > -a ? a : -a; }

/* For each of `count` rows a, ROWS at most: a'b in LANES partial sums, from the last column on. */
static INLINED void partial_sums(const rls_real *rows, int stride, int count, const rls_real *b,
                                 int length, lanes *sums)
{
    lanes s[ROWS];
    for (int i = 0; i < count; i++) LANEWISE EACH(s[i]) = EACH(none);
    for (int k = length - LANES; k >= 0; k -= LANES)
        for (int i = 0; i < count; i++)
            LANEWISE EACH(s[i]) += EACH(*lanes_of(b + k)) * EACH(*lanes_of(rows + i * stride + k));
    for (int i = 0; i < count; i++) LANEWISE EACH(sums[i]) = EACH(s[i]);
}

/* a'b for each of `count` rows a of a matrix, LANES at most; 0 for the rest of LANES. */
static INLINED lanes times(const rls_real *rows, int stride, int count, const rls_real *b,
                           int length)
{
    lanes s[LANES];
    int i = 0;
    /* a usual number, as a constant for the compiler */
    for (; i + ROWS <= count; i += ROWS)
        partial_sums(rows + i * stride, stride, ROWS, b, length, s + i);
    for (; i < count; i++) partial_sums(rows + i * stride, stride, 1, b, length, s + i);
    for (; i < LANES; i++) LANEWISE EACH(s[i]) = EACH(none);
    return sums(s);
}

/* LANES columns of ROWS rows of a block: for each row i in turn x <- x - lead[i] row, row <- row +
   gain[i] x. */
static inline void rotate(rls_real *block, int stride, rls_real *x, const rls_real *lead,
                          const rls_real *gain)
{
    lanes t = load(x);
    for (int i = 0; i < ROWS; i++) {
        lanes row = load(block + i * stride);
        LANEWISE EACH(t) -= lead[i] * EACH(row);
        LANEWISE EACH(row) += gain[i] * EACH(t);
        store(row, block + i * stride);
    }
    store(t, x);
}

/* What x becomes by that, the block left as it is. */
static INLINED void reduce(const rls_real *block, int stride, lanes *x, const rls_real *lead)
{
    for (int i = 0; i < LANES; i++)
        LANEWISE EACH(*x) -= lead[i] * EACH(*lanes_of(block + i * stride));
}

/* A row of which little is kept, where row + gain x would cancel: row <- keep row + gain x. */
static inline void renew(rls_real *restrict row, rls_real *restrict x, int length, rls_real lead,
                         rls_real gain, rls_real keep)
{
    for (int k = 0; k < length; k++) {
        const rls_real r = row[k], t = x[k];
        x[k] = t - lead * r;
        row[k] = keep * r + gain * t;
    }
}

/* A measurement of so much weight, and one over it. */
typedef struct {
    rls_real inverse, value;
} weight;

/* The entry t of x that each row of a block eliminates, 0 from row `rows` on. Each waits for the
   one before it: numbers one by one wait less than vectors do. */
static INLINED void eliminate(const rls_real *block, int stride, int rows, lanes x, rls_real *t)
{
    for (int i = 0; i < LANES; i++) t[i] = LANE(x, i);
#define LESS(j, i) t[j] -= t[i] * block[(i) * stride + (j)]
    LESS(1, 0);
    LESS(2, 0); LESS(2, 1);
    LESS(3, 0); LESS(3, 1); LESS(3, 2);
    LESS(4, 0); LESS(4, 1); LESS(4, 2); LESS(4, 3);
    LESS(5, 0); LESS(5, 1); LESS(5, 2); LESS(5, 3); LESS(5, 4);
    LESS(6, 0); LESS(6, 1); LESS(6, 2); LESS(6, 3); LESS(6, 4); LESS(6, 5);
    LESS(7, 0); LESS(7, 1); LESS(7, 2); LESS(7, 3); LESS(7, 4); LESS(7, 5); LESS(7, 6);
#undef LESS
    for (int i = 0; i < LANES; i++) t[i] = i < rows ? t[i] : 0;
}

/* What that does to a block of rows: d, and the gain. 0 where a row may have to be renewed: then
   nothing has changed. */
static INLINED int weigh(lanes lead, rls_real *d, rls_real kept, weight *w, lanes *gain)
{
    lanes old = load(d), ratio, sum, over = old;
    rls_real least = 1, value;
    LANEWISE EACH(old) *= kept;
    for (int i = 0; i < LANES; i++) least = LANE(old, i) < least ? LANE(old, i) : least;
    LANEWISE EACH(ratio) = EACH(lead) / EACH(old);
    LANEWISE EACH(sum) = EACH(lead) * EACH(ratio);
    running_sums(&sum);
    LANEWISE EACH(sum) += w->inverse;
    if (!(LANE(sum, LANES - 1) <= 4 * w->inverse && least > TINY)) return 0;
    LANEWISE EACH(over) = REAL(1) / EACH(sum);
    LANEWISE EACH(*gain) = EACH(ratio) * EACH(over);
    value = LANE(over, LANES - 1);
    shift(&over, w->value);
    LANEWISE EACH(*lanes_at(d)) = EACH(old) + EACH(lead) * (EACH(lead) * EACH(over));
    w->inverse = LANE(sum, LANES - 1);
    w->value = value;
    return 1;
}

/* The same row by row, where one is new or of little weight: its old content goes, or cancels. */
static void renew_rows(const group *a, int start, int rows, rls_real kept, weight *w)
{
    const int length = a->wide - start;
    rls_real *x = a->x + start, *row = block_at(a, start);
    for (int i = 0; i < rows; i++, row += length) {
        const rls_real f = x[i], d = kept * a->d[start + i], ratio = f / d,
                       sum = w->inverse + f * ratio;
        rls_real gain = 0;
        if (f == 0 || (d <= TINY && absolute(f) < TINY)) {
            a->d[start + i] = d;
        } else if (sum <= 4 * w->inverse && d > TINY) {
            gain = ratio * (1 / sum);
            for (int k = 0; k < length; k++) {
                x[k] -= f * row[k];
                row[k] += gain * x[k];
            }
            a->d[start + i] = d + f * (f * w->value);
            w->inverse = sum;
        } else if (d > TINY) {
            gain = ratio * (1 / sum);
            renew(row, x, length, f, gain, w->inverse * (1 / sum));
            row[i] = 1;
            a->d[start + i] = d + f * (f * w->value);
            w->inverse = sum;
        } else {
            /* nothing is known here: all of x is explained, and what would be left of it is
               rounding that must teach no other row */
            gain = 1 / f;
            for (int k = 0; k < length; k++) {
                row[k] = gain * x[k];
                x[k] = 0;
            }
            row[i] = 1;
            a->d[start + i] = f * (f * w->value);
        }
        w->value = 1 / w->inverse;
        a->s[start + i] = gain;
    }
}

/* Rotate x, of weight w, into rows first .. last - 1, whose information is first multiplied by
   `kept`; x is 0 before `first`. s gets R^-T phi in the scale of the triangle. What the next block
   eliminates is found before this one is changed: the chain of eliminations is the longest there
   is, and a processor does the rest beside it. Where rows were renewed x may have been explained
   in full: then it is found afterwards. */
static inline void sweep(const group *a, int first, int last, rls_real kept, rls_real w)
{
    weight left = {1 / w, w};
    int start = block_start(first);
    rls_real lead[LANES];
    eliminate(block_at(a, start), a->wide - start, last - start, load(a->x + start), lead);
    for (; start < last; start += LANES) {
        const int length = a->wide - start, rest = last - start - LANES;
        rls_real *x = a->x + start, *block = block_at(a, start), *below = block + LANES * length,
                 leads[LANES], gains[LANES];
        const lanes now = gathered(lead);
        lanes gain;
        if (weigh(now, a->d + start, kept, &left, &gain)) {
            store(now, leads);
            store(gain, gains);
            store(gain, a->s + start);
            if (rest > 0) {
                lanes t = load(x + LANES);
                reduce(block + LANES, length, &t, lead);
                eliminate(below, length - LANES, rest, t, lead);
            }
            for (int i = 0; i < LANES; i += ROWS)
                for (int k = 0; k < length; k += LANES)
                    rotate(block + i * length + k, length, x + k, leads + i, gains + i);
        } else {
            renew_rows(a, start, rest < 0 ? rest + LANES : LANES, kept, &left);
            if (rest > 0) eliminate(below, length - LANES, rest, load(x + LANES), lead);
        }
    }
}

/* Solve with the unit triangle of a block of rows: t <- block^-1 t. Each entry waits for the one
   after it: numbers one by one wait less than vectors do. */
static inline void solve(const rls_real *block, int stride, rls_real *t)
{
#define LESS(i, k) t[i] -= block[(i) * stride + (k)] * t[k]
    LESS(6, 7);
    LESS(5, 7); LESS(5, 6);
    LESS(4, 7); LESS(4, 6); LESS(4, 5);
    LESS(3, 7); LESS(3, 6); LESS(3, 5); LESS(3, 4);
    LESS(2, 7); LESS(2, 6); LESS(2, 5); LESS(2, 4); LESS(2, 3);
    LESS(1, 7); LESS(1, 6); LESS(1, 5); LESS(1, 4); LESS(1, 3); LESS(1, 2);
    LESS(0, 7); LESS(0, 6); LESS(0, 5); LESS(0, 4); LESS(0, 3); LESS(0, 2); LESS(0, 1);
#undef LESS
}

/* gain <- triangle^-1 s. The longest chain there is goes from a block to the one above it: that
   product comes last, and from registers. */
static inline void find_gain(const group *a)
{
    lanes below;
    LANEWISE EACH(below) = EACH(none);
    for (int start = a->tall - LANES; start >= 0; start -= LANES) {
        const int length = a->wide - start, behind = a->tall - start - 2 * LANES;
        const rls_real *block = block_at(a, start);
        lanes right, s[LANES];
        rls_real t[LANES];
        for (int i = 0; i < LANES; i += ROWS)
            partial_sums(block + i * length + 2 * LANES, length, ROWS,
                         a->gain + start + 2 * LANES, behind, s + i);
        if (behind >= 0)
            for (int i = 0; i < LANES; i++)
                LANEWISE EACH(s[i]) +=
                    EACH(below) * EACH(*lanes_of(block + i * length + LANES));
        right = sums(s);
        LANEWISE EACH(right) = EACH(*lanes_of(a->s + start)) - EACH(right);
        for (int i = 0; i < LANES; i++) t[i] = LANE(right, i);
        solve(block, length, t);
        below = gathered(t);
        store(below, a->gain + start);
    }
}

/* Outputs `from` on, TOGETHER of them: solution (tall, high) <- R^-1 Z, products subtracted from
   the last column on. */
static inline void back_substitute(const group *a, int from)
{
    for (int start = a->tall - LANES; start >= 0; start -= LANES) {
        const int length = a->wide - start;
        const rls_real *block = block_at(a, start);
        part t[LANES];
        for (int i = 0; i < LANES; i++)
            t[i] = *(const part *)(block + i * length + a->tall - start + from);
        for (int k = a->tall - 1; k >= start + LANES; k--) {
            const part known = *(const part *)(a->solution + k * a->high + from);
            for (int i = 0; i < LANES; i++) t[i] -= block[i * length + k - start] * known;
        }
        for (int k = LANES - 1; k > 0; k--)
            for (int i = 0; i < k; i++) t[i] -= block[i * length + k] * t[k];
        for (int i = 0; i < LANES; i++)
            *(part *)(a->solution + (start + i) * a->high + from) = t[i];
    }
}

/* So much is known that an ordinary sample is lost to rounding: single precision that never
   forgets. */
static inline int is_full(const group *a) { return a->header[WEIGHT] * EPSILON >= 1; }

/* theta <- R^-1 Z. A factor that is full has lost samples; what has moved along the gain since is
   better. */
static void solve_anew(const group *a)
{
    if (is_full(a)) return;
    for (int from = 0; from < a->m; from += TOGETHER) back_substitute(a, from);
    for (int j = 0; j < a->m; j++) {
        a->drift[j] = 0;
        for (int i = 0; i < a->n; i++) a->theta[j * a->tall + i] = a->solution[i * a->high + j];
    }
    a->header[SINCE] = 0;
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

/* The fastest a coefficient forgets that nothing excites. */
static inline rls_real fastest(const rls_forgetting *f)
{
    return f->kind == RLS_DIRECTIONAL ? 1 : f->kind == RLS_VARIABLE ? f->lowest : f->factor;
}

/* The information that coefficients are kept awake with, in samples with a regressor at its
   largest: enough that the floor still stands when half of it and then n samples more are
   forgotten. */
static inline rls_real wakefulness(const rls_forgetting *f, int n)
{
    rls_real kept, floor;
    if (fastest(f) == 1) return PRIOR;
    kept = power(fastest(f), n);
    floor = 2 * f->floor / (kept > REAL(1e-12) ? kept : REAL(1e-12));
    return floor > PRIOR ? floor : PRIOR;
}

/* The largest ratio of a regressor to its largest. */
static inline rls_real loudness(const group *a)
{
    rls_real loudest = 0;
    for (int i = 0; i < a->n; i++)
        if (absolute(a->phi[i]) > loudest * a->peak[i]) loudest = absolute(a->phi[i]) / a->peak[i];
    return loudest;
}

/* Multiply the information along phi by `factor`, and leave what is known of all other directions:
   R'DR - (1 - factor) v v' / phi'v with v = R'DR phi. Source: Cao and Schwartz (2000), A
   directional forgetting algorithm based on the decomposition of the information matrix. */
static inline void forget_direction(const group *a, rls_real factor)
{
    rls_real length2 = 0, share, left = factor;
    for (int start = 0; start < a->tall; start += LANES)
        store(times(block_at(a, start), a->wide - start, LANES, a->phi + start, a->tall - start),
              a->s + start);
    for (int i = 0; i < a->n; i++) length2 += a->d[i] * (a->s[i] * a->s[i]);
    if (!(length2 > TINY)) return;
    share = (1 - factor) / length2;
    for (int k = 0; k < a->wide; k++) a->x[k] = 0;
    for (int i = a->n - 1; i >= 0; i--) {
        const int start = block_start(i);
        const rls_real more = left + share * (a->d[i] * (a->s[i] * a->s[i])),
                       out = share * a->s[i] / left, in = a->d[i] * a->s[i];
        rls_real *restrict row = entry(a, i, start), *restrict x = a->x + start;
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
    return a->header[STEPS] > 0 ||
           (a->header[DETERMINED] != 0 &&
            (weight >= REAL(2 * a->n) || 2 * weight * (1 - f->factor) >= 1));
}

/* A sample counts in the usual power no more than tenfold, and what is usual comes down with what
   is recent: a jump or an outlier does not pass for usual. Source of the variable factor:
   Fortescue, Kershenbaum and Ydstie (1981), with both powers taken from the innovations. */
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
        a->usual[j] +=
            usual * ((power < 10 * a->usual[j] ? power : 10 * a->usual[j]) - a->usual[j]);
        if (a->usual[j] > 4 * a->recent[j]) a->usual[j] = 4 * a->recent[j];
        ratio += a->usual[j] > 0 ? a->recent[j] / a->usual[j] : 1;
    }
    factor = 1 - (1 - f->factor) * (ratio / REAL(a->m));
    return factor < f->lowest ? f->lowest : factor > f->factor ? f->factor : factor;
}

/* A measurement of coefficient j that says 0, of what weight is missing to `target`, rotated into
   the rows up to `last`. Up to n, x ends as minus the coefficients. */
static inline void feed(const group *a, int j, rls_real target, int last)
{
    const rls_real more = target - a->fed[j];
    for (int k = 0; k < a->wide; k++) a->x[k] = 0;
    a->x[j] = 1;
    sweep(a, j, last, 1, more);
    a->energy[j] += more;
    a->fed[j] = target;
}

/* Make up for what coefficient j has lost, as soon as half of what is pretended of it is gone, n
   samples after its last turn at the earliest. One that is kept awake gets a measurement that says
   "as it is now" and moves no coefficient: what outputs that leave no residual would have added to
   one that says 0 follows. Else what is pretended goes on saying 0: little, but it moves them. */
static inline void replenish(const group *a, rls_real samples, int j, int kept_awake)
{
    const rls_real target = samples * (a->peak[j] * a->peak[j]);
    if (2 * a->fed[j] >= target) return;
    if (kept_awake) {
        feed(a, j, target, a->n);
        for (int i = j; i < a->n; i++) {
            rls_real *z = entry(a, i, a->tall);
            for (int k = 0; k < a->m; k++) z[k] -= a->s[i] * a->x[a->tall + k];
        }
    } else {
        feed(a, j, target, a->tall + a->m);
        solve_anew(a);
    }
}

/* The largest regressors one has to expect: a signal as large as any so far, times its functions at
   their largest. The coefficients of a signal that is seen for the first time are kept awake from
   the start, at the 0 they have, lest the first samples make them wild: nothing is in their rows
   and columns yet. And so, at once, are those of one that has only whispered until now: by less,
   where little is pretended. */
static inline void new_peaks(const rls_basis *b, const group *a, rls_real samples, int kept_awake)
{
    const rls_real louder = REAL(kept_awake ? 100 : 4);
    int larger = 0, fed = 0;
    for (int i = 0; i < a->tall; i++) larger += absolute(a->phi[i]) > a->peak[i];
    for (int i = 0; larger && i < a->n; i += b->functions) {
        const int fresh = a->peak[i] == 0;
        rls_real signal = 0;
        for (int k = 0; k < b->functions; k++)
            if (absolute(a->phi[i + k]) > signal * b->largest[k])
                signal = absolute(a->phi[i + k]) / b->largest[k];
        /* what is pretended of it would underflow: it is not there */
        if (!(samples * (signal * signal) > TINY)) {
            for (int k = i; k < i + b->functions; k++) a->phi[k] = 0;
            continue;
        }
        if (signal * b->largest[0] <= a->peak[i]) continue;
        for (int k = i; k < i + b->functions; k++) {
            rls_real target;
            a->peak[k] = signal * b->largest[k - i];
            target = samples * (a->peak[k] * a->peak[k]);
            if (fresh)
                a->d[k] = a->energy[k] = a->fed[k] = target;
            else if (target > louder * a->fed[k]) {
                feed(a, k, target, a->tall + a->m);
                fed = 1;
            }
        }
    }
    if (fed) solve_anew(a);
}

/* Information that is about to underflow is dropped. */
static inline void drop_underflow(const group *a, int j)
{
    const int start = block_start(j);
    rls_real *row = entry(a, j, start);
    for (int k = 0; k < a->wide - start; k++) row[k] = absolute(row[k]) < TINY ? 0 : row[k];
    if (a->d[j] < TINY) a->d[j] = 0;
    if (j < a->n && a->energy[j] < TINY) a->energy[j] = 0;
    if (j < a->n && a->fed[j] < TINY) a->fed[j] = 0;
}

/* Whether column i of R stands out of the span of those before it: by more than rounding lets us
   see of all it has been, and by more than what is pretended.
   identification/design/determined.py is the same rule for a batch. */
static inline int is_known(const group *a, int i, rls_real beyond)
{
    return (a->d[i] > EPSILON * a->energy[i]) & (a->d[i] > beyond * a->fed[i]);
}

/* Whether every coefficient is known: what is pretended decides less than a thousandth of it. Where
   it is kept awake with more, a third at first; and what was known stays so on what takes the place
   of what is forgotten. */
static inline int is_determined(const group *a, int kept_awake)
{
    const rls_real beyond = REAL(kept_awake ? (a->header[DETERMINED] != 0 ? 0 : 2) : 1000);
    int known = 0;
    for (int i = 0; i < a->n; i++) known += is_known(a, i, beyond);
    return known == a->n;
}

static inline void predict(const group *a, const int *output, const rls_real *y)
{
    for (int j = 0; j < a->m; j += LANES) {
        const int count = a->m - j < LANES ? a->m - j : LANES;
        lanes prediction = times(a->theta + j * a->tall, a->tall, count, a->phi, a->tall);
        for (int i = 0; i < count; i++)
            a->innovation[j + i] = y[output[j + i]] - LANE(prediction, i);
    }
}

/* A running error analysis: an error of the gain g is backward stable, |R dg| <= EPSILON |R| |g|,
   and what has gone wrong before, R dtheta, grows no more with what is learnt after. Where the
   bound, over what the outputs measure, is not small any longer, theta is solved anew. */
static inline void correct(const group *a)
{
    rls_real error = 0;
    int small = 1;
    lanes sum;
    LANEWISE EACH(sum) = EACH(none);
    for (int k = 0; k < a->tall; k += LANES)
        LANEWISE EACH(sum) += EACH(*lanes_of(a->energy + k)) *
                              (EACH(*lanes_of(a->gain + k)) * EACH(*lanes_of(a->gain + k)));
    for (int i = 0; i < LANES; i++) error += LANE(sum, i);
    a->header[SINCE] += 1;
    for (int j = 0; j < a->m; j++) {
        rls_real *theta = a->theta + j * a->tall;
        const rls_real innovation = a->innovation[j];
        for (int k = 0; k < a->tall; k += LANES)
            LANEWISE EACH(*lanes_at(theta + k)) += innovation * EACH(*lanes_of(a->gain + k));
    }
    for (int j = 0; j < a->m; j++) {
        a->drift[j] += error * (a->innovation[j] * a->innovation[j]);
        small &= a->header[SINCE] * a->drift[j] <= TRUSTED * a->power[j];
    }
    if (!small || a->header[SINCE] >= ALONG) solve_anew(a);
}

static void learn(const rls_forgetting *f, const rls_basis *b, const group *a, const int *output,
                  const rls_real *y)
{
    const rls_real samples = wakefulness(f, a->n);
    const int turn = (int)a->header[TURN], kept_awake = samples > PRIOR;
    rls_real factor, kept;
    replenish(a, samples, turn, kept_awake);
    new_peaks(b, a, samples, kept_awake);
    predict(a, output, y);
    factor = forgetting_factor(f, a);
    kept = f->kind == RLS_DIRECTIONAL ? 1 : factor;
    if (factor < kept) {
        forget_direction(a, factor);
        for (int j = 0; j < a->m; j++) a->d[a->tall + j] *= factor;
    }
    for (int k = 0; k < a->tall; k++) a->x[k] = a->phi[k];
    for (int j = 0; j < a->high; j++) a->x[a->tall + j] = j < a->m ? y[output[j]] : 0;
    for (int j = 0; j < a->high; j++) {
        a->power[j] = factor * a->power[j] + a->x[a->tall + j] * a->x[a->tall + j];
        a->power[j] = a->power[j] < TINY ? 0 : a->power[j];
    }
    sweep(a, 0, a->tall + a->m, kept, 1);
    fill_empty_rows(a);
    for (int k = 0; k < a->tall; k++) {
        a->energy[k] = kept * a->energy[k] + a->phi[k] * a->phi[k];
        a->fed[k] *= kept;
    }
    find_gain(a);
    correct(a);
    a->header[DETERMINED] = REAL(is_determined(a, kept_awake));
    a->header[WEIGHT] = factor * a->header[WEIGHT] + 1;
    a->header[FACTOR] = factor;
    a->header[TURN] = REAL(turn + 1 < a->n ? turn + 1 : 0);
    for (int i = turn; i < a->wide; i += a->n) drop_underflow(a, i);
}

static int status(const rls_config *c, rls_real *state, rls_real *work)
{
    int bits = RLS_DETERMINED;
    state += groups_state(c);
    for (int g = 0; g < c->groups; g++) {
        const group a = open_group(c, g, state, work);
        if (a.header[DETERMINED] == 0) bits &= ~RLS_DETERMINED;
        if (is_full(&a)) bits |= RLS_SATURATED;
        state = end_of_state(&a);
    }
    return bits;
}

int rls_absorb(const rls_config *c, rls_real *state, rls_real *work, const rls_real *phi,
               const rls_real *y)
{
    rls_real *s = state + groups_state(c), *w = work + groups_work(c),
             *innovation = work + padded(rls_regressors(c));
    const int functions = c->basis.functions;
    for (int g = 0; g < c->groups; g++) {
        const group a = open_group(c, g, s, w);
        if (a.n == rls_regressors(c)) /* all of them, in order */
            for (int i = 0; i < a.n; i++) a.phi[i] = phi[i];
        else
            for (int i = 0; i < c->group[g].entries; i++)
                for (int k = 0; k < functions; k++)
                    a.phi[i * functions + k] = phi[c->group[g].entry[i] * functions + k];
        learn(&c->forgetting, &c->basis, &a, c->group[g].output, y);
        for (int j = 0; j < a.m; j++) innovation[c->group[g].output[j]] = a.innovation[j];
        s = end_of_state(&a);
        w = end_of_work(&a);
    }
    state[COUNT] += 1;
    if (state[COUNT] >= REAL(MILLION)) {
        state[COUNT] = 0;
        state[MILLIONS] += 1;
    }
    LEAVE_VECTORS();
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
        for (int i = 0; i < b->factors; i++)
            f[j] *= evaluate(&b->factor[i], b->index[j * b->factors + i], p[i]);
    }
}

static int is_outside(const rls_basis *b, const rls_real *p)
{
    for (int i = 0; i < b->factors; i++) {
        const rls_factor *one = &b->factor[i];
        if (p[i] < one->knot[0] - one->slack || p[i] > one->knot[one->pieces] + one->slack)
            return 1;
    }
    return 0;
}

static void regressor(const rls_config *c, const rls_real *past, rls_real *phi)
{
    const int width = row_width(c), p = c->outputs + c->inputs;
    for (int i = 0; i < c->entries; i++) {
        const rls_entry *e = &c->entry[i];
        const rls_real *then = past + e->lag * width,
                       *f = past + e->p_lag * width + p + c->parameters;
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

int rls_update_with(const rls_config *c, rls_real *state, rls_real *work, const rls_real *y,
                    const rls_real *u, const rls_real *p, const rls_real *f)
{
    rls_real *past = state + HEADER, *next = past;
    const int width = row_width(c), outside = is_outside(&c->basis, p);
    const int wrong = defect(y, c->outputs) | defect(u, c->inputs) | defect(p, c->parameters) |
                      (f ? defect(f, c->basis.functions) : 0);
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

int rls_update(const rls_config *c, rls_real *state, rls_real *work, const rls_real *y,
               const rls_real *u, const rls_real *p)
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
        const int n = own->entries * functions, tall = padded(n), high = padded(own->outputs),
                  wide = tall + high;
        const rls_real *from = state + GROUP_HEADER + block_offset(wide, wide) + wide;
        for (int j = 0; j < own->outputs; j++)
            for (int i = 0; i < n; i++)
                theta[(own->entry[i / functions] * functions + i % functions) * c->outputs +
                      own->output[j]] = from[j * tall + i];
        state = from + (own->outputs + 3) * tall + 4 * high;
    }
}

const rls_real *rls_innovation(const rls_config *c, const rls_real *work)
{
    return work + padded(rls_regressors(c));
}
