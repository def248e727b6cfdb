"""Keys as a terminal sends them: bytes in, names out.

Letters are their own names; others are space, enter, escape, backspace, left, right, up, down, home, end. Sequences are
those of xterm and of the Linux console. Page: https://invisible-island.net/xterm/ctlseqs/ctlseqs.html#h3-PC-Style-Function-Keys
"""

from __future__ import annotations

import re

_ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left", "H": "home", "F": "end"}
_TILDES = {"1": "home", "4": "end", "7": "home", "8": "end"}
_PLAIN = {" ": "space", "\r": "enter", "\n": "enter", "\x7f": "backspace", "\x08": "backspace", "\x1b": "escape"}
_KEY = re.compile(r"\x1b[\[O](?P<parameters>[0-9;]*)(?P<final>[A-Za-z~])|(?P<plain>.)", re.DOTALL)


def keys(data: bytes) -> list[str]:
    """The keys that were pressed, in order; unknown ones are left out."""
    return [key for match in _KEY.finditer(data.decode("utf-8", "ignore")) if (key := _name(match))]


def _name(match: re.Match[str]) -> str | None:
    plain, final = match["plain"], match["final"]
    if plain is not None:
        return _PLAIN.get(plain, plain if plain.isprintable() else None)
    return _TILDES.get(match["parameters"].partition(";")[0]) if final == "~" else _ARROWS.get(final)
