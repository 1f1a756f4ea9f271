"""Settings of the server, from KITCHENMIND_* variables, a .env file or options of `kitchenmind serve`.

The string below each setting is its description in docs/reference/settings.md.
"""

import ipaddress
import os
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any, Literal, Self
from urllib.parse import quote, urlsplit

from pydantic import Field, SecretStr, ValidationError, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from server.kept_secret import kept_secret
from server.weak_secrets import is_weak

ROOT = Path(__file__).resolve().parent.parent  # a checkout, or the folder in which packages are installed
IS_CHECKOUT = (ROOT / "pyproject.toml").is_file()
DATABASE_FILE = "kitchenmind.sqlite3"
_LOCAL_HOSTS = frozenset({"127.0.0.1", "::1", "localhost"})
_MIN_SECRET_LENGTH, _MIN_TOKEN_LENGTH = 32, 16
_RANDOM_OF_SECRET, _RANDOM_OF_TOKEN = 20, 12  # unpredictable characters that it must have
_MAKE_ONE = "`python3 -c 'import secrets; print(secrets.token_urlsafe(32))'`"
_IN_PASSWORDS = "In a password, write / as %2F, # as %23, ? as %3F and @ as %40"
_PLAIN_ADDRESS = re.compile(
    r"https?://(?P<host>[A-Za-z0-9](?:[A-Za-z0-9.-]*[A-Za-z0-9])?|\[[0-9A-Fa-f:.]+\])(?::(?P<port>[0-9]{1,5}))?"
    r"(?:/[A-Za-z0-9_-]+)*/?"
)
_WIDEST_PROXY = {4: 8, 6: 16}  # bits that a network of proxies must fix, at least
_IPV4_IN_IPV6 = ipaddress.IPv6Network("::ffff:0:0/96")  # how a socket of both kinds names IPv4 addresses


