"""As others would write it: the helicopter by hand in Python, Numba, C and python-control, RLS, an
LPV analysis. No symheli in here.
"""
