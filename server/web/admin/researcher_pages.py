"""A researcher's pages: signing in and out, studies, one study's dashboard, people, the audit log, accounts. Thin."""

import asyncio
from typing import Any

from fastapi import APIRouter, HTTPException, Request, Response
from sqlalchemy import Connection

from server.monitoring import latency_history
from server.monitoring.arm_names import arm_names
from server.monitoring.dashboard import step_name, steps_of
from server.monitoring.enrolment_flow import arms_of, flow_of, stock
from server.monitoring.live_games import who
from server.participation.model_hashes import changed_models
from server.participation.study_warnings import warnings_of
from server.store import admins, answers, attempts, audit, interventions, overview, participants, study_openings
from server.store.overview import Played
from server.study.definition import Study
from server.web import guess_limits
from server.web.admin import researcher_auth
from server.web.admin.rendering import AdminPage, back_to, own_path, study_at
from server.web.admin.researcher_auth import ActDep, AdminFormDep, OwnDep, WatchDep
from server.web.dependencies import Web, WebDep
from server.web.forms import Form, first
from server.web.guess_limits import Busy
from server.web.services import Services, ServicesDep

router = APIRouter(prefix="/admin")
AUDIT_SHOWN = 500
BUSY_S = 5
_WINDOW_MIN = round(attempts.WINDOW.total_seconds() / 60)


@router.get("/login")
async def login_page(request: Request) -> Response:
    """Ask for name and password."""
    return AdminPage(request).render("login.html", next=request.query_params.get("next", ""), wrong="")


@router.post("/login")
async def login(request: Request, web: WebDep, form: AdminFormDep, services: ServicesDep) -> Response:
    """Begin a new session, whatever session there was; after too many wrong passwords the client has to wait."""
    name = first(form, "name")[:128]
    try:
        outcome, stored = await researcher_auth.sign_in(
            web, services.hashing, request, name, first(form, "password")[:200]
        )
    except Busy:
        return _login_refused(request, form, 429, "Too many people are signing in. Try again in a moment.", BUSY_S)
    if outcome.left is None:
        words = f"Too many wrong passwords. Try again in {_WINDOW_MIN} minutes."
        return _login_refused(request, form, 429, words, _WINDOW_MIN * 60)
    if not outcome.right or stored is None:
        words = f"Wrong name or password. {outcome.left} {'try' if outcome.left == 1 else 'tries'} left."
        return _login_refused(request, form, 401, words)
    token = await researcher_auth.begin_session(web, name, await researcher_auth.session_of(request))
    signed_in = back_to(own_path(first(form, "next")))
    researcher_auth.set_cookie(signed_in, token, secure=web.csrf.secure)
    guess_limits.remember_browser(web, signed_in, name, stored)
    return signed_in


def _login_refused(request: Request, form: Form, status: int, words: str, wait_s: int = 0) -> Response:
    response = AdminPage(request).render("login.html", status, next=first(form, "next"), wrong=words)
    if wait_s:
        response.headers["Retry-After"] = str(wait_s)
    return response


@router.post("/logout")
async def logout(admin: WatchDep, web: WebDep, form: AdminFormDep) -> Response:  # noqa: ARG001 - checks the form
    """End the session everywhere, also where its cookie was copied to."""
    await web.database.write(admins.close_session, admin.token_hash)
    await web.database.write(audit.add, admin.name, "sign out")
    response = back_to("/admin/login")
    researcher_auth.forget_cookie(response, secure=web.csrf.secure)
    return response


@router.get("")
async def studies(request: Request, admin: WatchDep, web: WebDep) -> Response:
    """List all studies of this server, including closed ones that are no longer served after a restart."""
    paused = await web.database.read(interventions.paused_studies)
    closed = await web.database.read(study_openings.closed)
    rows = []
    kept = sorted(name for name in closed if web.studies.versions(name))
    for name in dict.fromkeys((*web.studies.names(), *kept)):
        versions, study = study_at(web, name)
        held = await web.database.read(stock, overview.Group(versions))
        arms = arms_of(study, held, arm_names(study, True, held.conditions), blind=True)
        targets = [arm["target"] for arm in arms]
        rows.append(
            {
                "name": name,
                "title": study.title.of("en"),
                "summary": study.summary.of("en"),
                "paused": name in paused,
                "closed": name in closed,
                "versions": len(versions),
                "completed": sum(arm["completed"] for arm in arms),
                "active": sum(arm["active"] for arm in arms),
                "simulated": sum(arm["simulated"] for arm in arms),
                "target": None if None in targets else sum(targets),
            }
        )
    return AdminPage(request, admin).render("studies.html", tab="studies", rows=rows)


