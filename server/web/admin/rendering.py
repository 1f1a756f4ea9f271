"""How a researcher's page is rendered: the template with what all of them need, in English."""

from dataclasses import dataclass
from typing import Any

from fastapi import HTTPException, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from markupsafe import Markup

from server.store.admins import AdminSession
from server.study.checks import capitalised
from server.study.definition import Study
from server.web.admin.researcher_auth import form_session
from server.web.csrf import FORM_FIELD
from server.web.dependencies import Web, web_of
from server.web.security_headers import policy

SEE_OTHER = 303
NOT_FOUND = 404
OUTCOMES = {
    "paused": "The game is paused.",
    "resumed": "The game continues.",
    "resumed_later": "This game is no longer paused on its own. It continues when you resume the study.",
    "ended": "The game is ended.",
    "sent": "The message is sent.",
    "extended": "The participant has more time now.",
    "extended_silent": "The participant has more time now. The place is not held, though, until they send the first "
    "page after consent: another participant can take it.",
    "excluded": "The data are excluded.",
    "restored": "The exclusion is undone.",
    "released": "The place is free again.",
    "study_paused": "The study is paused: nobody can join, and no game runs.",
    "study_resumed": "The study continues.",
    "version_served": "The new version is served: new participants get it.",
    "version_refused": "The new version could not be served. The alerts and the log have the reason.",
    "signed_out": "The account is signed out everywhere.",
    "removed": "The account is removed.",
    "account_gone": "No action taken: there is no such account any more.",
    "deleted": "The participant is deleted. The audit log records it, and only the count of withdrawals is kept.",
    "nobody_found": "There is no participant with this id or code in this study.",
    "kitchen_removed": "The kitchen is removed. Its history is kept.",
    "version_unchanged": "No action taken: the study file is already served as it is.",
    "draft_restored": "The text is restored. The one before it is in the history.",
    "draft_deleted": "The draft is deleted.",
    "draft_is_open": "No action taken: close the study first.",
    "draft_conflict": "No action taken: somebody else has changed the draft. Check the changes first.",
    "draft_faulty": "The study is not open yet: correct the listed problems first.",
    "draft_name_taken": "The study is not open: another draft with this name is open.",
    "draft_refused": "The study could not be opened. The server's log has the reason.",
    "draft_opened": "The study is open: participants can join.",
    "draft_opened_paused": "The study is open, but paused: participants can join when you resume it.",
    "draft_opened_renamed": "The study is open under its new name. The study with its former name is open, too, until "
    "you close it below.",
    "preview_players": "No action taken: participants are playing, and this would slow down their games.",
    "preview_models": "An agent or predictor of this round could not be loaded. The server's log has the reason.",
    "preview_stays": "In the preview, this does nothing. In an open study, it works.",
    "bots_players": "No action taken: participants are playing, and bots would slow down their games.",
    "bots_busy": "No action taken: another rehearsal is running. Try again when it is over.",
    "draft_closed": "The study is closed: nobody new can join. Current participants can finish.",
    "gone": "No action taken: the game or visit has already ended, or its server process did not answer.",
}


@dataclass(frozen=True)
class AdminPage:
    """One answer to one researcher."""

    request: Request
    admin: AdminSession | None = None

    @property
    def web(self) -> Web:
        return web_of(self.request)

    def render(self, template: str, status: int = 200, **context: Any) -> HTMLResponse:
        base: dict[str, Any] = {
            "admin": self.admin,
            "token": Markup('<input type="hidden" name="{}" value="{}">').format(FORM_FIELD, self.form_token()),
            "outcome": OUTCOMES.get(self.request.query_params.get("outcome", "")),
            "here": self.request.url.path,
            "tab": "",
            "study": None,
            "embedded": False,
        }
        text = self.web.templates.get_template(f"admin/{template}").render(base | context)
        return HTMLResponse(text, status, {"Cache-Control": "no-store"})

    def allow(self, response: Response, **more: str) -> Response:
        """Let the page do more than others may (see security_headers.policy)."""
        host = self.request.headers.get("host", "")
        response.headers.update(policy(host, self.web.csrf.secure, **more))
        return response

    def study_address(self, name: str) -> str:
        """Return what participants open, in full."""
        csrf = self.web.csrf
        base = csrf.public_url.rstrip("/") or str(self.request.base_url).rstrip("/")
        return f"{base}/s/{name}"

    def form_token(self) -> str:
        """Return what every form of this session must bring back."""
        return self.web.csrf.form_token(form_session(self.request))


def researchers_error(request: Request, status: int, reason: str) -> HTMLResponse:
    """Return what a researcher sees of a request that failed; nobody is known on this page, so it says nothing of a
    study."""
    title = "Page not found" if status == NOT_FOUND else "That did not work"
    text = "Check the address." if reason == "Not Found" else f"{capitalised(reason.rstrip('.'))}."
    return AdminPage(request).render("error.html", status, title=title, text=text)


def back_to(path: str, outcome: str = "") -> RedirectResponse:
    """Redirect to one of our own pages, with a word about what was done."""
    return RedirectResponse(path + (f"?outcome={outcome}" if outcome else ""), SEE_OTHER, {"Cache-Control": "no-store"})


def own_path(path: str) -> str:
    """Return the path if it is one of a researcher's pages, else their first page."""
    plain = all(letter.isalnum() or letter in "/_-.~" for letter in path)
    climbs = {".", ".."} & set(path.split("/"))  # behind a path of the address, /admin/../.. is another site
    return path if plain and path.startswith("/admin/") and "//" not in path and not climbs else "/admin"


def study_at(web: Web, name: str) -> tuple[tuple[int, ...], Study]:
    """Return the numbers of all versions of a study, newest first, and the newest itself. Answers 404 where there is
    none."""
    versions = web.studies.versions(name)
    opened = web.studies.open(name)
    if opened is not None:
        return versions, opened[1]
    study = web.studies.version(versions[0]) if versions else None
    if study is None:
        raise HTTPException(404, f"There is no study {name!r}. Open it from the list of studies.")
    return versions, study
