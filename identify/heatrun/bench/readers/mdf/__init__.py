"""MDF 4 measurement files (extra `mdf`)."""
