"""What a run says of a test, for the reports that set it beside the measurement."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from heatrun.bench.record import Record
from heatrun.inference.predict import Prediction
from heatrun.motor import Motor
from heatrun.runs.run import open_run


@dataclass(frozen=True)
class Simulated:
    """A test as a run predicts it.

    Attributes:
        prediction: Reading, nodes and heat flows with their bands, block by block.
        is_seen: Whether the run was calibrated on this very file.
        motor_name: The machine that the run was calibrated for.
    """

    prediction: Prediction
    is_seen: bool
    motor_name: str

    @property
    def title(self) -> str:
        """The model in a few words, with its effects."""
        model = self.prediction.model
        effects = ", ".join(kind.card.id for kind in model.effects)
        return f"{model.title} with {effects}" if effects else model.title

    @property
    def measured_node(self) -> str:
        """Node that the winding's sensor sits in."""
        return self.prediction.model.form.measured_node


def simulate_run(run: Path, record: Record, motor: Motor, *, seed: int = 0) -> Simulated:
    """Predict a test with a run.

    Args:
        run: A folder that `heatrun calibrate` or `heatrun discover` wrote.
        record: With currents, losses and sink.
        motor: How the bench of this test measures.
        seed: Of draws, start and noise.

    Raises:
        InputError: As `heatrun.runs.run.Run.predict`.
    """
    opened = open_run(run)
    found = opened.predict(record, motor=motor, seed=seed)
    return Simulated(found, not found.is_held_out, opened.result.motor.name)
