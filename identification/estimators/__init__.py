"""From regressors to coefficients: least squares, instruments, penalties, output error."""
