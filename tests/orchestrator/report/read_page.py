"""What a browser would find in a report."""

from __future__ import annotations

from html.parser import HTMLParser

MOST_BYTES = 3_000_000


class ReadPage(HTMLParser):
    """What a browser would look for in a page: anchors, links to them, and what it would load."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.codes: list[str] = []
        self.nameless = html.count('<button type="button"></button>')
        """Buttons of which nobody who hears the page learns what they do."""
        self._in_code = False
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = {name: value or "" for name, value in attrs}
        self._in_code = tag == "code"
        if "id" in said:
            self.anchors.add(said["id"])
        if tag == "a":
            self.links.append(said["href"])
        elif tag in ("link", "iframe", "object", "embed", "base"):
            self.loaded.append(tag)
        self.loaded += [
            f"{tag} {name}" for name in ("src", "srcset", "data", "xlink:href") if name in said
        ]

    def handle_endtag(self, tag: str) -> None:
        self._in_code = self._in_code and tag != "code"

    def handle_data(self, data: str) -> None:
        if self._in_code:
            self.codes.append(data)
