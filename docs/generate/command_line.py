"""The page of every command and its options, from the argument parsers."""

import argparse
import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import kitchenmind
from kitchenmind.argument_parser import ExactArgumentParser
from server.study.markdown_table import cell, code

ROOT: Final = Path(__file__).resolve().parents[2]


def command_line() -> str:
    """Return the page of every command of `kitchenmind` with its options."""
    lines = [HEAD]
    lines += [f"| [`{verb}`](#kitchenmind-{verb}) | {cell(purpose)} |\n" for verb, (_, purpose) in _verbs()]
    for verb, (module, purpose) in _verbs():
        parser = ExactArgumentParser()
        importlib.import_module(module).add_arguments(parser)
        lines.append(f"\n## kitchenmind {verb}\n\n{purpose[:1].upper()}{purpose[1:]}.\n")
        lines += _command(f"kitchenmind {verb}", parser)
    return "".join(lines)


HEAD: Final = """# Command line

Every command of `kitchenmind`. `kitchenmind COMMAND --help` says the same,
`kitchenmind --version` shows the version. The exit status is 0 if all went well, 1 if something failed, 2 for wrong
input, and 130 after Ctrl+C. Write options in full.

For a server that runs with `kitchenmind serve --data DIR`, give other commands the same `--data DIR`: they use the same
database, kitchens and trained models. `--database URL` names only a database; with both, the database is at URL.
Without either, it uses what the [settings](settings.md) say, as `kitchenmind serve` does.

`python -m docs.generate` writes this page from the code.

| command | purpose |
|---|---|
"""


def _verbs() -> list[tuple[str, tuple[str, str]]]:
    return list(kitchenmind.VERBS.items())


def _command(words: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the table of a command's arguments, then those of its own commands."""
    shown = [action for action in parser._actions if action.help != argparse.SUPPRESS and action.dest != "help"]
    inner = next((action for action in shown if isinstance(action, argparse._SubParsersAction)), None)
    plain = [action for action in shown if action is not inner]
    if inner is None:
        positional = " ".join(_shown_name(action) for action in plain if not action.option_strings)
        yield f"\n`{' '.join(filter(None, [words, positional]))}`\n"
    if plain:
        yield "\n| argument | default | meaning |\n|---|---|---|\n"
        yield from (f"| {_argument(action)} | {_default(action)} | {_meaning(action)} |\n" for action in plain)
    if inner is not None:
        helps = {choice.dest: choice.help or "" for choice in inner._choices_actions}
        for name, choice in inner.choices.items():
            yield f"\n### {words} {name}\n\n{helps[name][:1].upper()}{helps[name][1:]}.\n"
            yield from _command(f"{words} {name}", choice)


def _shown_name(action: argparse.Action) -> str:
    name = action.metavar or action.dest.upper()
    return name if isinstance(name, str) else " ".join(name)


def _argument(action: argparse.Action) -> str:
    if not action.option_strings:
        return code(_shown_name(action))
    value = "" if action.nargs == 0 else f" {_shown_name(action)}"
    value = f" {'|'.join(map(str, action.choices))}" if action.choices else value
    return code(f"{action.option_strings[-1]}{value}")


def _default(action: argparse.Action) -> str:
    if action.required:
        return "required"
    default = action.default
    if isinstance(default, Path) and default.is_absolute():
        default = default.relative_to(ROOT)
    is_plain = isinstance(default, str | int | float | Path) and not isinstance(default, bool)
    return code(f"{default}") if is_plain and default != argparse.SUPPRESS else ""


def _meaning(action: argparse.Action) -> str:
    """Return the help without the default that has a column of its own."""
    return cell(re.sub(r" \((default: )?" + re.escape(f"{action.default}") + r"\)$", "", action.help or ""))
