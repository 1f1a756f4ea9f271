"""Signed forms and the origin of a request: what keeps other websites from acting for somebody who is signed in."""

import hashlib
from dataclasses import dataclass
from urllib.parse import urlsplit

from itsdangerous import BadSignature, TimestampSigner
from starlette.requests import HTTPConnection

FORM_S = 12 * 3600
FORM_FIELD = "form_token"
NOBODY = "nobody"  # the session of a form that was made before consent
_FORM = b"form"  # what a form's token signs; when and for which session is added to it
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
