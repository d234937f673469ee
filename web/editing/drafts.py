"""What a visitor has not saved yet, kept in the user's state folder so that no crash of page or server loses it."""

import hashlib
import json
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors, write_doors
from closedrooms.core.files.incoming import is_file, read_json
from closedrooms.core.files.outgoing import clear_errors, write_json
from closedrooms.core.numbers import FARTHEST, is_number
from closedrooms.predictor.methods import find_method
from closedrooms.web.editing.document import Document, as_saved
from closedrooms.web.editing.settings_form import setting_rows, with_setting

# A draft's settings are a few dozen numbers, and a place for each proposal that was dismissed.
MOST_BYTES = 10_000_000


@dataclass(frozen=True, slots=True)
class Draft:
    """Document that was kept for a visitor.

    Attributes:
        document: As it stood.
        saved: Time of keeping it, seconds since the epoch.
    """

    document: Document
    saved: float


class Drafts:
    """The drafts of every visitor and map.

    Args:
        folder: Where they are; the user's state folder (``XDG_STATE_HOME``) when not given.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or state_folder() / "drafts"

    def keep(self, visitor: str, map_path: Path, document: Document) -> None:
        """Write a draft over the visitor's last one of this map.

        Raises:
            OutputError: The folder cannot be written.
        """
        stem = self._stem(visitor, map_path)
        with clear_errors(self.folder):
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        rows = {row.name: row.shown for row in setting_rows(document.settings) if row.shown != row.standard}
        # The doors last: a draft counts from the moment when they are there.
        write_json(
            stem.with_suffix(".json"),
            {
                "map": str(map_path.resolve()),
                "saved": round(time.time(), 3),
                "method": document.method,
                "settings": rows,
                "dismissed": sorted(map(list, document.dismissed)),
            },
        )
        write_doors(stem.with_suffix(".geojson"), document.doors)

    def find(self, visitor: str, map_path: Path) -> Draft | None:
        """Read the visitor's draft of this map; ``None`` where there is none.

        Raises:
            InvalidInputError: It was changed by somebody and cannot be read.
        """
        stem = self._stem(visitor, map_path)
        doors, about = stem.with_suffix(".geojson"), stem.with_suffix(".json")
        if not is_file(doors) or not is_file(about):
            return None
        data = read_json(about, what="a draft", max_bytes=MOST_BYTES)
        if not isinstance(data, dict) or not isinstance(data.get("settings"), dict):
            raise InvalidInputError("no draft", expected="what closedrooms edit wrote", where=about)
        try:
            method = find_method(str(data.get("method")))
            settings = method.config()
            for name, value in data["settings"].items():
                settings = with_setting(settings, str(name), value)
        except InvalidInputError as error:
            raise InvalidInputError(str(error), where=about) from error
        saved = data.get("saved")
        return Draft(
            Document(method.name, settings, as_saved(read_doors(doors)), _places(data.get("dismissed"))),
            float(saved) if is_number(saved) else 0.0,
        )

    def forget(self, visitor: str, map_path: Path) -> None:
        """Remove the visitor's draft of this map, once it is saved."""
        stem = self._stem(visitor, map_path)
        with clear_errors(self.folder):
            for ending in (".geojson", ".json"):
                stem.with_suffix(ending).unlink(missing_ok=True)

    def _stem(self, visitor: str, map_path: Path) -> Path:
        """Name the draft of a visitor and a map so that neither can be read from it."""
        key = json.dumps([visitor, str(map_path.resolve())])
        return self.folder / hashlib.sha256(key.encode("utf-8", "surrogateescape")).hexdigest()[:32]


def state_folder() -> Path:
    """Find the folder where this user's programs keep their state (XDG Base Directory Specification)."""
    given = os.environ.get("XDG_STATE_HOME", "")
    # A relative path counts as none (the specification).
    base = Path(given) if given and Path(given).is_absolute() else Path.home() / ".local" / "state"
    return base / "closedrooms"


def _places(value: Any) -> frozenset[tuple[float, float]]:
    """Read the points of a file; what is none is left out: a dismissed proposal comes back then."""
    found = value if isinstance(value, list) else []
    return frozenset(
        (float(place[0]), float(place[1]))
        for place in found
        if isinstance(place, list) and len(place) == 2 and all(is_number(v) and abs(v) <= FARTHEST for v in place)
    )
