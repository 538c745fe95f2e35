/* Elementary functions in double precision without branches, so that a loop over lanes becomes
   vector code: the same bits in any lane, at any width and on any processor that has fused
   multiply-adds. Within 2 units in the last place; not a number in, not a number out.

   Polynomials of sine, cosine, arc sine and arc tangent: fdlibm (Sun Microsystems, 1993). */

#if defined(__FMA__) || defined(__ARM_FEATURE_FMA) || defined(__aarch64__)
#define HAS_FMA 1
#define FUSED(a, b, c) __builtin_fma(a, b, c)
#else
#define HAS_FMA 0
#define FUSED(a, b, c) ((a) * (b) + (c))
#endif

#define ELEMENTARY __attribute__((always_inline, unused)) static inline

/* Whether FUSED rounds once. */
int has_fma(void) { return HAS_FMA; }

/* Added and taken off again it leaves the nearest integer, which its low bits hold in between. */
static const double ELEMENTARY_ROUND = 0x1.8p52;

/* Sine of hi + lo, |hi| <= pi/4. */
ELEMENTARY double elementary_sine(double hi, double lo)
{
  const double z = hi * hi, cube = z * hi;
  double p = FUSED(z, 1.58969099521155010221e-10, -2.50507602534068634195e-08);
  p = FUSED(z, p, 2.75573137070700676789e-06);
  p = FUSED(z, p, -1.98412698298579493134e-04);
  p = FUSED(z, p, 8.33333333332248946124e-03);
  const double rest = FUSED(z, FUSED(cube, p, -0.5 * lo), lo);
  return hi + FUSED(cube, -1.66666666666666324348e-01, rest);
}

/* Cosine of hi + lo, |hi| <= pi/4. */
ELEMENTARY double elementary_cosine(double hi, double lo)
{
  const double z = hi * hi, half = 0.5 * z, most = 1.0 - half;
  double p = FUSED(z, -1.13596475577881948265e-11, 2.08757232129817482790e-09);
  p = FUSED(z, p, -2.75573143513906633035e-07);
  p = FUSED(z, p, 2.48015872894767294178e-05);
  p = FUSED(z, p, -1.38888888888741095749e-03);
  p = FUSED(z, p, 4.16666666666666019037e-02);
  return most + (((1.0 - most) - half) + FUSED(z * z, p, -hi * lo));
}

/* x rad less the nearest multiple of pi/2 as hi + lo, and that multiple modulo 4 (-2 .. 2); pi/2 in
   three parts of 33 bits (Cody and Waite), so exact to the last place up to 2^20 pi/2 = 1.6e6 rad.
   Beyond that not a number. */
ELEMENTARY double elementary_reduced(double x, double *lo, double *quadrant)
{
  const double nearest =
      FUSED(x, 6.36619772367581382433e-01, ELEMENTARY_ROUND) - ELEMENTARY_ROUND;
  const double k = fabs(nearest) <= 0x1p20 ? nearest : NAN;
  const double first = FUSED(-k, 1.57079632673412561417e+00, x);
  const double second = k * 6.07710050630396597660e-11, hi = first - second;
  /* what the difference lost, whichever of the two was larger */
  const double back = hi - first, lost = (first - (hi - back)) - (second + back);
  *lo = FUSED(-k, 2.02226624879595063154e-21, lost);
  *quadrant = FUSED(-4.0, FUSED(k, 0.25, ELEMENTARY_ROUND) - ELEMENTARY_ROUND, k);
  return hi;
}

/* Sine, |x| <= 1.6e6 rad. */
ELEMENTARY double elementary_sin(double x)
{
  double lo, quadrant;
  const double hi = elementary_reduced(x, &lo, &quadrant);
  const double s = elementary_sine(hi, lo), c = elementary_cosine(hi, lo);
  const double value = x == 0.0 ? x : fabs(quadrant) == 1.0 ? c : s; /* sin -0 is -0 */
  return quadrant == -1.0 || fabs(quadrant) == 2.0 ? -value : value;
}

/* Cosine, |x| <= 1.6e6 rad. */
ELEMENTARY double elementary_cos(double x)
{
  double lo, quadrant;
  const double hi = elementary_reduced(x, &lo, &quadrant);
  const double s = elementary_sine(hi, lo), c = elementary_cosine(hi, lo);
  const double value = fabs(quadrant) == 1.0 ? s : c;
  return quadrant == 1.0 || fabs(quadrant) == 2.0 ? -value : value;
}

