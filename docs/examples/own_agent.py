"""Train an agent from outside the project: it uses only the PettingZoo environment. A small PyTorch network learns to
imitate a partner and is exported as an ONNX file.

    python docs/examples/own_agent.py mine.onnx --layout coordination_ring --timesteps 20000
"""

import argparse

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

from models.agents.catalogue import load_agent
from overcooked.pettingzoo_env import AGENTS, KitchenEnv


def lessons(layout: str, teacher: str, timesteps: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return observations and actions of the teacher playing with itself, with some random actions for variety."""
    env = KitchenEnv(layout)
    policy, draws = load_agent(teacher, env.layout).policy, np.random.default_rng(seed)
    seen, done = [], []
    observations, _ = env.reset()
    for _ in range(timesteps // 2):
        both = np.stack([observations[agent] for agent in AGENTS])
        wanted = policy.probabilities(both).argmax(1)
        seen.append(both.copy())
        done.append(wanted)
        actions = np.where(draws.random(2) < 0.2, draws.integers(0, 6, 2), wanted)
        observations, _, _, truncated, _ = env.step(dict(zip(AGENTS, actions.tolist(), strict=True)))
        if truncated[AGENTS[0]]:
            observations, _ = env.reset()
    return np.concatenate(seen), np.concatenate(done)


def learn(seen: np.ndarray, done: np.ndarray, epochs: int, seed: int) -> torch.nn.Sequential:
    torch.manual_seed(seed)
    network = torch.nn.Sequential(torch.nn.Linear(seen[0].size, 64), torch.nn.ReLU(), torch.nn.Linear(64, 6))
    optimiser = torch.optim.Adam(network.parameters(), 1e-3)
    inputs, wanted = torch.from_numpy(seen).flatten(1).float(), torch.from_numpy(done)
    for _ in range(epochs):
        for rows in torch.randperm(len(inputs)).split(256):
            optimiser.zero_grad()
            torch.nn.functional.cross_entropy(network(inputs[rows]), wanted[rows]).backward()
            optimiser.step()
    return network


def write_onnx(network: torch.nn.Sequential, shape: tuple[int, ...], path: str) -> None:
    """Write a network from int8 planes (games, width, height, 26) to logits (games, 6)."""
    nodes = [
        helper.make_node("Cast", ["planes"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("Flatten", ["numbers"], ["flat"]),
        helper.make_node("Gemm", ["flat", "0.weight", "0.bias"], ["wide"], transB=1),
        helper.make_node("Relu", ["wide"], ["hidden"]),
        helper.make_node("Gemm", ["hidden", "2.weight", "2.bias"], ["logits"], transB=1),
    ]
    weights = [numpy_helper.from_array(value.numpy(), name) for name, value in network.state_dict().items()]
    planes = helper.make_tensor_value_info("planes", TensorProto.INT8, ["games", *shape])
    logits = helper.make_tensor_value_info("logits", TensorProto.FLOAT, ["games", 6])
    graph = helper.make_graph(nodes, "own_agent", [planes], [logits], weights)
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9), path)


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("out", help="the ONNX file to write")
    parser.add_argument("--layout", default="coordination_ring")
    parser.add_argument("--teacher", default="planner", help="the agent to imitate")
    parser.add_argument("--timesteps", type=int, default=20_000)
    parser.add_argument("--epochs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    seen, done = lessons(arguments.layout, arguments.teacher, arguments.timesteps, arguments.seed)
    network = learn(seen, done, arguments.epochs, arguments.seed)
    write_onnx(network, seen.shape[1:], arguments.out)
    right = (network(torch.from_numpy(seen).flatten(1).float()).argmax(1).numpy() == done).mean()
    print(f"{arguments.out}: does what its teacher does in {right:.0%} of {len(done):,} states")


if __name__ == "__main__":
    main()
