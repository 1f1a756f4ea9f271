"""Dependencies of routes: the server's services, the requesting participant, templates and texts."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlencode

import jinja2
import msgspec
from fastapi import Depends, HTTPException, Request, Response
from fastapi.responses import HTMLResponse
from markupsafe import Markup
from starlette.requests import HTTPConnection

from server.participation.recruiter_links import may_start_new
from server.participation.served_studies import Studies
from server.store import participants
from server.store.database import Database
from server.store.participants import Participant
from server.study.definition import Study
from server.study.locale import Locale, best_language, languages, locale
from server.web.auth import session_of, token_for, token_of
from server.web.compiled_templates import compiled_templates
from server.web.csrf import FORM_FIELD, CsrfProtection
from server.web.forms import Form, FormExpired, first, read_form
from server.web.markdown import MARKDOWN
from server.web.participant.step_json import step_page, wants_json
from server.web.rate_limits import EnrolmentLimits
from server.web.security_headers import policy
from server.web.services import services_of

TEMPLATES = Path(__file__).parents[2] / "templates"


@dataclass(frozen=True)
class Web:
    """The services that every page uses (`Services.web`)."""

    database: Database
    studies: Studies
    csrf: CsrfProtection
    templates: jinja2.Environment
    enrolment_limits: EnrolmentLimits = field(default_factory=EnrolmentLimits)
    production: bool = False


@cache
def templates(root: str = "") -> jinja2.Environment:
    """Return the templates: escaped, and a missing name is an error. One for the process: compiling them takes a while.

    `root`: the path of the public address, which every address in a page begins with.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        bytecode_cache=compiled_templates(),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["root"] = root
    environment.filters["markdown"] = lambda words: Markup(MARKDOWN.render(words))  # noqa: S704 - HTML in it is escaped
    return environment


def compile_templates(root: str) -> None:
    """Compile every template: the first page of a kind takes some 50 ms otherwise, and all games would wait."""
    environment = templates(root)
    for name in environment.list_templates():
        environment.get_template(name)


def web_of(connection: HTTPConnection) -> Web:
    return services_of(connection).web


WebDep = Annotated[Web, Depends(web_of)]


async def games_first(connection: HTTPConnection) -> None:
    """Begin a request between two batches of timesteps: rendering a page takes milliseconds, which would delay
    games."""
    if connection.scope["type"] == "http":
        await services_of(connection).games.loop.between_batches()


async def plain_address(connection: HTTPConnection) -> None:
    """Answer 404 to an address with a NUL character: nothing has such a name, and PostgreSQL refuses to look for it."""
    if "\x00" in connection.scope["path"]:
        raise HTTPException(404, "Not Found")


async def own_form(request: Request, web: WebDep) -> Form:
    """Return the submitted form, from our own pages only."""
    return await read_form(request, web.csrf)


FormDep = Annotated[Form, Depends(own_form)]


@dataclass(frozen=True)
class SentForm:
    """A form that a participant filled in. `expired` is None, or the reason why it counts for nothing and is shown
    again."""

    form: Form
    expired: FormExpired | None = None


async def answers_form(request: Request, web: WebDep) -> SentForm:
    """Return `own_form` of the current step, also when the page was open for too long: answers take a while to write.
    They are checked one by one (server.study.answer_checks)."""
    try:
        form = await read_form(request, web.csrf, controls=True)
    except FormExpired as expired:
        if not expired.only_old or wants_json(request):
            raise
        return SentForm(expired.form, expired)
    return SentForm(form)


AnswersFormDep = Annotated[SentForm, Depends(answers_form)]


async def consent_form(request: Request, name: str, web: WebDep) -> SentForm:
    """Return `own_form` of the consent page, also when it is sent again: the first submission gave this browser its
    cookie."""
    secret, cookie = web.csrf.secret, token_of(request)
    try:
        form = await read_form(
            request, web.csrf, was_nobodys=lambda form: token_for(secret, name, first(form, "visit")) == cookie
        )
    except FormExpired as expired:
        return SentForm(expired.form, expired)
    return SentForm(form)


ConsentFormDep = Annotated[SentForm, Depends(consent_form)]


async def participant_of(request: Request, name: str, web: WebDep) -> Participant | None:
    """Return the participant with this study's cookie; None if there is none."""
    token = token_of(request)
    found = await web.database.read(participants.by_token, token) if token else None
    if found is None:
        return None
    study = web.studies.version(found.study_id)
    if study is None:  # another process serves a newer version
        await web.database.read(web.studies.learn)
        study = web.studies.version(found.study_id)
    return found if study is not None and study.name == name else None


