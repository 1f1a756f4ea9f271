"""`kitchenmind agent check` describes an agent, or says why a study cannot use it."""

import kitchenmind
from tests.support import onnx_files


def checked(capsys, *words):
    status = kitchenmind.main(["agent", "check", *words, "--layout", "coordination_ring"])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_agent_check_describes_an_agent(capsys, tmp_path):
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26])
    status, out, _ = checked(capsys, str(tmp_path / "a.onnx"), "--deadline-ms", "60000")
    assert status == 0
    assert "it can be used" in out
    assert "deterministic  yes" in out
    status, out, _ = checked(
        capsys, "tests.support.foreign_models:Remembering", "--predictor", "--deadline-ms", "60000"
    )
    assert status == 0
    status, out, _ = checked(capsys, "planner", "--deadline-ms", "60000")
    assert "certain        in 100% of the states" in out


def test_agent_check_refuses_what_does_not_fit(capsys):
    status, _, err = checked(capsys, "tests.support.foreign_models:WrongShape")
    assert status == 1
    assert "it gave an array of shape (1, 3), wanted (1, 6)" in err
    status, _, err = checked(capsys, "tests.support.foreign_models:BrokenAfterWarming")
    assert status == 1
    assert "gave NaN, infinite or negative probabilities" in err
    status, _, err = checked(capsys, "tests.support.foreign_models:Overconfident", "--predictor")
    assert status == 1
    assert "gave an intention whose probability is not between 0 and 1" in err
    status, _, err = checked(capsys, "planner", "--deadline-ms", "0.0001")
    assert status == 1
    assert "is too slow" in err
    status, _, err = checked(capsys, "nobody")
    assert status == 2
    assert "Known: planner" in err


def test_a_path_that_is_not_there_is_named_from_the_root(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # as from another folder than the one that the path begins in
    for name, said in (("./mine", f"there is no folder {tmp_path}/mine. "), ("a.onnx", f"no file {tmp_path}/a.onnx. ")):
        status, _, err = checked(capsys, name)
        assert (status, said in err) == (2, True)
    assert kitchenmind.main(["agent", "check", "planner", "--layout", "nook.layout"]) == 2
    assert f"check: there is no layout 'nook.layout' in {tmp_path}. Known: " in capsys.readouterr().err
