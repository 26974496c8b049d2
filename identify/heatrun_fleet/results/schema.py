"""The JSON schemas of `population.json` and `fleet_discovery.json`, generated from the types.

`python -m heatrun_fleet.results.schema` (`make schemas`) writes them again.
"""

from pathlib import Path

from heatrun.results.schema import Schemas, write_schemas

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
    for path in write_schemas(Path(__file__).with_name("schemas"), SCHEMAS):
        print(path)
