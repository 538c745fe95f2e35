"""A controller and its loop: margins, and what is left of a proof once it is implemented."""
