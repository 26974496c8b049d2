"""What users read of a run: terminal, parameter sheet, workbook, certificate, discovery report.

Begin with `of_run`, which writes all files of a sheet; `terminal` is what the commands print.
"""
