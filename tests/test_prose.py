# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages, docstrings, comments, names and documents use the words of docs/glossary.md."""

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "fieldtruth"
FOLDERS = sorted(p for p in [*SOURCE.iterdir(), *(ROOT / "tests").iterdir()] if p.is_dir() and any(p.rglob("*.py")))
LOOSE = [ROOT / "benchmarks", ROOT / "examples", *SOURCE.glob("*.py"), *(ROOT / "tests").glob("*.py")]
TEMPLATES = [*SOURCE.rglob("*.jinja"), *SOURCE.rglob("*.js"), *SOURCE.rglob("*.md")]
DOCUMENTS = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *TEMPLATES]

# Each banned pattern with what to write instead; matched without regard to case.
PROSE = {
    r"\bway-points?\b": "waypoint",
    r"\b(?:whoever|nobody|somebody)\b": "name the subject",
    r"\bthe rather\b": "the more",
    r"\bthere is no \w+; needed\b|\bneeded is\b|\ballowed is\b": "'KEY must be ..., got ...'",
    r"\b(?:is|are) none\b|\bis no (?:number|file|bag|folder|name|text)\b": "'is not a ...'",
    r"\bas it stands\b|\bhow it stands\b": "as is",
    r"\bfelt\b": "measured",
    r"\bobject ids?\b": "instance id",
    r"\bwitness(?:es)?\b|\bpardon(?:ed|s)?\b|\brefut(?:e|es|ed)\b": "reference, tolerated, mismatch",
    r"\bdarkroom\b|\bstudio\b": "tonemapping, shading",
}


ANY = re.compile("|".join(PROSE), re.IGNORECASE)
PROSE_TOKENS = {tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}


def findings(path: Path) -> Iterator[str]:
    """Banned words in one file, as ``file:line: word (write ...)``."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        pieces = list(enumerate(text.splitlines(), 1))
    else:
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        pieces = [
            (t.start[0] + i, line)
            for t in tokens
            if t.type in PROSE_TOKENS
            for i, line in enumerate(t.string.splitlines())
        ]
    for number, line in pieces:
        if not ANY.search(line):
            continue
        for pattern, better in PROSE.items():
            for match in re.finditer(pattern, line, re.IGNORECASE):
                yield f"{path.relative_to(ROOT)}:{number}: {match[0]!r} (write: {better})"


def files_of(path: Path) -> list[Path]:
    """Python files of a folder, or the file itself."""
    return sorted(path.rglob("*.py")) if path.is_dir() else [path]


def test_prose_uses_the_words_of_the_glossary() -> None:
    every = [file for path in (*FOLDERS, *LOOSE, *DOCUMENTS) for file in files_of(path)]
    ours = [p for p in every if p.resolve() != Path(__file__).resolve() and p.name != "glossary.md"]
    found = [line for p in ours for line in findings(p)]
    assert not found, f"{len(found)} words that docs/glossary.md replaces:\n" + "\n".join(found)
