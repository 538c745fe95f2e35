"""The identified model: coefficients, predictions, state-space forms, files."""
