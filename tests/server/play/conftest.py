from tests.support.running_games import running as running