/* Arc sine, rad; not a number beyond -1 .. 1. */
ELEMENTARY double elementary_asin(double x)
{
  const double a = fabs(x);
  const int small = a < 0.5; /* else asin a = pi/2 - 2 asin sqrt((1 - a)/2) */
  const double z = small ? a * a : 0.5 * (1.0 - a);
  const double s = small ? a : sqrt(z);
  double p = FUSED(z, 3.47933107596021167570e-05, 7.91534994289814532176e-04);
  p = FUSED(z, p, -4.00555345006794114027e-02);
  p = FUSED(z, p, 2.01212532134862925881e-01);
  p = FUSED(z, p, -3.25565818622400915405e-01);
  p = FUSED(z, p, 1.66666666666666657415e-01);
  double q = FUSED(z, 7.70381505559019352791e-02, -6.88283971605453293030e-01);
  q = FUSED(z, q, 2.02094576023350569471e+00);
  q = FUSED(z, q, -2.40339491173441421878e+00);
  q = FUSED(z, q, 1.0);
  const double ratio = z * p / q;
  /* what the root lost */
  const double lost = s > 0.0 ? FUSED(-s, s, z) / (s + s) : 0.0;
  const double low = FUSED(2.0 * s, ratio, FUSED(2.0, lost, -6.12323399573676603587e-17));
  const double large = 7.85398163397448309616e-01 -
                       (low - FUSED(-2.0, s, 7.85398163397448309616e-01));
  return copysign(small ? FUSED(s, ratio, s) : large, x);
}

/* Angle of the point (x, y), -pi .. pi rad, |x| and |y| below 8e307; the sign of a zero counts as
   in C. */
ELEMENTARY double elementary_atan2(double y, double x)
{
  const double a = fabs(y), b = fabs(x);
  const int steep = b < a, left = copysign(1.0, x) < 0.0;
  const double least = steep ? b : a, most = steep ? a : b;
  /* above tan pi/8: atan t = pi/4 + atan (t - 1)/(t + 1) */
  const int turned = least > 0.41421356237309503 * most;
  const double over = turned ? least - most : least, under = turned ? least + most : most;
  const double t = over / (under == 0.0 ? 1.0 : under), z = t * t;
  double p = FUSED(z, 1.62858201153657823623e-02, -3.65315727442169155270e-02);
  p = FUSED(z, p, 4.97687799461593236017e-02);
  p = FUSED(z, p, -5.83357013379057348645e-02);
  p = FUSED(z, p, 6.66107313738753120669e-02);
  p = FUSED(z, p, -7.69187620504482999495e-02);
  p = FUSED(z, p, 9.09088713343650656196e-02);
  p = FUSED(z, p, -1.11111104054623557880e-01);
  p = FUSED(z, p, 1.42857142725034663711e-01);
  p = FUSED(z, p, -1.99999999998764832476e-01);
  p = FUSED(z, p, 3.33333333333329318027e-01);
  /* angle = base + sign (t - t z p), the multiple of pi/4 in two parts */
  const double sign = steep != left ? -1.0 : 1.0;
  double parts = turned ? 1.0 : 0.0;
  parts = steep ? 2.0 - parts : parts;
  parts = left ? 4.0 - parts : parts;
  const double rest = FUSED(parts, 3.06161699786838301793e-17, -sign * (t * z * p));
  return copysign(FUSED(parts, 7.85398163397448278999e-01, FUSED(sign, t, rest)), y);
}

ELEMENTARY double elementary_power_of_two(double integer)
{
  const double rounded = integer + ELEMENTARY_ROUND;
  unsigned long long bits;
  double power;
  memcpy(&bits, &rounded, sizeof bits);
  bits = (bits << 52) + 0x3ff0000000000000ULL;
  memcpy(&power, &bits, sizeof power);
  return power;
}

/* Exponential: Taylor's polynomial of degree 13 on |r| <= ln 2 / 2, whose rest is 4e-18, times a
   power of two. */
ELEMENTARY double elementary_exp(double x)
{
  const double low = x < -746.0 ? -746.0 : x, y = low > 710.0 ? 710.0 : low;
  const double k = FUSED(y, 1.44269504088896338700e+00, ELEMENTARY_ROUND) - ELEMENTARY_ROUND;
  const double hi = FUSED(-k, 6.93147180369123816490e-01, y), lo = k * -1.90821492927058770002e-10;
  const double r = hi + lo, lost = lo - (r - hi);
  double p = FUSED(r, 1.0 / 6227020800.0, 1.0 / 479001600.0);
  p = FUSED(r, p, 1.0 / 39916800.0);
  p = FUSED(r, p, 1.0 / 3628800.0);
  p = FUSED(r, p, 1.0 / 362880.0);
  p = FUSED(r, p, 1.0 / 40320.0);
  p = FUSED(r, p, 1.0 / 5040.0);
  p = FUSED(r, p, 1.0 / 720.0);
  p = FUSED(r, p, 1.0 / 120.0);
  p = FUSED(r, p, 1.0 / 24.0);
  p = FUSED(r, p, 1.0 / 6.0);
  p = FUSED(r, p, 0.5);
  const double value = 1.0 + (r + FUSED(r * r, p, lost));
  /* in two halves: 2^k alone may be out of range where the product is not */
  const double half = FUSED(k, 0.5, ELEMENTARY_ROUND) - ELEMENTARY_ROUND;
  return value * elementary_power_of_two(half) * elementary_power_of_two(k - half);
}
