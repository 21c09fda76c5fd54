"""The types of the page are those of the messages."""

from __future__ import annotations

import json
import re
from pathlib import Path

import write_bones
import write_types
from pydantic import TypeAdapter

from cospeech.export import face_names
from cospeech.export.visemes import MOODS
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT
from cospeech.studio.catalogue import make_catalogue
from cospeech.studio.live_messages import LiveMessage
from cospeech.studio.messages import TakeRequest

GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "studio.md"


def test_the_types_of_the_page_are_not_stale():
    assert write_types.TARGET.read_text("utf-8") == write_types.write_messages(), "run python tools/write_types.py"


def test_the_bone_names_of_the_page_are_those_of_python():
    assert write_bones.TARGET.read_text("utf-8") == write_bones.write_tables(), "run python tools/write_bones.py"


def test_requests_may_leave_out_what_has_a_default_and_answers_do_not():
    text = write_types.write_messages()
    assert "  intensity?: number;" in text
    assert "  hint: string;" in text
    assert '  type: "queued" | "progress" | "done" | "error" | "cancelled";' in text


def test_the_messages_of_the_guide_are_messages():
    text = GUIDE.read_text("utf-8")
    assert TakeRequest.model_validate_json(re.search(r"/api/takes -d '(.*?)'", text, re.S)[1]).seed == 7
    live = [json.loads(match) for match in re.findall(r'\{"type": [^}]*\}', text)]
    assert [TypeAdapter(LiveMessage).validate_python(each).type for each in live] == ["start", "change", "interrupt", "stop"]
    ends = [8, *(8 + 4 * count for count in (3, 3 + 4 * len(humanoid()), 3 + 4 * len(humanoid()) + len(ARKIT)))]
    assert re.findall(r"^\| (\d+) … (\d+) \|", text, re.M) == [
        (str(first), str(end - 1)) for first, end in zip([0, *ends], ends, strict=False)
    ]


def test_the_page_gets_the_tables_of_faces():
    face = make_catalogue([]).face
    assert (face.arkit, face.vrm0, face.oculus) == (face_names.ARKIT_NAMES, face_names.VRM0_NAMES, face_names.OCULUS_NAMES)
    assert face.moods == MOODS
