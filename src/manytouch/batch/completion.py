"""Whether a result is there and current, and if not, why."""

import json
from collections.abc import Mapping
from typing import Any

from manytouch.batch.settings import Settings
from manytouch.batch.storage import Store
from manytouch.session.result_hashes import result_stamp

FILES = ("contacts.csv", "contact_list.csv", "regions.parquet", "markers.parquet", "frames.csv")
TO_BE_COMPARED = "size or time of the input, or the request, has changed"
MISSING = "no result yet"
_PARTS = {"input": "the input", "sensor": "the sensor", "parameters": "a parameter"}


def why_not_complete(
    store: Store, name: str, settings: Settings, summary: Mapping[str, Any] | None
) -> str | None:
    """Why a result has to be computed, whatever it was computed from; None if it is complete.

    Args:
        store: where the results are.
        name: of the result folder.
        settings: which files are wanted.
        summary: content of its summary.json; None where there is none that can be read.
    """
    if summary is None:
        return MISSING
    if summary.get("complete") is not True:
        return "the result is incomplete"
    entries = store.entries(name)
    wanted = (*FILES, *(["surface.zarr"] if settings.surface else []))
    absent = [file for file in wanted if file not in entries]
    if settings.annotate and not entries & {"annotated.mp4", "annotated"}:
        absent.append("annotated.mp4")
    return f"{', '.join(absent)} {'is' if len(absent) == 1 else 'are'} missing" if absent else None


def is_current(summary: Mapping[str, Any], files: str | None, settings: Settings) -> bool:
    """Whether a complete result is known to be current without reading the input.

    Args:
        summary: of the result.
        files: `files_stamp` of the input.
        settings: the request.
    """
    stamp = result_stamp(files, settings.request)
    return stamp is not None and not settings.is_verifying and summary.get("stamp") == stamp


def why_changed(summary: Mapping[str, Any], hashes: Mapping[str, str | None], source: str) -> str | None:
    """Which part of what a result was computed from has changed; None if the result is current.

    Args:
        summary: of the result.
        hashes: `request_hashes` now.
        source: name of the input now.
    """
    before = summary.get("hashes")
    if not isinstance(before, dict) or summary.get("hash") is None:
        return "the result does not state what it was computed from"
    changed = [words for part, words in _PARTS.items() if before.get(part) != hashes[part]]
    described = summary.get("input")
    named = described.get("source") if isinstance(described, dict) else None
    if before.get("input") != hashes["input"] and named != source:
        changed[0] = f"the input (it was {named})"
    if before.get("version") != hashes["version"]:
        changed.append(f"the version (from {before.get('version')} to {hashes['version']})")
    if not changed:
        return None
    return f"{', '.join(changed)} {'has' if len(changed) == 1 else 'have'} changed"


def parse_summary(content: bytes | None) -> dict[str, Any] | None:
    """Content of a summary.json; None if it is absent or damaged."""
    if content is None:
        return None
    try:
        found = json.loads(content)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
