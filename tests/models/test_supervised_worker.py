"""When a model worker is asked, seen from the server. (tests/models/test_runner.py has real worker processes.)"""

import asyncio
from types import SimpleNamespace

import pytest

from models.inference import supervised_worker
from models.inference.supervised_worker import SupervisedWorker
from models.inference.wire import Answer, Load


async def test_a_question_whose_answer_would_come_too_late_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(supervised_worker, "time", SimpleNamespace(monotonic=lambda: clock.now))
    worker = SupervisedWorker(Load((), ()), 0, hang_s=1.0)
    assert not worker.ready(0.15), "it has not started"
    worker._worker = SimpleNamespace(send=lambda _: None)
    for number in range(30):  # each answer takes 60 ms
        assert worker.ready(0.15)
        asked = worker.ask("ring", [], [], 0.15)
        clock.now += 0.06
        worker._take(Answer(number, 60.0, b"", b"", b"", b"", b"", []))
        assert asked.done()
    worker.ask("ring", [], [], 0.15)
    assert worker.ready(0.15), "60 ms for each of two"
    worker.ask("ring", [], [], 0.15)
    assert not worker.ready(0.15), "180 ms"
    assert worker.ready(0.25), "180 of 250 ms"
    clock.now += 0.05
    assert worker.ready(0.15), "the first is nearly done"
    clock.now += 0.11
    assert not worker.ready(0.15), "it takes longer than usual"
    await asyncio.sleep(0)
