"""Settings with which a server refuses to start, and what it says of them."""

from collections.abc import Callable
from pathlib import Path
from secrets import token_hex, token_urlsafe

import pytest
from pydantic import ValidationError

import kitchenmind
from server.settings import Settings, settings_with

PUBLIC = "https://lab.example.org"
STRONG = "".join(chr(97 + number % 26) + str(number % 10) for number in range(20))


def settings(**values: object) -> Settings:
    return Settings(_env_file=None, **values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"secret": None, "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "changeme", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "a" * 40, "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": STRONG[:20], "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": STRONG, "public_url": ""}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "http://lab.example.org"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": PUBLIC, "speed": 2.0}, "KITCHENMIND_SPEED"),
        ({"secret": "12345678901234567890123456789012", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "98765432109876543210987654321098", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "abcdefghijklmnopqrstuvwxyz123456", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "0123456789abcdef0123456789abcdef", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "Ab3$xY9!" * 4, "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "change-me-please-this-is-secret-1", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": STRONG, "public_url": "https://"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "https://[x"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "https://lab.example.org/study?of=me"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "https://me:pw@lab.example.org"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "https://lab.example.org:99999"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "http://localhost", "host": "0.0.0.0"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "http://127.0.0.1:8000", "host": "::"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": PUBLIC, "metrics_token": "x"}, "KITCHENMIND_METRICS_TOKEN"),
        ({"secret": STRONG, "public_url": PUBLIC, "metrics_token": ""}, "KITCHENMIND_METRICS_TOKEN"),
        ({"secret": STRONG, "public_url": PUBLIC, "metrics_token": "1234567890123456"}, "KITCHENMIND_METRICS_TOKEN"),
        *(
            ({"secret": STRONG, "public_url": PUBLIC, "trusted_proxies": proxies}, "KITCHENMIND_TRUSTED_PROXIES")
            for proxies in (
                "*",
                "127.0.0.1,*",
                "0.0.0.0/0",
                "::/0",
                "0.0.0.0/1,128.0.0.0/1",
                "::ffff:0:0/96",
                "::/16",
                "172.28.57.1/24",
                "proxy",
                "",
            )
        ),
    ],
)
def test_production_refuses_to_start_with_what_is_not_safe(
    monkeypatch: pytest.MonkeyPatch, values: dict[str, object], named: str
) -> None:
    monkeypatch.delenv("KITCHENMIND_SECRET", raising=False)
    with pytest.raises(ValidationError, match=named) as refused:
        settings(mode="production", **values)
    assert str(values["secret"]) not in str(refused.value) or not values["secret"]


def test_production_starts_with_a_secret_and_tls_in_front() -> None:
    assert settings(mode="production", secret=STRONG, public_url=PUBLIC, host="0.0.0.0").mode == "production"


@pytest.mark.parametrize(
    "make",
    [
        lambda: token_hex(16),
        lambda: token_hex(32),
        lambda: token_urlsafe(32),
        lambda: "grüner Tee, zwölf Löffel & ein Keks",
    ],
    ids=["hex", "long hex", "urlsafe", "sentence"],
)
def test_production_takes_random_secrets(make: Callable[[], str]) -> None:
    secret = make()
    proxies = "127.0.0.1, ::1, 172.28.57.0/24, 10.0.0.0/8, ::ffff:10.0.0.0/104, fd00::/64"
    taken = settings(
        mode="production", secret=secret, public_url=f"{PUBLIC}:8443/", metrics_token=secret, trusted_proxies=proxies
    )
    assert taken.secret is not None
    assert taken.secret.get_secret_value() == secret


@pytest.mark.parametrize("command", [["admin", "list"], ["serve"], ["doctor"], ["verify"], ["export", "--out", "x"]])
def test_a_refused_setting_reveals_no_secret(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("KITCHENMIND_MODE", "production")
    monkeypatch.setenv("KITCHENMIND_SECRET", "hunter2hunter2")
    monkeypatch.setenv("KITCHENMIND_DATABASE", "postgresql://kitchenmind:hunter3hunter3@192.0.2.1/x")
    assert kitchenmind.main(command) == 2
    said = capsys.readouterr().err
    assert "KITCHENMIND_SECRET" in said
    assert "hunter" not in said


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("redis", "redis://:hunter2/hunter@127.0.0.1:6379/0"),
        ("redis", "redis://:hunter2#hunter@127.0.0.1:6379/0"),
        ("redis", "redis://:2/hunter@127.0.0.1:6379/0"),  # the password begins like a port
        ("redis", "redis://[hunter@127.0.0.1:6379/0"),
        ("alert_webhook", "https://chat.example.org:hunter/hooks"),
    ],
)
def test_an_address_that_is_not_understood_shows_no_piece_of_its_password(name: str, value: str) -> None:
    with pytest.raises(ValueError, match=f"KITCHENMIND_{name.upper()} must be an address like") as refused:
        settings_with(**{name: value}, database="postgresql://x@/y")
    assert "hunter" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("redis", "redis://:pass%2Fword@127.0.0.1:6379/0"),
        ("redis", "redis://"),
        ("redis", "unix:///run/redis/redis.sock?db=1"),
        ("alert_webhook", "https://lab.webhook.example.com/webhookb2/1@2/IncomingWebhook/3"),
    ],
)
def test_addresses_of_all_kinds_are_taken(name: str, value: str) -> None:
    assert getattr(settings_with(**{name: value}, database="postgresql://x@/y"), name).get_secret_value() == value


def test_without_production_nobody_else_can_reach_the_server() -> None:
    with pytest.raises(ValidationError, match="can be reached by others"):
        settings(host="0.0.0.0")


def test_the_secret_shows_in_no_text_of_the_settings() -> None:
    assert STRONG not in repr(settings(secret=STRONG))
