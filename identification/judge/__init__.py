"""After a fit: residuals, uncertainty, responses, orders and what the data leave open."""
