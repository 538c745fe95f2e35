"""Polynomial matrices in Bernstein form, in any arithmetic, and models made of them."""
