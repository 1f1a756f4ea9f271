"""PPO's loss, by the formula [Schulman et al. 2017]; `fused_ppo_loss` computes the same faster on the CPU."""

import torch
from torch import Tensor, nn

from training.agent_config import AgentConfig


def ppo_loss(
    logits: Tensor,  # (samples, 6)
    values: Tensor,  # (samples,)
    actions: Tensor,
    old_log_probabilities: Tensor,
    advantages: Tensor,
    targets: Tensor,
    config: AgentConfig,
    entropy_weight: float,
) -> tuple[Tensor, Tensor]:
    """Return PPO's clipped loss, and as metrics (policy loss, value loss, entropy, share clipped)."""
    logs = logits.log_softmax(-1)
    entropy = -(logs.exp() * logs).sum(-1).mean()
    ratio = (logs.gather(1, actions[:, None]).squeeze(1) - old_log_probabilities).exp()
    normal = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
    clipped = ratio.clamp(1 - config.clip_coef, 1 + config.clip_coef)
    policy_loss = -torch.min(normal * ratio, normal * clipped).mean()
    value_loss = nn.functional.mse_loss(values, targets)
    loss = policy_loss + config.vf_coef * value_loss - entropy_weight * entropy
    outside = ((ratio - 1).abs() > config.clip_coef).float().mean()
    return loss, torch.stack([policy_loss, value_loss, entropy, outside]).detach()
