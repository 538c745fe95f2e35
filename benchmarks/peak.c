/* The pace of this processor: independent fused multiply-adds in the widest vectors, roots and
   quotients in vectors, and single operations that wait for one another. */
#if defined(__AVX512F__)
typedef double vector __attribute__((vector_size(64)));
#elif defined(__AVX__)
typedef double vector __attribute__((vector_size(32)));
#else
typedef double vector __attribute__((vector_size(16)));
#endif
enum { CHAINS = 12, WIDTH = sizeof(vector) / sizeof(double), SIDE_BY_SIDE = 64 };

/* Fused multiply-adds in one round of `fused`. */
long fused_per_round(void) { return CHAINS * WIDTH; }

double fused(long rounds, double one)
{
  vector x[CHAINS], a;
  double sum = 0;
  for (int l = 0; l < WIDTH; ++l) a[l] = one;
  for (int i = 0; i < CHAINS; ++i) x[i] = a * i;
  for (long k = 0; k < rounds; ++k)
    for (int i = 0; i < CHAINS; ++i)
      for (int l = 0; l < WIDTH; ++l) x[i][l] = FUSED(x[i][l], a[l], a[l]);
  for (int i = 0; i < CHAINS; ++i)
    for (int l = 0; l < WIDTH; ++l) sum += x[i][l];
  return sum;
}

/* Roots or quotients in one round. */
long side_by_side(void) { return SIDE_BY_SIDE; }

#define IN_VECTORS(NAME, EXPRESSION)                                                               \
  double NAME(long rounds, double one)                                                             \
  {                                                                                                \
    double x[SIDE_BY_SIDE], sum = 0;                                                               \
    for (int l = 0; l < SIDE_BY_SIDE; ++l) x[l] = one + l;                                         \
    for (long k = 0; k < rounds; ++k)                                                              \
      for (int l = 0; l < SIDE_BY_SIDE; ++l) x[l] = EXPRESSION;                                    \
    for (int l = 0; l < SIDE_BY_SIDE; ++l) sum += x[l];                                            \
    return sum;                                                                                    \
  }

IN_VECTORS(roots, sqrt(x[l]))
IN_VECTORS(quotients, one / x[l])

#define WAITING(NAME, EXPRESSION)                                                                  \
  double NAME(long rounds, double one)                                                             \
  {                                                                                                \
    double x = one;                                                                                \
    for (long k = 0; k < rounds; ++k) x = EXPRESSION;                                              \
    return x;                                                                                      \
  }

WAITING(wait_add, x + one)
WAITING(wait_mul, x * one)
WAITING(wait_fma, FUSED(x, one, one))
WAITING(wait_div, one / x)
WAITING(wait_sqrt, sqrt(x))
