"""Recursive least squares: the estimator, its memory and its compiled kernel."""
