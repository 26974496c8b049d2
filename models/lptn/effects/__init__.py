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
    build_all,
    placed_link,
    power,
    require,
)
from .bodies import EndWindingNode, HousingNode, NeighbourBody, RotorNode, WindingNode
from .cooling import CoolingStep, FanCooling, SpeedCooling
from .losses import (
    AcCopperLoss,
    BearingFriction,
    CopperCoefficient,
    ExternalLoss,
    IronLossInWinding,
    LossGain,
    StandbyLoss,
    StrayLoadLoss,
    WindingResistance,
)
from .sensors import SensorContact, SensorGain, SensorLag, TimeShift
from .sinks import AmbientDrift, AmbientRecirculation, CoolantSink
from .surface import NaturalConvection, Radiation
from .winding_path import ContactDrift, InsulationConductivity

EFFECTS: tuple[type[AbstractEffect], ...] = (
    Radiation,
    NaturalConvection,
    SpeedCooling,
    FanCooling,
    CoolingStep,
    CoolantSink,
    AmbientDrift,
    AmbientRecirculation,
    NeighbourBody,
    RotorNode,
    EndWindingNode,
    HousingNode,
    WindingNode,
    AcCopperLoss,
    IronLossInWinding,
    ExternalLoss,
    BearingFriction,
    StrayLoadLoss,
    StandbyLoss,
    LossGain,
    InsulationConductivity,
    ContactDrift,
    CopperCoefficient,
    WindingResistance,
    SensorLag,
    SensorContact,
    SensorGain,
    TimeShift,
)
"""Every effect that the library knows, by class; the id stands on `card.id`."""

__all__ = [
    "EFFECTS",
    "AbstractEffect",
    "EffectCard",
    "HeatEffect",
    "NodeEffect",
    "Quantity",
    "SensorEffect",
    "Terms",
    "applies",
    "build",
    "build_all",
    "placed_link",
    "power",
    "require",
]
