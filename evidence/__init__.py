"""Programs behind the tables and figures of the documentation, run from a clone: `python -m
evidence.bracket`. Each process has one thread of BLAS, asked for before NumPy is imported.
"""

from studies.threads import one_thread

one_thread()
