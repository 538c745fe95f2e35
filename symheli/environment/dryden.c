/* Samples of Dryden's processes from white noise, `stride` numbers apart: unit variance, the n - 1
   coefficients of each step given. The same operations in turbulence.py; no contraction. */

void first_order(long n, const double *keep, const double *fresh, const double *white, long stride,
                 double *out)
{
  double x = white[0];
  out[0] = x;
  for (long k = 0; k + 1 < n; ++k) {
    x = keep[k] * x + fresh[k] * white[(k + 1) * stride];
    out[k + 1] = x;
  }
}

/* z[0], z[1] are the states at the start; fresh has a, b, c of each step. */
void second_order(long n, const double *keep, const double *steps, const double *fresh,
                  const double *white, long stride, const double *start, const double *output,
                  double *out)
{
  double x = start[0], y = start[1];
  out[0] = output[0] * x + output[1] * y;
  for (long k = 0; k + 1 < n; ++k) {
    const double *w = white + (k + 1) * stride, *f = fresh + 3 * k;
    const double moved = keep[k] * (steps[k] * x + y) + (f[1] * w[0] + f[2] * w[1]);
    x = keep[k] * x + f[0] * w[0];
    y = moved;
    out[k + 1] = output[0] * x + output[1] * y;
  }
}
