/* The pace of a processor at products and sums that are not fused, in vectors of WIDTH numbers. */
typedef double vector __attribute__((vector_size(8 * WIDTH)));
enum { CHAINS = 8 };

/* Products and sums in one round. */
long operations(void) { return 2 * CHAINS * WIDTH; }

double unfused(long rounds, double one)
{
  vector x[CHAINS], y[CHAINS], a;
  double sum = 0;
  for (int l = 0; l < WIDTH; ++l) a[l] = one;
  for (int i = 0; i < CHAINS; ++i) x[i] = y[i] = a;
  for (long k = 0; k < rounds; ++k)
    for (int i = 0; i < CHAINS; ++i) {
      x[i] *= a;
      y[i] += a;
    }
  for (int i = 0; i < CHAINS; ++i)
    for (int l = 0; l < WIDTH; ++l) sum += x[i][l] + y[i][l];
  return sum;
}
