"""Two sides' digests compared: key by key, and within a key quantity by quantity."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

Digests = Mapping[str, Mapping[str, str]]
"""By key (a job, a file, a column) the digest of each of its quantities."""

SHOWN = 5


class Section(NamedTuple):
    """What one row of the table compares."""

    title: str
    base: Digests
    head: Digests
    common_only: bool = False
    """Whether keys that one side alone has are no difference."""
    about: Mapping[str, str] = {}
    """By key, what its name does not tell."""


class Compared(NamedTuple):
    """What became of a section; keys in the order of the base."""

    section: Section
    equal: tuple[str, ...]
    different: dict[str, tuple[str, ...]]
    """By key the quantities that differ; `NAME (gone)` where the working tree has none."""
    base_only: tuple[str, ...]
    head_only: tuple[str, ...]
    added: Counter[str]
    """Quantities that the head alone has, each with the number of its keys: not compared."""

    @property
    def same(self) -> bool:
        """Whether there was something to compare, and all of it is equal."""
        alone = (*self.base_only, *self.head_only)
        return bool(self.equal) and not self.different and (self.section.common_only or not alone)


def compare(section: Section) -> Compared:
    """Return what is equal and what is not; what the base has, the head must have too."""
    equal, different = [], {}
    added: Counter[str] = Counter()
    for key, base in section.base.items():
        head = section.head.get(key)
        if head is None:
            continue
        added.update(head.keys() - base.keys())
        wrong = [name for name in base if name in head and base[name] != head[name]]
        wrong += [f"{name} (gone)" for name in base if name not in head]
        if wrong:
            different[key] = tuple(wrong)
        else:
            equal.append(key)
    return Compared(
        section,
        equal=tuple(equal),
        different=different,
        base_only=tuple(key for key in section.base if key not in section.head),
        head_only=tuple(key for key in section.head if key not in section.base),
        added=added,
    )


def table(results: Iterable[Compared]) -> str:
    """Return the table, and below it the first keys of what is not the same."""
    results = tuple(results)
    wide = max((len(one.section.title) for one in results), default=4)
    titles = ("compared", "equal", "different", "base only", "head only")
    lines = [" ".join((f"{'part':{wide}}", *(f"{title:>9}" for title in titles)))]
    for one in results:
        counts = (len(one.equal) + len(one.different), len(one.equal), len(one.different),
                  len(one.base_only), len(one.head_only))  # fmt: skip
        lines.append(
            " ".join((f"{one.section.title:{wide}}", *(f"{count:9d}" for count in counts)))
        )
    for one in results:
        lines += _told(one)
    return "\n".join(lines)


def _told(one: Compared) -> list[str]:
    title = one.section.title
    lines = [f"{title}: different: {key}: {_some(names)}"
             for key, names in list(one.different.items())[:SHOWN]]  # fmt: skip
    for whose, keys in (("base", one.base_only), ("head", one.head_only)):
        lines += [
            f"{title}: {whose} only: {key} {one.section.about.get(key, '')}".rstrip()
            for key in keys[:SHOWN]
        ]
    if one.added:
        found = [f"{name} ({count})" for name, count in sorted(one.added.items())]
        lines.append(f"{title}: not compared, head only: {_some(found)}")
    if not one.equal and not one.different:
        lines.append(f"{title}: nothing was compared")
    return lines


def _some(names: Iterable[str]) -> str:
    names = tuple(names)
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
