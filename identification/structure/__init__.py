"""What is to be identified: signals, lags and functions of the scheduling, row by row."""
