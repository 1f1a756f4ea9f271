"""Format names and numbers for a report: APA style, with real minus signs."""

import math

from analysis.tables import PERSON

LAYOUT_TITLES = {"all": "All layouts"}
CONDITION_TITLES = {"none": "None", "random": "Random", "tom": "ToM", "all": "All"}
CONDITION_PHRASES = {"none": "no prediction", "random": "random predictions", "tom": "ToM predictions"}
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def layout_title(layout: str) -> str:
    """Return a layout's title: coordination_ring -> Coordination Ring."""
    return LAYOUT_TITLES.get(layout, layout.replace("_", " ").title())


def agent_title(agent: str) -> str:
    """Return an agent's title: sp -> SP; the names of other agents keep their spelling."""
    if agent == "all":
        return "Both"
    return agent.upper() if agent in ("sp", "fcp") else agent


def partner_phrase(agent: str) -> str:
    """Return the words for a partner in a sentence: sp -> the SP agent; person -> the other person."""
    return "the other person" if agent == PERSON else f"the {agent_title(agent)} agent"


def partner_title(agent: str) -> str:
    """Return a partner's title: sp -> SP agent; person -> Another person."""
    return "Another person" if agent == PERSON else f"{agent_title(agent)} agent"


def condition_title(condition: str) -> str:
    """Return a condition's title: tom -> ToM."""
    return CONDITION_TITLES.get(condition, condition.replace("_", " ").capitalize())


def condition_phrase(condition: str) -> str:
    """Return the words after "with" in a sentence: tom -> ToM predictions."""
    return CONDITION_PHRASES.get(condition, condition_title(condition))


def contrast_title(contrast: str) -> str:
    """Return a contrast's title: "tom - none" -> "ToM – None"."""
    return " – ".join(condition_title(name) for name in contrast.split(" - "))


def number(value: float, decimals: int = 2) -> str:
    """Format a number: 3.14159 -> 3.14, with a real minus; a dash for what could not be computed."""
    if math.isnan(value):
        return "–"
    text = f"{value:.{decimals}f}"
    return "0" + text[2:] if float(text) == 0 and text.startswith("-") else text.replace("-", "−")


def signed(value: float, decimals: int = 1) -> str:
    """Return a difference, always with its sign."""
    text = number(value, decimals)
    return text if text[0] in "−–" or float(text) == 0 else f"+{text}"


def degrees(value: float) -> str:
    """Format degrees of freedom: whole where they are, else one decimal (Welch)."""
    return "–" if math.isnan(value) else f"{value:.0f}" if value == round(value) else f"{value:.1f}"


def p_value(p: float) -> str:
    """Format p for tables: .004, < .001, > .999."""
    if math.isnan(p):
        return "–"
    if p < 0.001:
        return "< .001"
    return "> .999" if p > 0.999 else f"{p:.3f}".removeprefix("0")


def p_equals(p: float) -> str:
    """Format p for sentences: = .004, < .001."""
    text = p_value(p)
    return text if text[0] in "<>" else f"= {text}"


def stars(p: float) -> str:
    """Return the stars of p: * below .05, ** below .01, else nothing."""
    return "**" if p < 0.01 else "*" if p < 0.05 else ""


def word(count: int) -> str:
    """Write small numbers as words, as APA requires in sentences."""
    return NUMBERS[count] if 0 <= count < len(NUMBERS) else str(count)


def listed(parts: list[str]) -> str:
    """Join words: a; a and b; a, b and c."""
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1] if parts else ""
