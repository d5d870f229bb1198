"""Unions of the cues of scores and plays, discriminated by the verb.

A cue has exactly one verb, and only the keys of that verb.

A cue is a line of a score or play. A union is a type with several classes, from which the verb
chooses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import BeforeValidator, Discriminator, Tag
from pydantic.json_schema import SkipJsonSchema

from fantoccini.base.documents import validation_error
from fantoccini.theatre.script.cues import (
    CueFile,
    PlayCue,
    ScoreCue,
    VerblessPlayCue,
    VerblessScoreCue,
    file_key,
)
from fantoccini.theatre.script.verbs import VERBS

_VERBLESS_TAG = "<none>"
"""Tag without a class: hints for unknown keys are then those of the whole union."""


def _rules_of_keys(cue: type[CueFile]) -> dict[str, str]:
    """Keys of a cue as they are written -> sentence about the cues that have them."""
    return {
        file_key(key): next(
            base.keys_rule
            for base in cue.__mro__
            if issubclass(base, CueFile) and key in base.__annotations__
        )
        for key in cue.model_fields
    }


class _ByVerb:
    """Chooses a cue's class by its verb, and refuses keys of other verbs.

    Args:
        kind: base class of the cues: those of scores, or of plays.
        verbless: class of a cue without a verb.
        no_verb: phrase for the message about a cue without a verb.
        needed: verbs in words; a list of all by default.
    """

    def __init__(
        self, kind: type[CueFile], verbless: type[CueFile], no_verb: str, needed: str = ""
    ):
        classes = [verb.cue for verb in VERBS.values() if issubclass(verb.cue, kind)]
        self._cues = {file_key(cue.verb): cue for cue in classes}
        self._rules_of_keys = {cue: _rules_of_keys(cue) for cue in classes}
        self._needed = needed or ", ".join(f"`{verb}`" for verb in self._cues)
        self._no_verb, self._verbless = no_verb, verbless

    @property
    def union(self) -> Any:
        """Union of the classes, as a type of a file's field."""
        members: list[Any] = [Annotated[cue, Tag(_tag(cue))] for cue in self._rules_of_keys]
        without_schema: Any = SkipJsonSchema
        members.append(Annotated[without_schema[self._verbless], Tag(_VERBLESS_TAG)])
        union: Any = Union[tuple(members)]  # noqa: UP007
        return Annotated[union, Discriminator(self.tag), BeforeValidator(self.check)]

    def tag(self, data: Any) -> str:
        """Tag of the cue's class."""
        if isinstance(data, CueFile):
            return _tag(type(data))
        verbs = self._verbs(data) if isinstance(data, dict) else []
        return _tag(self._cues[verbs[0]]) if verbs else _VERBLESS_TAG

    def check(self, data: Any) -> Any:
        """Refuses several verbs, keys of other verbs, and missing keys of the verb."""
        if not isinstance(data, dict):
            return data
        keys_present, verbs = {file_key(str(key)) for key in data}, self._verbs(data)
        all_keys = {key for keys in self._rules_of_keys.values() for key in keys}
        if len(verbs) > 1:
            verbs_text = " and ".join(f"`{verb}`" for verb in verbs)
            raise validation_error(f"found both {verbs_text}; needed: one of {self._needed}")
        if not verbs:
            if keys_present <= all_keys:
                raise validation_error(f"found {self._no_verb}; needed: one of {self._needed}")
            return {key: value for key, value in data.items() if file_key(str(key)) not in all_keys}
        cue = self._cues[verbs[0]]
        allowed = self._rules_of_keys[cue]
        foreign_entries = {
            key: value for key, value in data.items() if file_key(str(key)) in all_keys - {*allowed}
        }
        for key in sorted(
            file_key(key) for key, value in foreign_entries.items() if value is not None
        ):
            keys_rule = next(keys[key] for keys in self._rules_of_keys.values() if key in keys)
            rule = cue.other_keys_rule or keys_rule.format(key=key)
            raise validation_error(f"found `{verbs[0]}` with `{key}`; {rule}")
        for key, rule in allowed.items():
            is_required = cue.model_fields[key.replace(" ", "_")].is_required()
            if is_required and rule and key not in keys_present | {*verbs}:
                raise validation_error(f"found no `{key}`; {rule}")
        return {key: value for key, value in data.items() if key not in foreign_entries}

    def _verbs(self, data: dict[Any, Any]) -> list[str]:
        keys_present = {file_key(str(key)) for key, value in data.items() if value is not None}
        return [verb for verb in self._cues if verb in keys_present]


def _tag(cue: type[CueFile]) -> str:
    """Tag by which mistakes of a cue are assigned to its class."""
    return f"<{cue.__name__.lower()}>"


if TYPE_CHECKING:
    AnyScoreCue = ScoreCue
    AnyPlayCue = PlayCue
else:
    _SCORE_VERBS_TEXT = "`gesture`, `phrase` and `hold`"
    AnyScoreCue = _ByVerb(ScoreCue, VerblessScoreCue, "none of them", _SCORE_VERBS_TEXT).union
    AnyPlayCue = _ByVerb(PlayCue, VerblessPlayCue, "no verb").union
