"""The report of a discovery and its figures."""
