"""Verification of a Lyapunov function V, from the model and V alone, in floating point and
exactly.
"""
