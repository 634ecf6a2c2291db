"""The captions of the report as a page beside the pictures, from the same files."""

import re
from collections.abc import Iterable
from pathlib import Path


def captions_page(entries: Iterable[dict]) -> str:
    """Markdown: each figure or table by its `title`, with its `file` and the words of its `caption`, a
    file in reStructuredText, of which captions use paragraphs, bold words and literals only. What is
    beyond the paper comes last."""
    parts = ["# Figures and tables, and what they show\n"]
    for entry in sorted(entries, key=lambda e: (e["file"].startswith("more"), e["file"])):
        name, title = entry["file"], entry["title"]
        picture = Path(name).suffix == ".png"
        link = f"`{name}`\n\n![{title}]({name})" if picture else f"[{name}]({name})"
        words = re.sub(r"``(.+?)``", r"`\1`", Path(entry["caption"]).read_text().strip())
        parts.append(f"## {title}\n\n{link}\n\n{words}\n")
    return "\n".join(parts)
