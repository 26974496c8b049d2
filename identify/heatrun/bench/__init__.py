"""From bench files to records: readers, channel map, checks, alignment, reduction to blocks."""

from .channels.channel_map import require as require
from .readers.read import read_raw as read_raw
from .readers.read import read_record as read_record
from .readers.table import Table as Table
from .record import Finding as Finding
from .record import Record as Record
from .record import Source as Source
