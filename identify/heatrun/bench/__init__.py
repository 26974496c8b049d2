"""From bench files to records: readers, channel map, checks, alignment, reduction to blocks."""

from .channels import require as require
from .read import read_raw as read_raw
from .read import read_record as read_record
from .record import Finding as Finding
from .record import Record as Record
from .record import Source as Source
from .table import Table as Table
