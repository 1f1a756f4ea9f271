"""The container set-up: a valid compose file that does not start without its secrets."""

import os
import re
import shutil
import subprocess
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml

from server.monitoring.opened_games import MAX_BYTES
from server.settings import Settings
from server.web.admin.draft_pages import MAX_DRAFT_BYTES

ROOT = Path(__file__).parent.parent
SECRETS = {"POSTGRES_PASSWORD": "a", "KITCHENMIND_SECRET": "b", "KITCHENMIND_PUBLIC_URL": "https://lab.example.org"}
STRONG = SECRETS | {"KITCHENMIND_SECRET": "kVx2-9TbQfLz7WmRs4cYhJp3nGd8uEaC"}


def compose(environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    program = shutil.which("docker-compose")
    if program is None:
        pytest.skip("docker-compose is not installed here")
    command = [program, "--file", str(ROOT / "docker-compose.yml"), "config"]
    variables = {"PATH": os.environ["PATH"], **environment}
    return subprocess.run(command, capture_output=True, text=True, env=variables, cwd=ROOT / "docs")


def test_compose_file_is_accepted() -> None:
    accepted = compose(SECRETS | {"KITCHENMIND_SUBNET": "10.99.0.0/24"})
    assert accepted.returncode == 0, accepted.stderr
    services = yaml.safe_load(accepted.stdout)["services"]
    assert services["server"]["environment"]["KITCHENMIND_TRUSTED_PROXIES"] == "10.99.0.0/24"
    assert services["server"]["environment"]["KITCHENMIND_PUBLIC_URL"] == SECRETS["KITCHENMIND_PUBLIC_URL"]


@pytest.mark.parametrize("missing", SECRETS)
def test_compose_file_is_refused_without_a_secret(missing: str) -> None:
    refused = compose({name: value for name, value in SECRETS.items() if name != missing})
    assert refused.returncode != 0
    assert "set it in .env" in refused.stderr


def test_no_container_can_gain_rights() -> None:
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    assert all(service["security_opt"] == ["no-new-privileges:true"] for service in services.values())
    assert services["server"]["cap_drop"] == ["ALL"]


def given(environment: dict[str, str]) -> dict[str, str]:
    """The server's variables as compose fills them in from an environment."""
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]

    def filled(found: re.Match[str]) -> str:
        return environment.get(found["name"]) or found["default"] or ""

    pattern = r"\$\{(?P<name>\w+)(?::-(?P<default>[^}]*)|:\?[^}]*)\}"
    return {name: re.sub(pattern, filled, value) for name, value in services["server"]["environment"].items()}


def test_compose_passes_every_setting_or_it_makes_no_sense_in_a_container() -> None:
    elsewhere = {
        "host",
        "port",
        "data",
        "speed",
        "patience_s",
    }  # the image's command and volume; simulated participants
    passed = {name.removeprefix("KITCHENMIND_").lower() for name in given({}) if name.startswith("KITCHENMIND_")}
    assert passed | elsewhere == set(Settings.model_fields)
    assert not passed & elsewhere


def test_what_the_env_file_leaves_out_keeps_its_default(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in given(STRONG).items():
        monkeypatch.setenv(name, value)
    settings, plain = Settings(_env_file=None), Settings.model_construct()
    for name in (
        "model_workers",
        "models_folder",
        "new_per_address",
        "stop_within_s",
        "metrics_token",
        "alert_webhook",
    ):
        assert getattr(settings, name) == getattr(plain, name), name


def test_what_the_env_file_says_reaches_the_server(monkeypatch: pytest.MonkeyPatch) -> None:
    own = {
        "MODEL_WORKERS": "3",
        "STOP_WITHIN_S": "60",
        "NEW_PER_ADDRESS": "0",
        "ALERT_WEBHOOK": "https://chat.example.org",
    }
    for name, value in given(STRONG | {f"KITCHENMIND_{name}": value for name, value in own.items()}).items():
        monkeypatch.setenv(name, value)
    settings = Settings(_env_file=None)
    assert (settings.model_workers, settings.stop_within_s, settings.new_per_address) == (3, 60, 0)
    assert settings.alert_webhook is not None
    assert settings.alert_webhook.get_secret_value() == "https://chat.example.org"


def test_compose_file_is_the_set_up_of_several_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    for name, value in given(STRONG).items():
        monkeypatch.setenv(name, value)
    settings = Settings(_env_file=None)
    assert all((ROOT / study).is_file() for study in settings.studies)
    assert settings.workers == 2
    (network,) = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["networks"]["default"]["ipam"]["config"]
    assert network["subnet"] == services["server"]["environment"]["KITCHENMIND_TRUSTED_PROXIES"], (
        "who comes in by the gateway is the proxy, and nobody else"
    )
    assert settings.trusted_proxies == "172.28.57.0/24"
    assert settings.redis is not None
    assert settings.redis.get_secret_value().split("/")[2].split(":")[0] in services
    assert urlsplit(settings.database).hostname in services
    assert set(services["server"]["depends_on"]) == services.keys() - {"server"}
    assert "health/ready" in str(services["server"]["healthcheck"])
    assert services["server"]["init"], "the first process of a container gets the orphans of those that were killed"


def test_no_service_is_open_to_other_machines_and_all_are_watched() -> None:
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    ports = [port for service in services.values() for port in service.get("ports", [])]
    assert all(port.startswith("127.0.0.1:") for port in ports)
    assert "HEALTHCHECK" in (ROOT / "Dockerfile").read_text()
    assert all("healthcheck" in service for service in services.values())


def test_image_leaves_data_and_secrets_of_the_checkout_behind() -> None:
    ignored = (ROOT / ".dockerignore").read_text().split()
    assert {".git", ".venv", ".env", "var", "runs"} <= set(ignored)


def test_nginx_of_the_guide_accepts_what_the_server_accepts() -> None:
    """Its default is 1 MB: recorded games and long drafts would be refused before the server sees them."""
    guide = (ROOT / "docs" / "guides" / "run_on_a_server.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^location [^{]*\{(.*?)^\}", guide, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        found = re.search(r"client_max_body_size (\d+)m;", block)
        assert found is not None, block
        assert int(found.group(1)) * 1024**2 >= max(MAX_BYTES, MAX_DRAFT_BYTES)