class Settings(BaseSettings):
    """Every setting has a default for local use; `mode = production` refuses unsafe values."""

    model_config = SettingsConfigDict(
        env_prefix="KITCHENMIND_",
        env_file=".env",
        env_ignore_empty=True,  # docker-compose.yml passes each setting that .env leaves out as an empty one
        frozen=True,
        extra="ignore",
        hide_input_in_errors=True,
    )

    mode: Literal["local", "production"] = "local"
    """`production` is for a study on a public address. It requires a secret and TLS in front of the server."""
    host: str = "127.0.0.1"
    """The address to listen on. `0.0.0.0` means every address of the machine."""
    port: int = Field(default=8000, ge=0, le=65535)
    """The port to listen on. `0` takes a free one."""
    data: Path = ROOT / "var" if IS_CHECKOUT else Path("kitchenmind-data")
    """The folder for what the server keeps: the database, unless `database` names another, the secret of local mode,
    and in `models` the agents and predictors that you trained, which studies name. Default: `var` in a checkout, else
    `kitchenmind-data` in the folder where the command runs."""
    database: str = ""
    """The database: `sqlite:///path/to/file` or `postgresql://user@host/name`. Empty: the file `kitchenmind.sqlite3` in
    the folder `data`."""
    studies: tuple[Path, ...] = (ROOT / "studies" / "quick_look.yaml", ROOT / "studies" / "external_predictor.yaml")
    """The study files to serve, as a JSON list: `["studies/quick_look.yaml"]`."""
    models_folder: Path | None = None
    """The folder in which relative model paths start. Empty: the folder of the study file."""
    secret: SecretStr | None = None
    """Signs forms: at least 32 random characters. Production refuses rows of digits or keys and repeated characters.
    In local mode the server makes a secret and keeps it in the folder `data`."""
    public_url: str = ""
    """The address that browsers use, such as `https://lab.example.org` or `https://lab.example.org/kitchen`. Behind a
    path, the proxy may pass requests on with the path or without it. Empty: the address of each request."""
    trusted_proxies: str = "127.0.0.1"
    """Addresses or networks of the TLS proxy, separated by commas. The server believes `X-Forwarded-*` headers only
    from them. Production refuses `*`."""
    new_per_address: int = Field(default=10, ge=0, le=100_000)
    """New participants from one address in an hour, so that one person cannot fill a study. An IPv6 site (/48) may
    bring four times as many. `0`: no limit. Raise it for a lab or a class behind one address. All server
    processes share the count. In local mode the machine itself is not counted."""
    workers: int = Field(default=1, ge=1, le=64)
    """The number of server processes. More than one needs PostgreSQL and Redis."""
    redis: SecretStr | None = None
    """Redis for several server processes: `redis://host:6379/0`. No data is lost with it."""
    model_workers: int = Field(default=1, ge=1, le=64)
    """Processes that run agents and predictors, for each server process."""
    speed: float = Field(default=1.0, gt=0, le=100)
    """The speed of the game clock: 1 for people, more for tests and simulated participants."""
    patience_s: float = Field(default=0.0, ge=0, le=60)
    """For simulated participants: a timestep is made as soon as its players have acted, after this many seconds at the
    latest. `0`: at its usual time."""

    stop_within_s: float = Field(default=25.0, gt=0, le=600)
    """The longest time that stopping may take. systemd and Docker must wait longer before they kill the process."""
    log: Literal["text", "json"] = "text"
    """`text` logs warnings and errors. `json` logs everything, one JSON object per line."""
    metrics_token: SecretStr | None = None
    """Allows requests with `Authorization: Bearer TOKEN` to read `/metrics`. Without a token, only local mode shows
    them. Production requires at least 16 random characters."""
    alert_webhook: SecretStr | None = None
    """The address to which alerts are posted as JSON, such as a chat's incoming webhook. Keep it secret."""

    @model_validator(mode="before")
    @classmethod
    def _database_in_the_folder(cls, values: dict[str, Any]) -> dict[str, Any]:
        if values.get("database"):
            return values
        return values | {"database": _database_in(Path(values.get("data") or cls.model_fields["data"].default))}

    @model_validator(mode="after")
    def _several_can_share(self) -> Self:
        several = self.workers > 1 or self.redis is not None
        if several and self.database.startswith("sqlite"):
            raise ValueError(
                "several workers cannot share SQLite, which takes one writing process. "
                "Use PostgreSQL: --database postgresql://user@host/name"
            )
        if self.workers > 1 and self.redis is None:
            raise ValueError(
                f"{self.workers} workers need Redis to find each other's games: --redis redis://127.0.0.1:6379/0"
            )
        if self.redis is not None and not _is_address(self.redis, "redis", "rediss", "unix"):
            raise ValueError(f"KITCHENMIND_REDIS must be an address like redis://127.0.0.1:6379/0. {_IN_PASSWORDS}")
        return self

    @model_validator(mode="after")
    def _address_can_be_posted_to(self) -> Self:
        if self.alert_webhook is not None and not _is_address(self.alert_webhook, "http", "https"):
            raise ValueError("KITCHENMIND_ALERT_WEBHOOK must be an address like https://chat.example.org/hooks/...")
        return self

    @model_validator(mode="after")
    def _address_is_plain(self) -> Self:
        found = _PLAIN_ADDRESS.fullmatch(self.public_url)
        if self.public_url and (found is None or int(found["port"] or 443) > 65535):
            raise ValueError(
                "KITCHENMIND_PUBLIC_URL must be an address like https://lab.example.org, https://lab.example.org:8443 "
                "or https://lab.example.org/kitchen: no user name, only letters, digits, - and _ in a path, and "
                "other letters of a host name in their xn-- form"
            )
        if self.metrics_token is not None and not self.metrics_token.get_secret_value():
            raise ValueError(f"KITCHENMIND_METRICS_TOKEN is empty. Leave it out, or make one with {_MAKE_ONE}")
        return self

    @model_validator(mode="after")
    def _safe_in_production(self) -> Self:
        if self.mode == "local":
            if self.host not in _LOCAL_HOSTS:
                raise ValueError(
                    f"host = {self.host} can be reached by others. Set KITCHENMIND_MODE=production with a secret and a "
                    "TLS proxy in front, or listen on 127.0.0.1"
                )
            return self
        secret = self.secret.get_secret_value() if self.secret else ""
        if len(secret) < _MIN_SECRET_LENGTH or is_weak(secret, _RANDOM_OF_SECRET):
            raise ValueError(
                f"production needs KITCHENMIND_SECRET with at least {_MIN_SECRET_LENGTH} random characters, "
                f"e.g. from {_MAKE_ONE}"
            )
        token = self.metrics_token.get_secret_value() if self.metrics_token else None
        if token is not None and (len(token) < _MIN_TOKEN_LENGTH or is_weak(token, _RANDOM_OF_TOKEN)):
            raise ValueError(
                f"production needs a KITCHENMIND_METRICS_TOKEN of at least {_MIN_TOKEN_LENGTH} random characters, "
                f"or none. Make one with {_MAKE_ONE}"
            )
        url = urlsplit(self.public_url)
        only_here = url.hostname in _LOCAL_HOSTS and self.host in _LOCAL_HOSTS
        if url.scheme != "https" and not only_here:
            raise ValueError(
                "production needs KITCHENMIND_PUBLIC_URL=https://..., the address of the TLS proxy in front: "
                "participants' cookies must not travel in the clear"
            )
        _check_proxies(self.trusted_proxies)
        if self.speed != 1.0 or self.patience_s:
            raise ValueError(
                "production needs KITCHENMIND_SPEED=1 and no KITCHENMIND_PATIENCE_S: people play in real time"
            )
        return self

    @property
    def own_models(self) -> Path:
        """The folder of trained models, KITCHEN/NAME, which studies can name."""
        return self.data.absolute() / "models"

    @property
    def own_kitchens(self) -> Path:
        """The folder in which each kitchen of the dashboard is a `.layout` file, for the commands that train."""
        return self.data.absolute() / "kitchens"

    @property
    def has_database(self) -> bool:
        """Whether the database is in the folder `data`."""
        return self.database == _database_in(self.data)

    @property
    def data_option(self) -> str:
        """The option, after a space, with which other commands find this server's database; "" if they need none, or
        if the database is somewhere else."""
        is_default = self.data == type(self).model_fields["data"].default
        return "" if is_default or not self.has_database else f" --data {shlex.quote(str(self.data))}"

    def make_data_folder(self) -> None:
        """Create the folder `data` if it will be used. Raises OSError."""
        if self.secret is None or self.has_database:
            self.data.mkdir(mode=0o700, parents=True, exist_ok=True)

    def signing_key(self) -> bytes:
        """Return the secret; for local use one is made at the first start and kept, readable by the owner
        only. Raises ValueError, OSError."""
        if self.secret is not None:
            return self.secret.get_secret_value().encode()
        self.make_data_folder()
        return kept_secret(self.data / "secret")


