"""Training intentions: labels, baselines, the decoder, and the folder."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

import kitchenmind
from models.agents.catalogue import load_agent
from models.inference.predictor_numpy import load_trained_predictor
from models.networks.checkpoint import load_checkpoint
from models.networks.config import PredictorConfig
from models.networks.predictor import PredictorNetwork, predictor_network, save_predictor
from overcooked.constants import INTERACT, POTTING_ONION, WEST
from overcooked.interactions import NO_INTERACTION, InteractionKind, possible_interactions
from overcooked.layout import load_layout, parse_layout
from overcooked.state import Kitchens
from training.collect import TEST, CollectionPlan, Partner, Target, collect, games_with
from training.evaluate_intentions import EvaluatedIntentions, intention_entry, predicted_intentions
from training.evaluate_predictor import calibration_error
from training.intention_baselines import FrequentNext, nearest_sensible
from training.intention_labels import UNKNOWN, interactions_done, labels_of, next_interactions
from training.pipeline.predictor_tasks import predictor_tasks
from training.pipeline.study_tasks import Work
from training.predictor_config import IntentionSettings, TrainingConfig
from training.publish_intentions import add_intentions
from training.train_intentions import IntentionStates, read_shards, states_of, train_intentions
from training.train_predictor import prepared

RING = load_layout("coordination_ring")
POSSIBLE = possible_interactions(RING)
TINY = PredictorConfig(hidden=32, layers=2, heads=2, feed_forward=64, state_width=48, action_width=8)
QUICK = IntentionSettings(hidden=64, updates=300, batch=256, warm_up=10, check_every=100)


@pytest.fixture(autouse=True)
def one_thread():
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def games(tmp_path_factory):
    """The planner's games with five others, one of them for validation and one for the test."""
    folder = tmp_path_factory.mktemp("games")
    planner = load_agent("planner", RING)
    others = [Partner(f"sp_{k}_100", f"sp_{k}", "sp", planner.policy) for k in range(1, 5)]
    others.append(Partner("sp_0_100", "sp_0", "sp", load_agent("random", RING).policy))
    collect(folder, RING, Target("planner", planner.policy, planner.mode, "0" * 64), others, CollectionPlan(1, 200))
    return folder


@pytest.fixture(scope="module")
def without(tmp_path_factory):
    """An untrained predictor: its tokens still contain the state."""
    torch.manual_seed(0)
    folder = tmp_path_factory.mktemp("weights") / "planner_predictor_stream"
    save_predictor(folder, PredictorNetwork(RING, TINY), RING, "planner", "# A card.", agent_sha256="0" * 64)
    return folder


@pytest.fixture(scope="module")
def with_decoder(without, games, tmp_path_factory):
    """The same with a decoder, and what was measured."""
    folder = tmp_path_factory.mktemp("more") / "planner_predictor_stream"
    return folder, add_intentions(without, games, QUICK, folder)


def test_labels_are_the_next_interaction_within_the_horizon_and_unknown_near_the_end():
    done = np.zeros((1, 60), np.int64)
    done[0, 3], done[0, 30] = 7, 9
    labels = next_interactions(done)
    assert labels.classes[0, :4].tolist() == [7, 7, 7, 7]
    assert labels.steps[0, :4].tolist() == [4, 3, 2, 1]
    assert labels.classes[0, 4:11].tolist() == [0] * 7  # 20 timesteps later nothing has been done yet
    assert (labels.classes[0, 11], labels.steps[0, 11]) == (9, 20)
    assert (labels.classes[0, 30], labels.steps[0, 30]) == (9, 1)
    assert labels.classes[0, 31:41].tolist() == [0] * 10
    assert (labels.classes[0, 41:] == UNKNOWN).all()


def test_recorded_games_tell_which_station_the_target_used(games):
    shard = read_shards(games, TEST)[0]
    done = interactions_done(shard, RING)
    game = int(np.argmax(done.any(1)))
    kitchens, events, seat = Kitchens.start(RING), np.zeros((1, 2), np.int32), int(shard["seat"][game])
    filled = 0
    for t in range(done.shape[1]):
        kind, x, y = POSSIBLE[done[game, t]]
        before = kitchens.contents[0, x, y]
        joint = shard["actions"][game, t]
        kitchens.step((joint if seat == 0 else joint[::-1])[None], events)
        if kind == InteractionKind.FILL:
            assert events[0, seat] & POTTING_ONION
            assert kitchens.contents[0, x, y] > before
            filled += 1
        elif kind != InteractionKind.NONE:
            assert joint[0] == INTERACT
    assert filled > 3


