"""The description of an export: README, codebook.json, study files, metadata for Psych-DS and Croissant."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from server.export import codebook
from server.export.codebook_columns import Column
from server.export.files import table_path
from server.export.import_checks import SUMS, plain_name, write_sums
from server.store.studies import StudyVersion

Columns = Mapping[str, tuple[Column, ...]]
_CROISSANT_TYPES = {"integer": "sc:Integer", "number": "sc:Float", "boolean": "sc:Boolean", "time": "sc:Date"}
_MEDIA_TYPES = {".csv": "text/csv", ".parquet": "application/x-parquet"}


def write_about(folder: Path, versions: Sequence[StudyVersion], columns: Columns, formats: Sequence[str]) -> None:
    """Write everything that is not a table. Call it last: it names the files with their hashes."""
    (folder / "studies").mkdir()
    for study in versions:
        (folder / study_file(study.key, study.version)).write_bytes(study.source.encode())
    _write_json(folder / "codebook.json", codebook_of(columns))
    (folder / "README.md").write_text(readme(versions, columns, formats), encoding="utf-8")
    _write_json(folder / "dataset_description.json", psych_ds(versions, columns))
    _write_json(
        folder / "croissant.json", croissant(folder, versions, columns, "csv" if "csv" in formats else "parquet")
    )
    write_sums(folder)


def study_file(key: str, version: int) -> str:
    """Return the path of a version of a study file in an export. Raises ImportRefused for a key that is not plain."""
    return f"studies/{plain_name(key, 'the study')}_version-{version}.yaml"


def codebook_of(columns: Columns) -> dict[str, Any]:
    """Return every table and column that was written: type, unit, meaning."""
    tables = {
        table.name: {"row": table.row, "columns": {column.name: column.described() for column in columns[table.name]}}
        for table in codebook.TABLES
    }
    return {"texts_in_csv": codebook.ESCAPED, "tables": tables}


def psych_ds(versions: Sequence[StudyVersion], columns: Columns) -> dict[str, Any]:
    """Return `dataset_description.json` of Psych-DS: schema.org's Dataset with every variable."""
    variables: dict[str, Column] = {column.name: column for table in columns.values() for column in table}
    return {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": _name(versions),
        "description": _description(versions),
        "schemaVersion": "Psych-DS 0.4.0",
        "dateCreated": datetime.now(UTC).isoformat(timespec="seconds"),
        "creator": {
            "@type": "SoftwareApplication",
            "name": "kitchenmind",
            "softwareVersion": metadata.version("kitchenmind"),
        },
        "studies": [
            {
                "key": study.key,
                "version": study.version,
                "sha256": study.sha256,
                "file": study_file(study.key, study.version),
            }
            for study in versions
        ],
        "variableMeasured": [
            {"@type": "PropertyValue", "name": column.name, "description": column.meaning}
            | ({"unitText": column.unit} if column.unit else {})
            for column in variables.values()
        ],
    }


def croissant(folder: Path, versions: Sequence[StudyVersion], columns: Columns, file_format: str) -> dict[str, Any]:
    """Return `croissant.json` (Croissant 1.0): every file with its hash, every column with its type."""
    files, records = [], []
    for name, table in columns.items():
        path = table_path(folder, file_format, name)
        place = path.relative_to(folder).as_posix()
        files.append(
            {
                "@type": "cr:FileObject",
                "@id": place,
                "name": place,
                "contentUrl": place,
                "encodingFormat": _MEDIA_TYPES[path.suffix],
                "sha256": _sha256(path),
            }
        )
        fields = [_croissant_field(name, place, column) for column in table]
        records.append({"@type": "cr:RecordSet", "@id": name, "name": name, "field": fields})
    return {
        "@context": _CROISSANT_CONTEXT,
        "@type": "sc:Dataset",
        "name": _name(versions),
        "description": _description(versions),
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "datePublished": datetime.now(UTC).date().isoformat(),
        "version": "1.0.0",
        "distribution": files,
        "recordSet": records,
    }


