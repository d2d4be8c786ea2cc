"""Hook of mkdocs: adds pages outside docs/ to the site, at their paths in the repository.

Links between them and the pages in docs/ lead to the same pages as in the checkout.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import (  # type: ignore[import-not-found,unused-ignore]
    File,
    Files,
)

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE = (
    "CONTRIBUTING.md",
    "assets/mjcf/kengoro_arm/README.md",
    "experiments/README.md",
    "experiments/figures/*.png",
)
"""Patterns of the added files, relative to the root of the repository."""


def on_files(files: Files, config: Any) -> Files:
    """Add the files of `OUTSIDE`; mkdocs calls it."""
    for pattern in OUTSIDE:
        for path in sorted(ROOT.glob(pattern)):
            uri = path.relative_to(ROOT).as_posix()
            files.append(File.generated(config, uri, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Adapt links between docs/ and the added pages to the site; mkdocs calls it."""
    if page.file.generated_by is not None:
        return re.sub(r"\]\(docs/", "](", markdown)
    return re.sub(r"\]\(\.\./", "](", markdown) if "/" not in page.file.src_uri else markdown
