"""Lyapunov functions V: splines in p, with a memory of p, over a box of parameters."""