@router.post("/blind")
async def blind(admin: ActDep, web: WebDep, form: AdminFormDep) -> Response:
    """Hide or show conditions in this session; both are in the audit log."""
    hide = first(form, "blind") == "on"

    def change(connection: Connection) -> None:
        """Change both together: conditions are never shown without a line in the audit log."""
        admins.set_blind(connection, admin.token_hash, hide)
        audit.add(connection, admin.name, "blind mode on" if hide else "blind mode off")

    await asyncio.shield(web.database.write(change))
    return back_to(own_path(first(form, "next")))


@router.get("/audit")
async def audit_page(request: Request, admin: WatchDep, web: WebDep) -> Response:
    """Show the audit log, latest first, and whether it is intact. Conditions are never in it."""
    entries = await web.database.read(audit.entries)
    forged = await web.database.read(audit.first_forged)
    shown = entries[::-1][:AUDIT_SHOWN]
    return AdminPage(request, admin).render("audit.html", tab="audit", entries=shown, total=len(entries), forged=forged)


@router.get("/accounts")
async def accounts(request: Request, admin: OwnDep, web: WebDep) -> Response:
    """Show the accounts."""
    return AdminPage(request, admin).render("accounts.html", tab="accounts", rows=await web.database.read(admins.every))


@router.post("/accounts/{account}/{action}")
async def change_account(account: str, action: str, admin: OwnDep, web: WebDep, form: AdminFormDep) -> Response:  # noqa: ARG001 - checks the form
    """Sign an account out everywhere, or remove it; nobody removes their own."""
    if action not in ("signed_out", "removed") or (action == "removed" and account == admin.name):
        raise HTTPException(
            400, "Unknown action, or you tried to remove your own account. Another owner can remove it."
        )

    def change(connection: Connection) -> bool:
        """False: somebody else has removed the account."""
        if admins.password_hash_of(connection, account) is None:
            return False
        (admins.close_all if action == "signed_out" else admins.remove)(connection, account)
        audit.add(connection, admin.name, f"account {action}", {"name": account})
        return True

    done = await asyncio.shield(web.database.write(change))
    return back_to("/admin/accounts", action if done else "account_gone")


@router.get("/s/{name}")
async def dashboard(request: Request, name: str, admin: WatchDep, services: ServicesDep) -> Response:
    """Show the live overview of one study; live data comes by websocket."""
    web, versions = services.web, services.versions
    study_ids, study = study_at(web, name)
    stops = {
        "paused": name in await web.database.read(interventions.paused_studies),
        "closed": name in await web.database.read(study_openings.closed),
    }
    page = AdminPage(request, admin)
    changed = versions.changed.get(name)
    new = changed if changed is not None and not changed.problem and admin.may("act") else None
    served = None if stops["closed"] else versions.file_of(name)
    context: dict[str, Any] = stops | {"versions": len(study_ids), "new": new, "address": page.study_address(name)}
    context["warnings"] = []
    if served is not None:
        changed_since = await web.database.read(changed_models, name, served.sha256, versions.fingerprint)
        context["warnings"] = [*changed_since, *await asyncio.to_thread(warnings_of, served)]
    return page.render("dashboard.html", tab="live", study=study, **context)


@router.get("/s/{name}/games")
async def games(request: Request, name: str, admin: WatchDep, services: ServicesDep) -> Response:
    """List the latest episodes of a study, each with a link to its replay."""
    web = services.web
    study_ids, study = study_at(web, name)
    played = await web.database.read(overview.latest, study_ids)
    rows = await _games(services, study, played)
    return AdminPage(request, admin).render("games.html", tab="games", study=study, rows=rows)


