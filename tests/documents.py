"""The Python that the documents show, for the tests that run it and for the type checker.

python tests/documents.py FOLDER   writes the blocks of each document as one module, FOLDER/README.py and so on.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCUMENTS = ["README.md", "docs/unit.md"]


def python_blocks(document):
    """The blocks of a document, in their order."""
    text = (ROOT / document).read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for document in DOCUMENTS:
        (folder / f"{Path(document).stem}.py").write_text("\n".join(python_blocks(document)), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
