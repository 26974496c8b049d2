"""What `population.json` and `fleet_discovery.json` hold, as types; as `heatrun.results`."""

from .fleet_discovery import FleetDiscoveryResult as FleetDiscoveryResult
from .population import PopulationResult as PopulationResult
