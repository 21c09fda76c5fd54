"""The catalogue of the studio: what it offers, and checks of names that a page sends.

Models, styles and emotions are compared with the catalogue before a model sees them. Some of these names may also be the path
of a file, and a name from outside must never become a path.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from .. import __version__
from ..audio.emotions import EMOTIONS, suggest_emotion
from ..audio.languages import LANGUAGES
from ..errors import InputError, nearest
from ..export import FORMATS, face_names
from ..export.character_files import PACKED
from ..export.visemes import MOODS, OCULUS_VOWELS, SCALES
from ..models import DEFAULT
from ..motion.skeleton import humanoid
from ..motion.skeletons.arkit import ARKIT
from ..rules.lexicon import LEXICON
from ..rules.plan_edits import Plan
from ..rules.repertoire import FORMS, LEXICAL_FORMS
from .messages import Catalogue, FaceTables, FormatRow, FormRow, ModelRow, StudioLimits
from .speeches import MINUTES
from .uploads import UPLOAD_BYTES

__all__ = ["MOST_TAKES", "check_emotion", "check_plan", "check_style", "find_model", "make_catalogue"]

MOST_TAKES = 32
"""Takes that are kept [ours: four times as many as are shown side by side]."""


def make_catalogue(models: Sequence[dict[str, Any]]) -> Catalogue:
    """Make the catalogue.

    Args:
        models: rows as `cospeech.studio._jobs.Jobs.describe` gives them.
    """
    skeleton = humanoid()
    forms = {**LEXICAL_FORMS, **FORMS}
    words = {name: [word for word, form in LEXICON.items() if form == name] for name in forms}
    form_rows = [{"name": name, "hands": form.hands, "words": words[name]} for name, form in forms.items()]
    return Catalogue(
        version=__version__, default_model=DEFAULT, models=[ModelRow.model_validate(row) for row in models],
        emotions=["auto", *EMOTIONS], languages=LANGUAGES,
        forms=[FormRow.model_validate(row) for row in form_rows],
        formats=[
            FormatRow.model_validate({"suffix": suffix, "title": entry.what, "parts": entry.holds})
            for suffix, entry in FORMATS.items()
        ],
        joints=list(skeleton.names), parents=list(skeleton.parents), rest=skeleton.offsets.tolist(),
        weights=list(ARKIT), face=_list_face_tables(), packed=list(PACKED),
        limits=StudioLimits(upload_bytes=UPLOAD_BYTES, minutes=MINUTES, takes=MOST_TAKES),
    )  # fmt: skip


def _list_face_tables() -> FaceTables:
    return FaceTables(
        arkit=face_names.ARKIT_NAMES, vrm0=face_names.VRM0_NAMES, oculus=face_names.OCULUS_NAMES, longest=face_names.LONGEST,
        enough=face_names.ENOUGH, held=face_names.HELD, moved=face_names.MOVED, vowels=OCULUS_VOWELS, moods=MOODS,
        scales=SCALES,
    )  # fmt: skip


def find_model(catalogue: Catalogue, name: str) -> ModelRow:
    """Find a model by its name.

    Raises:
        InputError: there is none.
    """
    for row in catalogue.models:
        if row.name == name:
            return row
    raise InputError(f"no model is called {name[:60]!r}", nearest(name[:60], [row.name for row in catalogue.models]))


def check_style(model: ModelRow, style: str | None) -> None:
    """Check that a style belongs to a model, or is a mixture of its styles: ``calm:0.7,lively:0.3``.

    Raises:
        InputError: it names something else.
    """
    for part in style.split(",") if style is not None else ():
        name = part.partition(":")[0].strip()
        if name not in model.styles:
            raise InputError(f"{model.name} has no style called {name[:60]!r}", nearest(name[:60], model.styles))


def check_emotion(emotion: str) -> None:
    """Check that an emotion is "auto" or a known one.

    Raises:
        InputError: it is not.
    """
    names = ("auto", *EMOTIONS)
    if emotion not in names:
        raise InputError(f"no emotion is called {emotion[:40]!r}", suggest_emotion(emotion[:40], names))


def check_plan(model: ModelRow, plan: Plan) -> None:
    """Check that the styles of a plan, and of its stretches, belong to a model.

    Raises:
        InputError: one does not; the message names the entry.
    """
    places: Iterable[tuple[str, str | None]] = [
        ("style", plan.style), *((f"stretches[{k}].style", each.style) for k, each in enumerate(plan.stretches)),
    ]  # fmt: skip
    for place, style in places:
        try:
            check_style(model, style)
        except InputError as error:
            raise InputError(f"{place}: {error.problem}", error.hint) from None
