"""The functions V that prove: splines in p, with a memory of p, over a box of parameters."""
