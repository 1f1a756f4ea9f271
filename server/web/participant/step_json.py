"""A participant's page as JSON, from what its template gets: the same steps, the same fields, the same texts."""

from collections.abc import Callable, Mapping
from typing import Any, Literal, cast, get_args

from starlette.requests import Request

from server.play.step_types import (
    OfferedStudy,
    StepEnd,
    StepField,
    StepForm,
    StepGame,
    StepName,
    StepOption,
    StepPage,
    StepText,
)
from server.study.questionnaire import (
    AnyQuestion,
    ChoiceQuestion,
    MultipleQuestion,
    NumberQuestion,
    RankingQuestion,
    ScaleQuestion,
    TextQuestion,
)
from server.web.csrf import FORM_FIELD

Context = Mapping[str, Any]
_NAMES = frozenset(get_args(StepName))


def wants_json(request: Request) -> bool:
    """Return whether a program makes the request: its `Accept` has JSON and no HTML."""
    accepted = request.headers.get("accept", "")
    return "application/json" in accepted and "text/html" not in accepted


def step_page(template: str, context: Context, form_token: str) -> StepPage:
    """Return the page that a template would show; `form_token`: what every form must bring back."""
    name = template.removeprefix("participant/").removesuffix(".html")
    step, study = context.get("step"), context["study"]
    kind = "quiz" if step is not None and step.kind == "quiz" else name
    made = StepPage(
        page=cast(StepName, kind) if kind in _NAMES else "other",
        language=context["language"],
        template="" if kind in _NAMES else name,
        study=study.name if study is not None else "",
        step=step.key if step is not None else "",
    )
    describe = _PARTS.get(name)
    if describe is not None:
        describe(made, context)
    if made.form is not None:
        made.form.fields.insert(0, StepField(FORM_FIELD, "hidden", form_token))
    return made


def _choose(made: StepPage, context: Context) -> None:
    made.studies = [
        OfferedStudy(study.name, study.title.of(made.language), study.summary.of(made.language), f"/s/{study.name}")
        for study, _ in context["studies"]
    ]


def _consent(made: StepPage, context: Context) -> None:
    consent, language = context["consent"], made.language
    made.title, made.lead = consent.title.of(language), consent.lead.of(language)
    if context["notice"]:
        made.lead = f"{context['t']('consent.' + context['notice'])} {made.lead}"
    made.texts = [StepText(fact.label.of(language), fact.value.of(language)) for fact in consent.facts]
    made.texts += [StepText(one.title.of(language), one.body.of(language)) for one in consent.sections]
    _welcome_back(made, context)
    missing = context["t"]("consent.missing")
    assert made.form is not None  # noqa: S101 made in the line before
    made.form.fields += [
        StepField(
            f"box_{index}", "check", "yes", box.of(language), required=True,
            fault=missing if index in context["open_boxes"] else "",
        )
        for index, box in enumerate(consent.boxes)
    ]  # fmt: skip


def _welcome_back(made: StepPage, context: Context) -> None:
    values = {name: context[name] for name in ("visit", "consent_text", "language")} | dict(context["kept"])
    made.form = StepForm(
        f"{context['path']}/consent", [StepField(name, "hidden", value) for name, value in values.items()]
    )


def _now(made: StepPage, context: Context, **hidden: str) -> None:
    values = {"step": made.step, **hidden}
    made.form = StepForm(f"{context['path']}/now", [StepField(name, "hidden", value) for name, value in values.items()])


def _introduction(made: StepPage, context: Context) -> None:
    words = context["t"]
    made.title = words("phase.introduction")
    made.texts = [StepText(slide.title, slide.text) for slide in context["introduction"].slides]
    _now(made, context)


def _page(made: StepPage, context: Context) -> None:
    section = context["study"].pages[context["step"].page]
    made.title = section.title.of(made.language)
    made.texts = [StepText("", section.body.of(made.language))]
    _now(made, context)


def _break(made: StepPage, context: Context) -> None:
    made.title = context["t"]("break.title")
    made.lead = context["t"]("break.lead", done=context["step"].number, count=context["episodes"])
    _now(made, context)


def _ready(made: StepPage, context: Context) -> None:
    made.title = context["t"]("ready.title", number=context["step"].number, count=context["episodes"])
    expected = "ready.expect_human" if context["with_human"] else "ready.expect"
    made.lead = context["t"](expected, seconds=context["seconds"])
    made.texts = [StepText(context["t"]("ready.kitchen"), context["kitchen"])]
    _now(made, context)


def _questionnaire(made: StepPage, context: Context) -> None:
    questionnaire = context["questionnaire"]
    made.title = questionnaire.title.of(made.language)
    made.lead = questionnaire.lead.of(made.language) if questionnaire.lead else ""
    _now(made, context, **({"attempt": str(context["attempt"])} if "attempt" in context else {}))
    assert made.form is not None  # noqa: S101 made in the line before
    made.form.fields += [_question(one, made.language, context["faults"]) for one in context["questions"]]


def _question(question: AnyQuestion, language: str, faults: Mapping[str, str]) -> StepField:
    field = StepField(
        question.key,
        question.type,
        label=question.text.of(language),
        hint=question.hint.of(language) if question.hint else "",
        required=question.required,
        fault=faults.get(question.key, ""),
    )
    match question:
        case ScaleQuestion():
            field.low, field.high, field.step = question.values[0], question.values[-1], question.step
            field.labels = [each.of(language) for each in question.labels or (question.low, question.high)]
        case NumberQuestion():
            field.low, field.high, field.whole = question.minimum, question.maximum, question.whole
        case TextQuestion():
            field.most = question.max_length
        case MultipleQuestion():
            field.low, field.high = question.at_least, question.at_most or len(question.options)
    if isinstance(question, ChoiceQuestion | MultipleQuestion | RankingQuestion):
        field.options = [StepOption(one.value, one.text.of(language)) for one in question.options]
    return field


def _game(made: StepPage, context: Context) -> None:
    game = context["game"]
    root = context["path"].removesuffix(f"/s/{made.study}")
    kind: Literal["tutorial", "episode"] = context["step"].kind if "step" in context else "episode"
    made.game = StepGame(root + game["socket"], kind, list(game["lessons"]))
    if game.get("skip"):
        _now(made, context)


def _thanks(made: StepPage, context: Context) -> None:
    made.title = context["t"]("thanks.title")
    made.end = StepEnd("completed", context["code"], context["own_code"], *_back(context))


def _ended(made: StepPage, context: Context) -> None:
    made.title = context["t"](f"ended.{context['kind']}_title")
    made.lead = context["t"](f"ended.{context['kind']}")
    made.end = StepEnd(context["kind"], context["outcome"].code or "", "", *_back(context))


def _back(context: Context) -> tuple[str, dict[str, str]]:
    back = context.get("back")
    return ("", {}) if back is None else (back.url, dict(back.fields or {}))


_PARTS: Mapping[str, Callable[[StepPage, Context], None]] = {
    "choose": _choose,
    "consent": _consent,
    "welcome_back": _welcome_back,
    "introduction": _introduction,
    "page": _page,
    "break": _break,
    "ready": _ready,
    "questionnaire": _questionnaire,
    "game": _game,
    "thanks": _thanks,
    "ended": _ended,
}
