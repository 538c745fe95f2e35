"""The report of the study as a page: equations, references, numbering, figures, provenance."""
