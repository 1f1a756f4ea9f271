from server.store import arrivals, studies
from server.store.database import Database


def test_arrivals_are_counted_by_kind_and_reason(url: str) -> None:
    with Database(url) as database:
        study = database.write_now(studies.register, "ring", "name: ring").id
        other = database.write_now(studies.register, "matrix", "name: matrix").id
        for kind, reason in (*[("opened", "")] * 3, ("unsuitable", "screen"), ("declined", "")):
            database.write_now(arrivals.count, study, kind, reason)
        database.write_now(arrivals.count, other, "opened")
        found = database.read_now(arrivals.of_study, (study,))
    assert found == {("opened", ""): 3, ("unsuitable", "screen"): 1, ("declined", ""): 1}


def test_a_browser_that_passes_at_a_later_try_is_not_unsuitable(url: str) -> None:
    with Database(url) as database:
        study = database.write_now(studies.register, "ring", "name: ring").id
        for kind in ("unsuitable", "unsuitable", "suitable"):
            database.write_now(arrivals.count, study, kind, "latency")
        assert database.read_now(arrivals.of_study, (study,)) == {("unsuitable", "latency"): 1}
        database.write_now(arrivals.count, study, "suitable", "latency")
        assert database.read_now(arrivals.of_study, (study,)) == {}