@router.get("/s/{name}/person/{person}")
async def person_page(request: Request, name: str, person: str, admin: WatchDep, services: ServicesDep) -> Response:
    """Show everything about one participant except personal data."""
    web = services.web
    study_ids, study = study_at(web, name)
    found = await web.database.read(overview.person, person)
    if found is None or found.study_id not in study_ids:
        raise HTTPException(404, "This study has no such participant. Open them from the dashboard.")
    played = await web.database.read(overview.played_by, person)
    sequence = steps_of(web.studies, found)
    return AdminPage(request, admin).render(
        "person.html",
        tab="live",
        study=study,
        person=found,
        label=participants.label(found.number, found.simulated),
        arm="" if admin.blind else found.condition,
        now=step_name(sequence[min(found.position, len(sequence) - 1)]),
        rows=await _games(services, study, played),
        exclusions=await web.database.read(interventions.exclusions_of, [person]),
        reasons=interventions.EXCLUSION_REASONS,
        attention=await web.database.read(answers.attention_of, person),
    )


@router.get("/s/{name}/latency.json")
async def latency_history_of(name: str, admin: WatchDep, services: ServicesDep) -> dict[str, Any]:  # noqa: ARG001 - checks who asks
    """Return the number of people in the study and the lateness of the server over time."""
    study_ids, _ = study_at(services.web, name)
    return {
        "machine": services.latency_history.to_columns(),
        "people": await services.web.database.read(latency_history.people, study_ids),
    }


@router.get("/s/{name}/consort.svg")
async def consort(name: str, admin: WatchDep, web: WebDep) -> Response:
    """Return the flow of participants as a CONSORT diagram."""
    context = await consort_of(web, name, admin.blind)
    svg = web.templates.get_template("admin/consort.svg.j2").render(context)
    headers = {"Cache-Control": "no-store", "Content-Disposition": f'attachment; filename="{name}-consort.svg"'}
    return Response(svg, media_type="image/svg+xml", headers=headers)


async def consort_of(web: Web, name: str, blind: bool) -> dict[str, Any]:
    """Return what the diagram shows: the flow, and how it splits into arms."""
    study_ids, study = study_at(web, name)
    held = await web.database.read(stock, await web.database.read(overview.group_to_show, study_ids))
    arms = arms_of(study, held, arm_names(study, blind, held.conditions), blind)
    flow = flow_of(study, held)
    return {"title": study.title.of("en"), "flow": flow, "arms": arms, "simulated": held.simulated}


@router.get("/s/{name}/quality.json")
async def quality_of(name: str, admin: WatchDep, services: ServicesDep) -> dict[str, Any]:  # noqa: ARG001 - checks who asks
    """Return what the quality rules say about the latest episodes; `waiting`: how many are still to be checked."""
    study_ids, _ = study_at(services.web, name)
    quality = services.dashboard.quality
    waiting = await quality.check_new(study_ids)
    played = [one.id for one in await services.web.database.read(overview.latest, study_ids)]
    found = {episode: proposal for episode in played if (proposal := quality.of(episode))}
    return {"waiting": waiting, "proposals": {each: [one.proposal, one.rules] for each, one in found.items()}}


async def _games(services: Services, study: Study, played: list[Played]) -> list[dict[str, Any]]:
    """Return the rows of a table of games, with what the rules and the researcher say about each."""
    people = list({one.participant_id for one in played})
    held = await services.web.database.read(interventions.exclusions_of, people)
    reasons = {one.episode_id or one.participant_id: one.reason for one in held}
    rows = []
    for one in played:
        details: dict[str, Any] = {"quality": services.dashboard.quality.of(one.id)}
        details |= {"excluded": reasons.get(one.id) or reasons.get(one.participant_id, "")}
        rows.append(_game(study, one) | details)
    return rows


def _game(study: Study, played: Played) -> dict[str, Any]:
    titles = {kitchen.name: kitchen.title.of("en") for kitchen in study.layouts}
    return {
        "id": played.id,
        "who": who(played),
        "person": played.participant_id,
        "kind": played.kind,
        "episode": played.short_name,
        "agent": played.agent,
        "layout": titles.get(played.layout, played.layout),
        "status": played.status,
        "reason": played.end_reason or "",
        "score": played.score,
        "started": played.started_at,
    }