def test_the_planner_is_the_nearest_station_that_makes_sense_to_itself(games):
    shard = read_shards(games, TEST)[0]
    labels = labels_of(shard, RING)
    just_before = labels.steps == 1
    said = nearest_sensible(shard, RING, just_before)
    assert (said == labels.classes[just_before]).mean() > 0.95


def test_the_most_frequent_next_interaction_depends_on_what_is_held(games):
    shards = read_shards(games, TEST)
    said = FrequentNext(shards, RING)(shards[0])
    held = np.take_along_axis(shards[0]["players"][..., 3], shards[0]["seat"][:, None, None].astype(int), 2)[..., 0]
    kinds = np.array([interaction.kind for interaction in POSSIBLE])[said]
    assert set(kinds[held == 0]) <= {InteractionKind.NONE, InteractionKind.TAKE_ONION, InteractionKind.TAKE_DISH}
    assert InteractionKind.FILL in kinds[held == 1]


def test_the_most_frequent_interaction_is_counted_in_a_kitchen_with_many_pots():
    pots = "P" * 12
    kitchen = parse_layout(f"X{pots}X\nO1{' ' * 10}2O\nXD{'X' * 10}SX", "pots")  # 6 ** 12 states of the pots
    agent = load_agent("planner", kitchen)
    target = Target("planner", agent.policy, agent.mode, "0" * 64)
    partner = Partner("sp_1_100", "sp_1", "sp", agent.policy)
    shard, other = (games_with(kitchen, target, partner, CollectionPlan(1, steps)) for steps in (120, 300))
    said, labels = FrequentNext([shard], kitchen)(shard), labels_of(shard, kitchen).classes.reshape(4, -1)
    assert (said == labels)[labels != UNKNOWN].mean() > 0.3
    commonest = np.bincount(labels[labels != UNKNOWN]).argmax()
    late = FrequentNext([shard], kitchen)(other)[:, 200:]  # with more soups than the games of 120 timesteps had
    assert (late == commonest).any()


def test_the_figures_are_what_counting_gives():
    takes = [place for place, found in enumerate(POSSIBLE) if found.kind == InteractionKind.TAKE_ONION][:2]
    (right, other), none = takes, POSSIBLE.index(NO_INTERACTION)
    entry = intention_entry(
        EvaluatedIntentions(
            predicted=np.array([right, other, none, none]),
            second=np.array([none, right, right, other]),
            probability=np.array([0.9, 0.9, 0.9, 0.9], np.float32),
            when=np.array([5, 9, 1, 1]),
            classes=np.array([right, right, right, none]),
            steps=np.array([5, 5, 10, 0]),
            frequent=np.array([right, right, none, none]),
            nearest=np.array([other, right, right, UNKNOWN]),
        ),
        RING,
    )
    assert entry["before"]["5"] == {
        "states": 2, "kind": 100.0, "kind_and_station": 50.0, "first_two": 100.0, "nearest_sensible": 50.0,
        "frequent": 100.0, "when_error": 0.0,
    }  # fmt: skip
    assert (entry["before"]["10"]["kind"], entry["before"]["10"]["first_two"]) == (0.0, 100.0)
    assert entry["before"]["20"]["kind"] is None
    assert (entry["all_states"], entry["none"], entry["none_share"]) == (50.0, 100.0, 25.0)
    assert entry["ece"] == pytest.approx(0.4)


def states_that_tell_what_comes(count, seed):
    """The first three entries of a token tell which of three classes comes, the fourth roughly when."""
    random = torch.Generator().manual_seed(seed)
    tokens = torch.randn(count, TINY.layers * TINY.hidden, generator=random)
    classes = tokens[:, :3].argmax(-1)
    steps = torch.where(classes > 0, (tokens[:, 3] > 0) * 10 + torch.randint(1, 4, (count,), generator=random), 0)
    return IntentionStates(tokens.half(), classes, steps)


def test_a_decoder_learns_what_comes_and_when_and_is_calibrated():
    train, validation, test = (
        states_that_tell_what_comes(count, seed) for seed, count in enumerate((4000, 1000, 1000))
    )
    network = PredictorNetwork(RING, TINY)
    decoder = train_intentions(network, RING, train, validation, QUICK)
    with torch.inference_mode():
        inside = decoder.inside(test.tokens.float())
        said = decoder.class_logits(inside).softmax(-1)
        when = 1 + (decoder.when_logits(inside, test.classes).softmax(-1).cumsum(-1) < 0.5).sum(-1)
    right = said.argmax(-1) == test.classes
    assert right.float().mean() > 0.9
    assert calibration_error(said.amax(-1).numpy(), right.numpy()) < 0.05
    done = test.classes > 0
    assert (when - test.steps)[done].abs().float().mean() < 2
    assert abs((when - test.steps)[done].float().mean()) < 0.5
    assert network.intentions is None


