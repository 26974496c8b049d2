"""Units that a record suggests to be others than they were read in.

Relations that physics puts between channels (`relations`, `power_relations`, `one_node`), a record
that breaks one (`conflict`), the same record in other units (`other_readings`), and which of them
mends it (`which_unit`).
"""

from .which_unit import read_otherwise, unit_suspected

__all__ = ["read_otherwise", "unit_suspected"]
