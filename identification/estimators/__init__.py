"""Estimators of the coefficients from regressors: least squares, instruments, penalties, output
error.
"""
