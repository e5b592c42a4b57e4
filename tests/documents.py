"""What the documents show, for the tests that run it and for the type checker.

python tests/documents.py FOLDER   writes the blocks of each document as one module, FOLDER/README.py and so on.
"""

import re
import shlex
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LANGUAGES = {"python", "sh", "text", "toml"}  # text is not run: formulas, output, formats of files
PROGRAMS = ("baryscope", "pythonfmu")
FRONT = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md"]
PAGES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))


def text_of(document):
    return (ROOT / document).read_text(encoding="utf-8")


def python_blocks(document):
    """The blocks of a document, in their order."""
    return [block for block, _ in blocks_with_output(document)]


def blocks_with_output(document):
    """Each block and what the document says that it prints: the text block right below it, or nothing."""
    return re.findall(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", text_of(document), re.DOTALL)


def fences(document):
    """Language and text of each fenced block, in their order; and the rest of the document."""
    fence = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
    return fence.findall(text_of(document)), fence.sub("", text_of(document))


def commands(document):
    """The calls of baryscope and pythonfmu in its shell blocks, in their order, without their comments."""
    lines = [line for language, block in fences(document)[0] if language == "sh" for line in block.splitlines()]
    return [words for line in lines if (words := shlex.split(line, comments=True)) and words[0] in PROGRAMS]


WITH_PYTHON = [document for document in [*FRONT, *PAGES] if python_blocks(document)]
WITH_COMMANDS = [document for document in [*FRONT, *PAGES] if commands(document)]


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for document in WITH_PYTHON:
        (folder / f"{Path(document).stem}.py").write_text("\n".join(python_blocks(document)), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
