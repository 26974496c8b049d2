"""The catalogue of physical effects: one small file each, listed in `EFFECTS`."""

from .ac_copper_loss import AcCopperLoss
from .ambient_drift import AmbientDrift
from .ambient_recirculation import AmbientRecirculation
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
from .bearing_friction import BearingFriction
from .contact_drift import ContactDrift
from .coolant_sink import CoolantSink
from .cooling_step import CoolingStep
from .copper_coefficient import CopperCoefficient
from .end_winding_node import EndWindingNode
from .external_loss import ExternalLoss
from .fan_cooling import FanCooling
from .housing_node import HousingNode
from .insulation_conductivity import InsulationConductivity
from .iron_loss_in_winding import IronLossInWinding
from .loss_gain import LossGain
from .natural_convection import NaturalConvection
from .neighbour_body import NeighbourBody
from .radiation import Radiation
from .rotor_node import RotorNode
from .sensor_contact import SensorContact
from .sensor_gain import SensorGain
from .sensor_lag import SensorLag
from .speed_cooling import SpeedCooling
from .standby_loss import StandbyLoss
from .stray_load_loss import StrayLoadLoss
from .time_shift import TimeShift
from .winding_node import WindingNode
from .winding_resistance import WindingResistance

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
