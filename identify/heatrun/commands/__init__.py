"""The commands, one per file: its words (`add_parser`) and what it does (`run`).

A command loads, calls, writes and prints; it computes nothing itself. Its file imports what is
slow to import inside `run`, so that `heatrun --help` answers at once.
"""

COMMANDS = (
    "init", "check", "calibrate", "compare", "discover", "simulate", "report", "sheet", "export",
    "fleet", "population", "view", "demo",
)  # fmt: skip
"""Names of the commands in the order of the help; each is a module of this package."""