def test_what_is_measured_stands_in_the_config_and_on_the_card(with_decoder):
    folder, measured = with_decoder
    checkpoint = load_checkpoint(folder)
    assert checkpoint.config["measured_intentions"] == json.loads(json.dumps(measured))
    assert checkpoint.card.startswith("# A card.\n\n## Intentions\n")


def test_a_decoder_changes_no_prediction_of_the_actions(without, with_decoder, tmp_path):
    before, after = load_checkpoint(without), load_checkpoint(with_decoder[0])
    for name, tensor in before.tensors.items():
        assert tensor.tobytes() == after.tensors[name].tobytes(), name
    slots, actions = np.arange(6), np.full((6, 2), -1, np.int8)
    answers = []
    for folder in (without, with_decoder[0]):
        predictor, _ = load_trained_predictor(folder, RING)
        predictor.begin(slots)
        kitchens = Kitchens.start(RING, 6)
        for _ in range(5):
            answers.append(predictor.predict(slots, kitchens.encode()[:, 0].copy(), actions))
            kitchens.step(np.full((6, 2), WEST), np.zeros((6, 2), np.int32))
    for one, other in zip(answers[:5], answers[5:], strict=True):
        assert one.tobytes() == other.tobytes()


def test_a_decoder_replaces_the_one_before(with_decoder, games, tmp_path):
    folder, measured = with_decoder
    again = add_intentions(folder, games, QUICK, tmp_path / "again")
    assert again == measured
    assert load_checkpoint(tmp_path / "again").card == load_checkpoint(folder).card
    assert predictor_network(load_checkpoint(tmp_path / "again"))[0].intentions is not None


def test_training_of_the_actions_can_begin_with_a_predictor_that_has_a_decoder(with_decoder, games):
    trainer = prepared(RING, TINY, TrainingConfig(), games, begin_with=with_decoder[0])
    assert trainer.network.intentions is None
    assert torch.equal(trainer.network.norm.weight, predictor_network(load_checkpoint(with_decoder[0]))[0].norm.weight)


def test_games_that_are_too_short_are_refused_with_the_remedy(games):
    shards = [{name: value if name == "seat" else value[:, :19] for name, value in read_shards(games, TEST)[0].items()}]
    with pytest.raises(ValueError, match=r"19 timesteps are too short .* --no-intentions"):
        states_of(shards, RING, PredictorNetwork(RING, TINY))


def test_an_episode_that_the_games_do_not_finish_is_not_measured(with_decoder):
    network, _ = predictor_network(load_checkpoint(with_decoder[0]))
    planner = load_agent("planner", RING)
    target = Target("planner", planner.policy, planner.mode)
    longer = games_with(RING, target, Partner("sp_1", "sp_1", "sp", planner.policy), CollectionPlan(1, 430))
    whole = {name: values if name == "seat" else values[:, :400] for name, values in longer.items()}
    entries = [
        intention_entry(predicted_intentions(network, [games], RING, FrequentNext([games], RING)), RING)
        for games in (longer, whole)
    ]
    assert entries[0] == entries[1]


def test_the_pipeline_adds_a_decoder_after_each_predictor(without, games, tmp_path):
    tasks = {task.name: task for task in predictor_tasks(RING, (), "", {}, extras=(), publish=False)}
    task = tasks["intentions_sp_stream"]
    assert task.inputs == ("games_sp", "predictor_sp_stream")
    (tmp_path / "games").symlink_to(games)
    (tmp_path / "predictor").symlink_to(without)
    inputs = dict.fromkeys(task.inputs, tmp_path)
    settings = QUICK.model_copy(update={"updates": 20}).stored()
    task.action(Work(replace(task, settings=settings), tmp_path / "made", inputs, lambda _: None))
    assert predictor_network(load_checkpoint(tmp_path / "made" / "predictor"))[0].intentions is not None


def test_games_of_another_agent_are_refused(games, tmp_path):
    save_predictor(tmp_path / "p", PredictorNetwork(RING, TINY), RING, "sp", "# A card.", agent_sha256="1" * 64)
    with pytest.raises(ValueError, match="games of another agent or kitchen than"):
        add_intentions(tmp_path / "p", games, QUICK, tmp_path / "q")


def test_the_command_adds_a_decoder_and_prints_its_accuracy(without, games, tmp_path, capsys):
    words = ["train", "intentions", "--layout", RING.name, "--agent", "planner", "--predictor", str(without)]
    words += ["--games", str(games), "--out", str(tmp_path / "p"), "--set", "updates=20", "states=1000"]
    assert kitchenmind.main(words) == 0
    assert "next interaction and station right in" in capsys.readouterr().out
    assert predictor_network(load_checkpoint(tmp_path / "p"))[0].intentions is not None
