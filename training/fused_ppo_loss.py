"""`ppo_loss` and its gradient in one pass over the samples, for the CPU.

A minibatch has about a thousand rows of six numbers. As some thirty operations of torch, each with its gradient, the
loss costs a quarter as much as the network; as one compiled loop its cost is negligible.
"""

from typing import Any

import numpy as np
import torch
from numba import njit
from torch import Tensor

from training.agent_config import AgentConfig


class FusedLoss(torch.autograd.Function):
    """Compute `ppo_loss`: the same arguments and results. Gradients flow to `logits` and `values`."""

    @staticmethod
    def forward(
        ctx: Any, logits: Tensor, values: Tensor, actions: Tensor, old_log_probabilities: Tensor, advantages: Tensor,
        targets: Tensor, config: AgentConfig, entropy_weight: float,
    ) -> tuple[Tensor, Tensor]:  # fmt: skip
        by_logit, by_value, parts = torch.empty_like(logits), torch.empty_like(values), torch.empty(4)
        loss = _loss_and_gradient(
            logits.detach().numpy(), values.detach().numpy(), actions.numpy(), old_log_probabilities.numpy(),
            advantages.numpy(), targets.numpy(), config.clip_coef, config.vf_coef, entropy_weight,
            by_logit.numpy(), by_value.numpy(), parts.numpy(),
        )  # fmt: skip
        ctx.save_for_backward(by_logit, by_value)
        ctx.mark_non_differentiable(parts)
        return torch.tensor(loss), parts

    @staticmethod
    def backward(ctx: Any, gradient: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        by_logit, by_value = ctx.saved_tensors
        return gradient * by_logit, gradient * by_value, *[None] * 6


@njit(cache=True, error_model="numpy")
def _loss_and_gradient(  # type: ignore[no-untyped-def]
    logits, values, actions, old_log_probabilities, advantages, targets, clip, value_weight, entropy_weight,
    by_logit, by_value, parts,
):  # fmt: skip
    """Return the loss; write its gradient to `by_logit` and `by_value` and the metrics to `parts` (4,)."""
    rows, count = logits.shape
    mean = advantages.mean()
    deviation = np.sqrt(np.square(advantages - mean).sum() / (rows - 1)) + 1e-8
    policy_loss, value_loss, entropies, outside = 0.0, 0.0, 0.0, 0
    logs, probabilities = np.empty(count, np.float32), np.empty(count, np.float32)
    for row in range(rows):
        largest, total, entropy = logits[row].max(), np.float32(0), 0.0
        for a in range(count):
            probabilities[a] = np.exp(logits[row, a] - largest)
            total += probabilities[a]
        shift = largest + np.log(total)
        for a in range(count):
            logs[a] = logits[row, a] - shift
            probabilities[a] /= total
            entropy -= probabilities[a] * logs[a]
        action, normal = actions[row], (advantages[row] - mean) / deviation
        ratio = np.exp(logs[action] - old_log_probabilities[row])
        clipped = min(max(ratio, 1 - clip), 1 + clip)
        policy_loss -= min(normal * ratio, normal * clipped)
        # Where the clipped side is the smaller one, the ratio no longer matters.
        pull = normal * ratio if clipped == ratio or normal * ratio < normal * clipped else 0.0
        for a in range(count):
            chosen = 1.0 if a == action else 0.0
            by_logit[row, a] = (
                entropy_weight * probabilities[a] * (logs[a] + entropy) - pull * (chosen - probabilities[a])
            ) / rows
        error = values[row] - targets[row]
        by_value[row] = 2 * value_weight * error / rows
        value_loss += error * error
        entropies += entropy
        outside += abs(ratio - 1) > clip
    parts[0], parts[1], parts[2], parts[3] = policy_loss / rows, value_loss / rows, entropies / rows, outside / rows
    return np.float32((policy_loss + value_weight * value_loss - entropy_weight * entropies) / rows)
