"""The catalogue of physical effects: one small file each, listed in `EFFECTS`."""

from .base import (
    AbstractEffect,
    EffectCard,
    HeatEffect,
    NodeEffect,
    Quantity,
    SensorEffect,
    Terms,
    applies,
    build,
)
from .neighbour_body import NeighbourBody
from .sensor_lag import SensorLag
from .speed_cooling import SpeedCooling

EFFECTS: tuple[type[AbstractEffect], ...] = (SpeedCooling, SensorLag, NeighbourBody)
"""Every effect that the library knows, by class; the id stands on `card.id`."""

__all__ = [
    "EFFECTS",
    "AbstractEffect",
    "EffectCard",
    "HeatEffect",
    "NeighbourBody",
    "NodeEffect",
    "Quantity",
    "SensorEffect",
    "SensorLag",
    "SpeedCooling",
    "Terms",
    "applies",
    "build",
]
