/* Does the exported code reproduce what Python computed? Exit status 0: every entry to 1e-12 of
   max(1, its size). */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "@stem@.h"

/* x, u, wind, expected */
/* @cases@ */

static double miss(const double *got, const double *expected, int n)
{
    double worst = 0;
    int i;
    for (i = 0; i < n; i++) {
        const double size = fabs(expected[i]) > 1 ? fabs(expected[i]) : 1;
        const double error = fabs(got[i] - expected[i]) / size;
        if (!(error <= worst)) worst = error; /* a NaN stays */
    }
    return worst;
}

static int verdict(const char *name, double worst)
{
    printf("%-18s largest difference %.2e%s\n", name, worst, worst <= 1e-12 ? "" : "  FAILED");
    return !(worst <= 1e-12);
}

int main(void)
{
    double got[RHS_N_FLIGHT], worst[3] = {0, 0, 0};
    int k, failed = 0;
    for (k = 0; k < CASES; k++) {
        const double *x = rhs_cases[k], *u = x + RHS_N_X, *wind = u + RHS_N_U;
        double error;
        heli_rhs(x, u, wind, got);
        error = miss(got, wind + RHS_N_WIND, RHS_N_X);
        if (!(error <= worst[0])) worst[0] = error;

        x = flight_cases[k], u = x + RHS_N_FLIGHT, wind = u + RHS_N_U;
        heli_flight_rhs(x, u, wind, got);
        error = miss(got, wind + RHS_N_EARTH, RHS_N_FLIGHT);
        if (!(error <= worst[1])) worst[1] = error;

        x = step_cases[k], u = x + RHS_N_FLIGHT, wind = u + RHS_N_U;
        memcpy(got, x, sizeof got);
        heli_flight_step(got, u, wind, STEP);
        error = miss(got, wind + RHS_N_EARTH, RHS_N_FLIGHT);
        if (!(error <= worst[2])) worst[2] = error;
    }
    failed += verdict("heli_rhs", worst[0]);
    failed += verdict("heli_flight_rhs", worst[1]);
    failed += verdict("heli_flight_step", worst[2]);
    return failed;
}
