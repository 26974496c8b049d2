"""The JSON schemas of `population.json` and `fleet_discovery.json`, generated from the types.

`python -m heatrun_fleet.results.schema population-1.json` prints one, as `heatrun.results.schema`.
"""

import sys

from heatrun.results.schema import Schemas, print_schemas

from .fleet_discovery import FleetDiscoveryResult
from .population import PopulationResult

SCHEMAS: Schemas = {
    "population-1.json": (
        PopulationResult,
        "population.json of heatrun: what `heatrun population` writes",
    ),
    "fleet-discovery-1.json": (
        FleetDiscoveryResult,
        "fleet_discovery.json of heatrun: what `heatrun fleet --discover` writes",
    ),
}
"""As `heatrun.results.schema.SCHEMAS`."""


if __name__ == "__main__":
    sys.exit(print_schemas(sys.argv[1:], SCHEMAS))
