"""Authentication of participants: the cookie, signed forms, and checks of a request's origin."""

import hashlib
import hmac
from dataclasses import dataclass
from urllib.parse import urlsplit

from fastapi import Request, Response
from itsdangerous import BadSignature, Signer, TimestampSigner
from starlette.requests import HTTPConnection

from server.web.services import services_of

COOKIE = "participant"
COOKIE_S = 30 * 24 * 3600
FORM_S = 12 * 3600
FORM_FIELD = "form_token"
_FORM = b"form"  # what a form's token signs; when and for which session is added to it
BOT_MARK = "simulated_by"  # the field of a consent form with `bot_mark`
NOBODY = "nobody"  # the session of a form that was made before consent
_LOCAL_HOSTS = frozenset({"127.0.0.1", "localhost", "[::1]"})


@dataclass(frozen=True)
class CsrfProtection:
    """Signs forms and checks origins. `public_url` empty: use the address that the browser requested."""

    secret: bytes
    public_url: str = ""

    @property
    def secure(self) -> bool:
        """Whether cookies may travel over TLS only."""
        return self.public_url.startswith("https://")

    @property
    def root(self) -> str:
        """The path of the public address, below which our pages are: empty, or like `/kitchen`."""
        return urlsplit(self.public_url).path.rstrip("/")

    def form_token(self, session: str, now_s: float | None = None) -> str:
        """Return what a form must bring back: when it was made, signed for the session that it was made for."""
        return self._form_signer(session, now_s).sign(_FORM).decode()

    def is_own_form(self, token: str, session: str, now_s: float | None = None, max_age_s: float = FORM_S) -> bool:
        """Return whether we made the form for this session, less than half a day ago. A form from the future counts
        too: the signature is ours, so the machine's clock was set back since then. `max_age_s`: at most so old."""
        signer = self._form_signer(session, now_s)
        try:
            value, made = signer.unsign(token, return_timestamp=True)
        except BadSignature:
            return False
        return value == _FORM and abs(signer.get_timestamp() - made.timestamp()) <= max_age_s

    def is_own_origin(self, connection: HTTPConnection) -> bool:
        """Return whether a POST or a socket comes from our own pages. A client that is not a browser sends no Origin
        and may pass: it does not send somebody's cookie unintentionally."""
        origin = connection.headers.get("origin")
        if origin is None:
            return connection.headers.get("sec-fetch-site", "same-origin") in ("same-origin", "none")
        return origin.rstrip("/").lower() in self._own_origins(connection)

    def _own_origins(self, connection: HTTPConnection) -> tuple[str, ...]:
        if self.public_url:
            url = urlsplit(self.public_url)
            return (f"{url.scheme}://{url.netloc}".lower(),)
        host = connection.headers.get("host", "").lower()
        if host.rpartition(":")[0] not in _LOCAL_HOSTS and host not in _LOCAL_HOSTS:
            return ()  # another host name that resolves to this server (DNS rebinding)
        return (f"http://{host}", f"https://{host}")

    def _form_signer(self, session: str, now_s: float | None) -> "_FormSigner":
        # The session goes into the key and not into the token: it is a secret, and the token is in the page.
        signer = _FormSigner(self.secret, salt=f"form\n{session}", key_derivation="hmac", digest_method=hashlib.sha256)
        signer.now_s = now_s
        return signer


class _FormSigner(TimestampSigner):
    """A TimestampSigner whose clock can be given."""

    now_s: float | None = None

    def get_timestamp(self) -> int:
        return super().get_timestamp() if self.now_s is None else int(self.now_s)


def cookie_name(name: str, secure: bool) -> str:
    """Return the cookie's name; over TLS with a prefix, so that browsers accept it only over TLS and no other subdomain
    can set it."""
    return f"__Secure-{name}" if secure else name


def token_of(connection: HTTPConnection) -> str | None:
    """Return the participant's token, from the cookie."""
    secure = services_of(connection).web.csrf.secure
    token = connection.cookies.get(cookie_name(COOKIE, secure), "")
    return token if 20 <= len(token) <= 200 else None


def set_cookie(response: Response, study: str, token: str, *, secure: bool) -> None:
    """Set the cookie, for this study's pages only and invisible to scripts."""
    name, path = cookie_name(COOKIE, secure), f"/s/{study}"
    response.set_cookie(name, token, max_age=COOKIE_S, path=path, secure=secure, httponly=True, samesite="lax")


def forget_cookie(response: Response, study: str, *, secure: bool) -> None:
    name = cookie_name(COOKIE, secure)
    response.delete_cookie(name, path=f"/s/{study}", secure=secure, httponly=True, samesite="lax")


def bot_mark(secret: bytes, visit: str) -> str:
    """Return what a simulated participant sends at consent: making it needs the server's secret, so that nobody else is
    counted as a bot."""
    return _bot_signer(secret).get_signature(visit).decode()


def is_bot_mark(secret: bytes, visit: str, mark: str) -> bool:
    """Return whether the mark was made with the server's secret for this consent page."""
    return _bot_signer(secret).verify_signature(visit, mark)


def _bot_signer(secret: bytes) -> Signer:
    return Signer(secret, salt="simulated", key_derivation="hmac", digest_method=hashlib.sha256)


def session_of(request: Request) -> str:
    """Return what a form is bound to: the participant's token, or nothing before consent."""
    return token_of(request) or NOBODY


def token_for(secret: bytes, study: str, visit: str) -> str:
    """Return the participant's token. It is derived from the consent page, so submitting the page twice does not create
    two participants."""
    return hmac.new(secret, f"participant\n{study}\n{visit}".encode(), hashlib.sha256).hexdigest()
