"""The figures of the reports by test type."""