def _croissant_field(table: str, place: str, column: Column) -> dict[str, Any]:
    return {
        "@type": "cr:Field",
        "@id": f"{table}/{column.name}",
        "name": column.name,
        "description": column.meaning,
        "dataType": _CROISSANT_TYPES.get(column.type, "sc:Text"),
        "source": {"fileObject": {"@id": place}, "extract": {"column": column.name}},
    }


_CROISSANT_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}


def readme(versions: Sequence[StudyVersion], columns: Columns, formats: Sequence[str]) -> str:
    """Return README.md for a reader who knows neither this software nor the study."""
    files = {
        "csv": "`data/description-TABLE_data.csv` (CSV, UTF-8)",
        "parquet": "`parquet/TABLE.parquet` (exact types)",
    }
    rows = "\n".join(f"| {table.name} | {table.row} | {len(columns[table.name])} |" for table in codebook.TABLES)
    texts = (
        "\n".join(f"- `{study_file(study.key, study.version)}` (SHA-256 {study.sha256})" for study in versions)
        or "- none"
    )
    return _README.format(
        name=_name(versions),
        description=_description(versions),
        files=" and ".join(files[name] for name in formats if name in files),
        trajectories=_TRAJECTORIES if "overcooked_ai" in formats else "",
        rows=rows,
        studies=texts,
        escaped=codebook.ESCAPED,
        sums=SUMS,
        version=metadata.version("kitchenmind"),
    )


_TRAJECTORIES = """- `trajectories/EPISODE.json`: each episode in overcooked_ai's own trajectory format, for its tools.
"""
_README = """# {name}

{description}

Each table is {files}:

| table | one row is | columns |
|---|---|---|
{rows}

- `codebook.json`: every column with type, unit and meaning. `dataset_description.json`: the same for Psych-DS tools.
  `croissant.json`: for Croissant tools. `{sums}`: the hash of every file (`sha256sum --check {sums}`).
- Tables are joined by `participant` and `episode`. Times are UTC, durations in milliseconds. An empty cell: not known,
  or there is none.
- Actions: 0 north, 1 south, 2 east, 3 west, 4 stay, 5 interact. `action_0` is the chef on seat 0, whose start cell the
  layout marks with 1; `action_1` is the other. `episodes` says which seat is the person's and which the agent's.
- In `ticks`, the row of timestep t has the state before (`state_hash`), what was predicted and displayed then for the
  timesteps t, t+1 and t+2, and what was done in t. So `predicted_1` is right where it equals `action_S` of the same
  row, S being the episode's `watched_seat`; `predicted_2` is about the next row, `predicted_3` about the one after.
- `inputs` has every key message that arrived in an episode, with the timestep in which it counted or the reason why it
  did not (`outcome`). `ticks` names only the one that decided the action (`key_seq_S`).
- What was predicted is recorded in every condition, also where nothing was shown (`episodes.shown`).
- Participants with `simulated` true are bots: so are their episodes and answers. They are built so that foresight can
  help. They are not evidence about people: never pool the two.
- An episode's states are not stored: `kitchenmind verify` simulates them from `spec` and the actions, and compares the
  hashes.
{trajectories}- {escaped}

The study files, word for word:

{studies}

The data are pseudonymous: ids are random, and recruiters' ids are not in here. Texts that people wrote themselves, and
the fact that somebody took part at a certain time, can still point to a person: handle them accordingly. People who
withdrew are not in the data; `studies.withdrawn` and `withdrawals` count them. `withdrawn.json` has salted hashes of
their random ids: `kitchenmind import` leaves these people out of an older export, and so should you.

Written by kitchenmind {version}.
"""


def _name(versions: Sequence[StudyVersion]) -> str:
    names = sorted({study.key for study in versions})
    return f"Cooking with a predicted partner: {', '.join(names) or 'no study'}"


def _description(versions: Sequence[StudyVersion]) -> str:
    consented = sum(study.started for study in versions)
    bots = sum(study.simulated_started for study in versions)
    whereof = f" ({bots} of them simulated)" if bots else ""
    return (
        "People cook together with an AI agent in Overcooked while a Theory-of-Mind predictor watches the agent and "
        f"shows, in some conditions, what it will do next. {consented} participants consented{whereof}."
    )


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
