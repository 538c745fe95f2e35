"""Structure of a model: signals, lags and functions of the scheduling, row by row."""
