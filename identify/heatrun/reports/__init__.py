"""What users read: terminal, parameter sheet, discovery report, reports by test type."""
