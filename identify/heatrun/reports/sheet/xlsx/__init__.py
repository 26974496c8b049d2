"""The sheet as a workbook: certificate, parameters, tests, worksheet."""

from .book import write_xlsx

__all__ = ["write_xlsx"]
