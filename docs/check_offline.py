"""Make sure that a built site needs no network to be read: ``python docs/check_offline.py docs/_build/html``."""

import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

# What a browser loads by itself; links that a reader may follow are none of it.
LOADED = {
    "script": "src", "img": "src", "iframe": "src", "source": "src", "video": "src", "audio": "src", "embed": "src",
    "object": "data", "link": "href",
}  # fmt: skip
# `link` is loaded for these alone.
RELATIONS = {"stylesheet", "icon", "preload", "modulepreload", "manifest", "shortcut", "prefetch", "preconnect"}
REMOTE = re.compile(r"\s*(https?:)?//", re.I)
IN_CSS = re.compile(r"""(?:url\(\s*|@import\s+)["']?(?P<where>(?:https?:)?//[^"')\s]+)""", re.I)


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        where = values.get(LOADED.get(tag, ""), "")
        loaded = tag != "link" or RELATIONS & set(values.get("rel", "").lower().split())
        if loaded and REMOTE.match(where):
            self.found.append(where)
        self.found += IN_CSS.findall(values.get("style", ""))


def remote_resources(folder: Path) -> Iterator[tuple[Path, str]]:
    """Every page or style sheet of a site with what it loads from elsewhere.

    Args:
        folder: The built site.
    """
    for path in sorted(folder.rglob("*.html")):
        page = _Page()
        text = path.read_text()
        page.feed(text)
        for style in re.findall(r"<style.*?</style>", text, re.S):
            page.found += IN_CSS.findall(style)
        yield from ((path, where) for where in page.found)
    for path in sorted(folder.rglob("*.css")):
        yield from ((path, where) for where in IN_CSS.findall(path.read_text()))


def main() -> int:
    """Name what is loaded from elsewhere; the exit status is 1 where there is any."""
    folder = Path(sys.argv[1])
    pages = len(list(folder.rglob("*.html")))
    found = list(remote_resources(folder))
    for path, where in found:
        sys.stderr.write(f"{path.relative_to(folder)} loads {where}\n")
    if not pages:
        sys.stderr.write(f"no page in {folder}\n")
    sys.stdout.write(f"{pages} pages, {len(found)} things from elsewhere\n")
    return int(bool(found) or not pages)


if __name__ == "__main__":
    raise SystemExit(main())
