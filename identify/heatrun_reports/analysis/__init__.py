"""The computing behind the reports by test type."""
