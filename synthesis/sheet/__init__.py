"""The specification sheet: required values, and what controllers reach of them over a parameter."""