def settings_with(**given: Any) -> Settings:
    """Return the environment's settings, overridden by what is given and not None. Raises ValueError."""
    try:
        return Settings(**{name: value for name, value in given.items() if value is not None})
    except ValidationError as error:
        raise ValueError("; ".join(_plain(one) for one in error.errors())) from None


def own_models_here(data: Path | None = None) -> Path:
    """Return the folder of trained models for a command, also if settings that only a server needs are wrong. `data`:
    the server's folder, if an option names it."""
    if data is not None:
        return data.absolute() / "models"
    try:
        return Settings().own_models
    except ValueError:
        folder: Path = Settings.model_fields["data"].default
        return Path(os.environ.get("KITCHENMIND_DATA") or folder).absolute() / "models"


def program() -> str:
    """Return how `kitchenmind` is called from the folder of this process: by its name if it is on the PATH, else by its
    path, as in a checkout whose environment is not activated."""
    path = Path(sys.executable).with_name("kitchenmind")
    found = shutil.which("kitchenmind")
    if not path.is_file() or (found is not None and Path(found).samefile(path)):
        return "kitchenmind"
    return shlex.quote(str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path))


def _is_address(secret: SecretStr, *schemes: str) -> bool:
    """Return whether an address can be used. The texts of urlsplit's errors hold pieces of it, perhaps of a password,
    so they are dropped."""
    try:
        url = urlsplit(secret.get_secret_value())
        _ = url.port  # raises ValueError if it is not a number
    except ValueError:
        return False
    if "redis" in schemes:  # without a host it is this machine; an @ after the host was meant to end a password
        return url.scheme in schemes and "@" not in f"{url.path}{url.query}{url.fragment}"
    return url.scheme in schemes and bool(url.hostname)


def _plain(error: Any) -> str:
    """Return what is wrong with a setting, without pydantic's own prefix."""
    name = "".join(f"KITCHENMIND_{part.upper()}: " for part in error["loc"][:1])
    return f"{name}{error['msg'].removeprefix('Value error, ')}"


def _database_in(folder: Path) -> str:
    return f"sqlite:///{quote(str(folder.absolute() / DATABASE_FILE))}"


def _check_proxies(trusted: str) -> None:
    """Raise ValueError for settings with which any client could forge the address of a request."""
    for one in (piece.strip() for piece in trusted.split(",")):
        remedy = "KITCHENMIND_TRUSTED_PROXIES takes addresses and networks of the TLS proxy, like 172.28.57.0/24"
        try:
            network = ipaddress.ip_network(one)
        except ValueError:
            raise ValueError(f"{one!r} is not an address or a network. {remedy}") from None
        if _is_too_wide(network):
            raise ValueError(f"{one} is too wide: almost everybody could claim any address. {remedy}")


def _is_too_wide(network: ipaddress.IPv4Network | ipaddress.IPv6Network) -> bool:
    if isinstance(network, ipaddress.IPv6Network) and network.overlaps(_IPV4_IN_IPV6):
        return network.prefixlen - _IPV4_IN_IPV6.prefixlen < _WIDEST_PROXY[4]
    return network.prefixlen < _WIDEST_PROXY[network.version]