ParticipantDep = Annotated[Participant | None, Depends(participant_of)]


@dataclass(frozen=True)
class OpenStudy:
    """A study that takes participants, and the number of its version in the database."""

    id: int
    study: Study


def open_study(name: str, web: WebDep) -> OpenStudy:
    """Return the study at this address. Answers 404 if there is none."""
    found = web.studies.open(name)
    if found is None:
        raise HTTPException(404, f"There is no study {name!r}. Use the link from your invitation.")
    return OpenStudy(*found)


OpenStudyDep = Annotated[OpenStudy, Depends(open_study)]


@dataclass(frozen=True)
class KnownStudy:
    """A study that takes participants, or took some before."""

    study: Study
    is_open: bool


def known_study(name: str, web: WebDep) -> KnownStudy:
    """Return the study at this address, in the newest stored version if it takes nobody new: its participants still
    read their code and delete their data. Answers 404 if there never was one."""
    opened = web.studies.open(name)
    if opened is not None:
        return KnownStudy(opened[1], True)
    versions = web.studies.versions(name)
    study = web.studies.version(versions[0]) if versions else None
    if study is None:
        raise HTTPException(404, f"There is no study {name!r}. Use the link from your invitation.")
    return KnownStudy(study, False)


KnownStudyDep = Annotated[KnownStudy, Depends(known_study)]


@dataclass(frozen=True)
class PageResponse:
    """One answer to be written: to whom, in which language, about which study."""

    request: Request
    web: Web
    language: str
    study: Study | None = None
    participant: Participant | None = None
    link: Mapping[str, str] | None = None  # the recruiter's parameters, for the answer to a form that carried them

    @property
    def words(self) -> Locale:
        return locale(self.language)

    def render(self, template: str, status: int = 200, **context: Any) -> Response:
        """Render the page, as JSON for programs; it is never cached, as it depends on the participant's progress."""
        base: dict[str, Any] = {
            "t": self.words,
            "language": self.language,
            "languages": [(name, locale(name).name) for name in self.languages],
            "study": self.study,
            "participant": self.participant,
            "token": self._token,
            "query_with_language": self._query_with_language,
            "path": f"{self.web.csrf.root}/s/{self.study.name}" if self.study else "",
            "may_start_new": self.study is not None and may_start_new(self.study),
            "phases": (),
            "phase": "",
            "expired": False,
        }
        base["shown_at"] = "" if self.link is None else base["path"]  # the address of a form is not that of a page
        headers = {"Cache-Control": "no-store", "Vary": "Accept"}
        if wants_json(self.request):
            made = step_page(template, base | context, self._form_token())
            return Response(msgspec.json.encode(made), status, headers, media_type="application/json")
        text = self.web.templates.get_template(template).render(base | context)
        return HTMLResponse(text, status, headers)

    def allow(self, response: Response, **more: str) -> None:
        """Let the page do more than others may (see headers.policy)."""
        host = self.request.headers.get("host", "")
        response.headers.update(policy(host, self.web.csrf.secure, **more))

    def _token(self) -> Markup:
        """Return the hidden field that every form needs (csrf.py)."""
        return Markup('<input type="hidden" name="{}" value="{}">').format(FORM_FIELD, self._form_token())

    def _form_token(self) -> str:
        return self.web.csrf.form_token(session_of(self.request))

    def _query_with_language(self, language: str) -> str:
        """Return the address's parameters with another language, so that a recruitment link stays complete."""
        given = self.request.query_params.multi_items() if self.link is None else list(self.link.items())
        return urlencode([*((name, value) for name, value in given if name != "lang"), ("lang", language)])

    @property
    def languages(self) -> tuple[str, ...]:
        """Return the languages of the page: those of the study, if there is one."""
        return self.study.languages if self.study else languages()


def page(
    request: Request, web: Web, study: Study | None = None, participant: Participant | None = None
) -> PageResponse:
    """Return a page in the participant's language; before consent in the link's `lang`, else in the one that the
    browser asks for."""
    offered = study.languages if study else languages()
    if participant is not None and participant.language in offered:
        language = participant.language
    elif (choice := request.query_params.get("lang", "")) in offered:
        language = choice
    else:
        language = best_language(request.headers.get("accept-language", ""), offered)
    return PageResponse(request, web, language, study, participant)
