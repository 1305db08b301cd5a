"""Reading a report back: its tables, its figures and everything that it would load."""

from __future__ import annotations

from html.parser import HTMLParser


class Page(HTMLParser):
    """``tables`` as rows of texts by heading, ``figures`` with their texts, ``loaded``: the addresses that are used."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self.figures: list[dict[str, str]] = []
        self.loaded: list[str] = []
        self.scripts = 0
        self._inside: list[str] = []
        self._rows: list[list[str]] = []
        self._caption = ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        about = dict(attributes)
        self.loaded += [about[name] for name in ("src", "href") if name in about]
        if tag == "script":
            self.scripts += 1
        if tag == "summary":
            self._caption = ""
        if tag == "table":
            self._rows = []
        elif tag == "tr":
            self._rows.append([])
        elif tag in ("td", "th"):
            self._rows[-1].append("")
        elif tag == "figure":
            self.figures.append({"figure": about["data-figure"], "text": "", "command": "", "alt": ""})
        elif tag == "img":
            self.figures[-1]["alt"] = about["alt"]
        if tag == "br" and "td" in self._inside:
            self._rows[-1][-1] += "\n"
        if tag not in ("meta", "link", "img", "br"):
            self._inside.append(tag)

    def handle_endtag(self, tag):
        assert self._inside.pop() == tag, f"</{tag}> closes nothing"
        if tag == "table":
            self.tables.setdefault(self._caption, []).extend(self._rows)

    def handle_data(self, data):
        if "summary" in self._inside:
            self._caption += data
        elif {"td", "th"} & set(self._inside):
            self._rows[-1][-1] += data
        if "figure" in self._inside and "script" not in self._inside:
            self.figures[-1]["command" if "code" in self._inside else "text"] += data
