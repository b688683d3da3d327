"""A network over conditions: a plane, and two hidden layers for what bends it."""

from typing import ClassVar

import torch
from torch import Tensor, nn

from surrogates.conditions import Array, ConditionSurrogate, Samples
from surrogates.network import seeded, single, zeroed
from surrogates.training import Samples as Shown
from surrogates.training import Training, train

DECAY = 1e-2  # of the weights, AdamW's own


class ConditionNetwork(nn.Module):
    """f(x) = A x + b + N(x): N has two hidden layers and is nothing at first, so that it only learns what bends."""

    def __init__(self, inputs: int, outputs: int, width: int) -> None:
        super().__init__()
        self.straight = nn.Linear(inputs, outputs)
        self.bent = nn.Sequential(
            nn.Linear(inputs, width), nn.SiLU(), nn.Linear(width, width), nn.SiLU(), zeroed(nn.Linear(width, outputs))
        )

    def forward(self, conditions: Tensor) -> Tensor:
        """Scaled values (samples, outputs) at scaled conditions (samples, inputs)."""
        straight: Tensor = self.straight(conditions)
        bent: Tensor = self.bent(conditions)
        return straight + bent


class MlpCondition(ConditionSurrogate):
    """Network of conditions, trained on all samples: few speeds leave none to validate with, so nothing stops early.

    Values are scaled by one number, so that modes count by their energy. SiLU bends like a parabola near zero, as flows
    do over speed: of made-up fields that grow with its square it missed half as much as tanh did.
    """

    name: ClassVar[str] = "mlp"
    random: ClassVar[bool] = True

    def __init__(
        self,
        *,
        phase: bool = False,
        logarithmic: bool = False,
        seed: int = 0,
        width: int = 64,
        steps: int = 800,
        learning_rate: float = 0.02,
    ) -> None:
        super().__init__(phase=phase, logarithmic=logarithmic, seed=seed)
        self.width, self.steps, self.learning_rate = width, steps, learning_rate

    def _fit(self, samples: Samples) -> None:
        self.middle_ = samples.values.mean(axis=0)
        self.scale_ = float((samples.values - self.middle_).std()) or 1.0
        targets = (samples.values - self.middle_) / self.scale_
        sizes = samples.conditions.shape[1], targets.shape[1], self.width
        self.network_ = seeded(lambda: ConditionNetwork(*sizes), self.seed)
        settings = Training(
            steps=self.steps, learning_rate=self.learning_rate, weight_decay=DECAY, patience=None, seed=self.seed
        )
        shown = Shown((self._inputs(samples.conditions),), single(targets))
        self.trained_ = train(self.network_, shown, None, settings)

    def _inputs(self, conditions: Array) -> Tensor:
        """Operating conditions from −1 to 1, the phase as it is."""
        n = self._operating(conditions)
        centred = conditions.copy()
        centred[:, :n] = 2.0 * conditions[:, :n] - 1.0
        return single(centred)

    def _predict(self, conditions: Array) -> Array:
        with torch.no_grad():
            found: Array = self.network_(self._inputs(conditions)).double().numpy()
        predicted: Array = self.middle_ + self.scale_ * found
        return predicted
