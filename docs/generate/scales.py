"""The page of the published scales that a study can use by name, from their files."""

from collections.abc import Iterator
from typing import Any, Final

from server.study.markdown_table import cell
from server.study.published_scales import SCALE_NAMES, published_scale

HEAD: Final = """# Published scales

Validated questionnaires that a study uses by name. Name one where its items shall stand:

```yaml
questionnaires:
  workload:
    title: {en: "How demanding was this round?", zh: 这一局有多费力？}
    questions:
      - {type: published, scale: nasa_tlx_raw}
      - {type: published, scale: trust_in_automation, subscales: [trust, reliability_competence]}
after_episode: workload
```

Participants get the items with their response scale, in the original order, in English or Chinese. `subscales` asks
only some, `conditions` only some participants, `required: false` lets people leave items open. In the study builder,
choose the type `published` below the questions of a questionnaire, then the scale. A study in another language writes
the items out as questions of its own.

The words of a scale often say "the system" or "the task". Say in the questionnaire's `lead` what is meant.

## Scores

Each answer is stored under the key of its item, as it was given: reversed items are not turned round in the data.
`kitchenmind report` turns them round, and writes

- `scores.csv`: the score of every subscale on every page. It is the mean of the answered items; half of them must be
  answered. `items` is the number of items of the subscale, `answered` how many a person answered.
- *Published scales*, in section 3 of the report, and the section `scale` of `results.csv`: means over people by
  condition, t-tests between conditions, and the reliability: Cronbach's alpha, or the Spearman-Brown coefficient of two
  items.

Items of a published scale are not compared one by one.

"""
LEFT_OUT: Final = """## Left out

Only scales whose licence allows it are here. For these we found no licence that does; ask their authors, then write the
items as questions of your study.

| scale | why |
|---|---|
| Trust between people and automation (Jian, Bisantz & Drury, 2000) | journal article; no licence found |
| Trust scale for explainable AI (Hoffman et al., 2023) | items adapted from scales of others; licence not confirmed |
| Affinity for Technology Interaction (Franke, Attig & Wessel, 2019) | no licence to pass it on found at ati-scale.org |
| System Usability Scale (Brooke, 1996) | used freely, but no written licence found |
| User Experience Questionnaire, short version (UEQ-S) | no licence to pass it on found |
"""


def scales() -> str:
    """Return the page."""
    pages = (line for name in SCALE_NAMES for line in _scale(name, published_scale(name)))
    return HEAD + "".join(pages) + LEFT_OUT


def _scale(name: str, scale: dict[str, Any]) -> Iterator[str]:
    yield f"## {scale['title']}\n\n`{name}`: {scale['measures']}.\n\n"
    last = scale["first"] + scale["step"] * (scale["points"] - 1)
    steps = f" in steps of {scale['step']}" if scale["step"] > 1 else ""
    rows = {
        "Source": cell(scale["source"]),
        "Where": f"<{scale['url']}>",
        "Licence": scale["licence"],
        "Answers": f"{scale['first']} ({scale['low']['en']}) to {last} ({scale['high']['en']}){steps}",
        **{f"Words in `{language}`": words for language, words in scale["translations"].items()},
    }
    yield "| | |\n|---|---|\n" + "".join(f"| {key} | {value} |\n" for key, value in rows.items()) + "\n"
    yield "".join(f"- {note}\n" for note in scale["notes"]) + "\n"
    yield "| key | item | subscale | reversed |\n|---|---|---|---|\n"
    for item in scale["items"]:
        turned = "yes" if item.get("reverse") else ""
        yield f"| `{item['key']}` | {cell(item['text']['en'])} | `{item['subscale']}` | {turned} |\n"
    yield "\n"
