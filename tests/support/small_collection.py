"""A few short games of a planner with partners that act at random."""

from models.agents.catalogue import load_agent
from overcooked.layout import load_layout
from training.collect import CollectionPlan, Partner, Target

RING = load_layout("coordination_ring")
SMALL = CollectionPlan(trajectories=1, timesteps=60)


def planner():
    agent = load_agent("planner", RING)
    return Target("planner", agent.policy, agent.mode, "0" * 64)


def uniform(name, agent=None, kind="sp"):
    return Partner(name, agent or name, kind, load_agent("random", RING).policy)
