"""The loops the studies prove: lateral, longitudinal, exact, and their margins."""
