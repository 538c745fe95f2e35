"""The stories: command line, the transition study, its report.

The matrices here are small: one BLAS thread is fastest, and threads that wait for each other on a
busy machine are not.
"""

import os

for _variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
