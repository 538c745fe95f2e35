"""Plants, and the controllers designed for them."""
