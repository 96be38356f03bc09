"""Whether a fix is about to follow at the stamp of other samples: of an instant it is the last."""

from __future__ import annotations

from typing import NamedTuple

_UNEVEN_NS = 5_000_000
"""Stamps of even fixes are rounded, or a little off. Chosen."""


class FixRhythm(NamedTuple):
    """When fixes came, and the latest two instants of samples beside them.

    `beside` where the latest fix was at such an instant, `each` where the one before was at the
    instant before.
    """

    newest_ns: int | None = None
    before_ns: int | None = None
    fix_ns: int | None = None
    step_ns: int = 0
    beside: bool = False
    each: bool = False

    def after(self, channel: str, stamp_ns: int) -> FixRhythm:
        """Return the rhythm with one sample more; what comes again changes none."""
        known = (self.fix_ns,) if channel == "gnss" else (self.newest_ns, self.before_ns)
        if stamp_ns in known:
            return self
        if channel == "gnss":
            step_ns = 0 if self.fix_ns is None else stamp_ns - self.fix_ns
            beside = stamp_ns == self.newest_ns
            each = self.before_ns is not None and self.before_ns == self.fix_ns
            return self._replace(fix_ns=stamp_ns, step_ns=step_ns, beside=beside, each=each)
        return self._replace(newest_ns=stamp_ns, before_ns=self.newest_ns)

    @property
    def due(self) -> bool:
        """Whether the newest instant is the one of the next fix, which sums it up."""
        if not self.beside or self.fix_ns is None or self.newest_ns is None:
            return False
        if self.each and self.before_ns == self.fix_ns:
            return True
        return abs(self.newest_ns - self.fix_ns - self.step_ns) < _UNEVEN_NS
