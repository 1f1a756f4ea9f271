"""The decoder of intentions: from a predictor's tokens to the watched agent's next interaction, and its time."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from models.networks.config import IntentionConfig
from models.protocols import INTENTION_HORIZON


class IntentionDecoder(nn.Module):
    """Two distributions: over the interactions that the kitchen allows (none among them), and, given one of these, over
    the timesteps until it is done.

    Its input is the output of every layer of the predictor for the newest timestep, concatenated, (..., tokens).
    """

    temperature: Tensor  # (2,): of the classes, of the timesteps; logits are divided by it

    def __init__(self, tokens: int, classes: int, config: IntentionConfig) -> None:
        super().__init__()
        self.config = config
        self.norm = nn.LayerNorm(tokens)
        self.first = nn.Linear(tokens, config.hidden)
        self.classes = nn.Linear(config.hidden, classes)
        self.when_first = nn.Linear(config.hidden, config.when_hidden)
        self.when_class = nn.Embedding(classes, config.when_hidden)
        self.when = nn.Linear(config.when_hidden, INTENTION_HORIZON)
        self.register_buffer("temperature", torch.ones(2))

    def inside(self, tokens: Tensor) -> Tensor:
        """(..., tokens) to (..., hidden), from which both distributions are made."""
        return functional.relu(self.first(self.norm(tokens)))

    def class_logits(self, inside: Tensor) -> Tensor:
        """(..., hidden) to (..., classes)."""
        logits: Tensor = self.classes(inside) / self.temperature[0]
        return logits

    def when_logits(self, inside: Tensor, classes: Tensor) -> Tensor:
        """(..., hidden) and the class that is done (...) to (..., INTENTION_HORIZON), the coming timestep first."""
        both = self.when_first(inside) + self.when_class(classes)
        logits: Tensor = self.when(functional.relu(both)) / self.temperature[1]
        return logits
