"""Unions of the cues of scores and plays, discriminated by the verb.

A cue has exactly one verb, and only the keys of that verb.
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
    spelled,
)
from fantoccini.theatre.script.verbs import VERBS

_VERBLESS = "<none>"
"""Tag without a class: hints for unknown keys are then those of the whole union."""


def _keys(cue: type[CueFile]) -> dict[str, str]:
    """Keys of a cue as they are written -> sentence about the cues that have them."""
    return {
        spelled(key): next(
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
        self._cues = {spelled(cue.verb): cue for cue in classes}
        self._keys = {cue: _keys(cue) for cue in classes}
        self._needed = needed or ", ".join(f"`{verb}`" for verb in self._cues)
        self._no_verb, self._verbless = no_verb, verbless

    @property
    def union(self) -> Any:
        """Union of the classes, as a type of a file's field."""
        members: list[Any] = [Annotated[cue, Tag(_tag(cue))] for cue in self._keys]
        hidden: Any = SkipJsonSchema
        members.append(Annotated[hidden[self._verbless], Tag(_VERBLESS)])
        either: Any = Union[tuple(members)]  # noqa: UP007
        return Annotated[either, Discriminator(self.tag), BeforeValidator(self.check)]

    def tag(self, data: Any) -> str:
        """Tag of the cue's class."""
        if isinstance(data, CueFile):
            return _tag(type(data))
        verbs = self._verbs(data) if isinstance(data, dict) else []
        return _tag(self._cues[verbs[0]]) if verbs else _VERBLESS

    def check(self, data: Any) -> Any:
        """Refuses several verbs, keys of other verbs, and missing keys of the verb."""
        if not isinstance(data, dict):
            return data
        keys_present, verbs = {spelled(str(key)) for key in data}, self._verbs(data)
        known = {key for keys in self._keys.values() for key in keys}
        if len(verbs) > 1:
            both = " and ".join(f"`{verb}`" for verb in verbs)
            raise validation_error(f"found both {both}; needed: one of {self._needed}")
        if not verbs:
            if keys_present <= known:
                raise validation_error(f"found {self._no_verb}; needed: one of {self._needed}")
            return {key: value for key, value in data.items() if spelled(str(key)) not in known}
        cue = self._cues[verbs[0]]
        allowed = self._keys[cue]
        foreign = {
            key: value for key, value in data.items() if spelled(str(key)) in known - {*allowed}
        }
        for key in sorted(spelled(key) for key, value in foreign.items() if value is not None):
            keys_rule = next(keys[key] for keys in self._keys.values() if key in keys)
            sentence = cue.other_keys_rule or keys_rule.format(key=key)
            raise validation_error(f"found `{verbs[0]}` with `{key}`; {sentence}")
        for key, sentence in allowed.items():
            needed = cue.model_fields[key.replace(" ", "_")].is_required()
            if needed and sentence and key not in keys_present | {*verbs}:
                raise validation_error(f"found no `{key}`; {sentence}")
        return {key: value for key, value in data.items() if key not in foreign}

    def _verbs(self, data: dict[Any, Any]) -> list[str]:
        keys_present = {spelled(str(key)) for key, value in data.items() if value is not None}
        return [verb for verb in self._cues if verb in keys_present]


def _tag(cue: type[CueFile]) -> str:
    """Tag by which mistakes of a cue are assigned to its class."""
    return f"<{cue.__name__.lower()}>"


if TYPE_CHECKING:
    AnyScoreCue = ScoreCue
    AnyPlayCue = PlayCue
else:
    _VERBS_OF_SCORES = "`gesture`, `phrase` and `hold`"
    AnyScoreCue = _ByVerb(ScoreCue, VerblessScoreCue, "none of them", _VERBS_OF_SCORES).union
    AnyPlayCue = _ByVerb(PlayCue, VerblessPlayCue, "no verb").union
