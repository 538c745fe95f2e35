"""Before a fit: what a record can determine, and which experiment tells most."""
