"""The container set-up: a valid compose file that does not start without its secrets."""

import json
import os
import shutil
import subprocess
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml

from server.settings import Settings

ROOT = Path(__file__).parent.parent
SECRETS = {"POSTGRES_PASSWORD": "a", "KITCHENMIND_SECRET": "b", "KITCHENMIND_PUBLIC_URL": "https://lab.example.org"}


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


def test_compose_file_is_the_set_up_of_several_processes() -> None:
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    given = {
        name.removeprefix("KITCHENMIND_").lower(): value for name, value in services["server"]["environment"].items()
    }
    own = {name: value for name, value in given.items() if name in Settings.model_fields}
    studies = json.loads(own.pop("studies").partition(":-")[2].removesuffix("}"))
    assert all((ROOT / study).is_file() for study in studies)
    filled = own | {
        "studies": studies,
        "workers": 2,
        "secret": "kVx2-9TbQfLz7WmRs4cYhJp3nGd8uEaC",
        "public_url": "https://lab.example.org",
        "trusted_proxies": own["trusted_proxies"].partition(":-")[2].removesuffix("}"),
        "new_per_address": own["new_per_address"].partition(":-")[2].removesuffix("}"),
    }
    settings = Settings(**filled, _env_file=None)
    (network,) = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["networks"]["default"]["ipam"]["config"]
    assert network["subnet"] == own["trusted_proxies"], "who comes in by the gateway is the proxy, and nobody else"
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
