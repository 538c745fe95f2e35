"""The same helicopter as others would write it: by hand in Python, in Numba, in C, and in python-control. No symheli in here."""
