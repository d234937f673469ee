"""Texts that come from files (ids, names of worlds, labels, paths), cleaned for the place where they go.

A text from a file is kept as it is inside the program. Where it leaves, it passes one of these functions: a terminal
obeys escape sequences, matplotlib reads ``$``, Markdown and XML have characters of their own, a file name may lead
elsewhere.
"""

import hashlib
import re
import unicodedata
from typing import TypeGuard

# A file name longer than this cannot be written with our endings on common file systems (255 bytes) [bytes].
LONGEST_FILE_NAME = 120
# Longest id or label that is read [characters].
LONGEST_NAME = 1000
# A text in a message or a table is cut here [characters].
LONGEST_SHOWN = 300
# Control characters, surrogates and what turns the direction of a line round: never part of a readable name.
UNSHOWABLE = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}
# A pattern that takes 5 ms to be compiled: where it is used, not with the module.
NOT_XML = "[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
MARKDOWN = re.compile(r"([\\`*_{}\[\]()<>#|!~$&])")


def shown(text: object, *, longest: int = LONGEST_SHOWN) -> str:
    """Clean a text for a terminal, a log or an axis: one line, no control characters, of bounded length.

    What cannot be shown stands as its escape (``x1b`` behind a backslash), so that nobody takes one name for another.
    """
    words = " ".join(str(text).split())
    clean = words if words.isascii() and words.isprintable() else "".join(map(_escaped, words))
    return clean if len(clean) <= longest else f"{clean[: longest - 3]}..."


def _escaped(character: str) -> str:
    """Escape a character that a terminal would act on or not show."""
    if unicodedata.category(character) not in UNSHOWABLE:
        return character
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")


def file_name(text: object, *, otherwise: str = "unnamed") -> str:
    """Clean a name for a file or folder: no separators, no leading dot, bounded; never empty, never ``..``.

    Two long texts that differ give two names.

    Args:
        text: Any text.
        otherwise: Taken where nothing usable is left.
    """
    name = "".join(c if c.isalnum() or c in "-_.+@, ()" else "_" for c in str(text)).strip(" .")
    name = name.encode("utf-8", "ignore").decode()
    if not any(c.isalnum() for c in name):
        return otherwise
    return short_name(name)


def short_name(name: str) -> str:
    """Shorten a file name to leave room for our endings; the cut part is told apart by its digest."""
    encoded = name.encode("utf-8", "surrogateescape")
    if len(encoded) <= LONGEST_FILE_NAME:
        return name
    digest = hashlib.sha256(encoded).hexdigest()[:12]
    return f"{encoded[: LONGEST_FILE_NAME - 13].decode('utf-8', 'ignore')}-{digest}"


def plot_text(text: object) -> str:
    """Escape a text for matplotlib, which reads what stands between two ``$`` as a formula."""
    return shown(text).replace("$", r"\$")


def xml_text(text: object) -> str:
    """Clean a text for XML 1.0 and HTML: what these cannot write (control characters) stands as its escape."""
    return re.sub(NOT_XML, lambda found: _escaped(found[0]), str(text))


def stage_text(text: object) -> str:
    """Clean a text to stand between the quotes of a Stage world, which knows no escapes."""
    return shown(text).replace('"', "'").replace("\\", "/")


def markdown_text(text: object) -> str:
    """Escape a text to stand as plain words on a Markdown page."""
    return MARKDOWN.sub(r"\\\1", shown(text))


def is_name(text: object, *, longest: int = LONGEST_NAME) -> TypeGuard[str]:
    """Check whether something can be a name: a text, not empty, not endless, without half characters."""
    return isinstance(text, str) and 0 < len(text) <= longest and not any(unicodedata.category(c) == "Cs" for c in text)


def is_path(text: str) -> bool:
    """Check whether a name leads to another folder: absolute, with a drive, or upwards."""
    parts = re.split(r"[/\\]", text)
    return ".." in parts or (len(parts) > 1 and (not parts[0] or parts[0] == "~" or parts[0].endswith(":")))
