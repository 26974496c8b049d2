"""What `fit.json` and `discovery.json` hold, as types; field names are the keys of the files.

Reading, writing and the schemas all follow from these types: `to_json` writes any of them,
`from_json` reads and checks one, and `python -m heatrun.results.schema` prints the schemas.
"""

from .discovery import DiscoveryResult as DiscoveryResult
from .model import FitResult as FitResult
from .values import from_json as from_json
from .values import to_json as to_json
from .values import to_plain as to_plain
