"""The types of the page are those of the messages."""

from __future__ import annotations

import write_bones
import write_types


def test_the_types_of_the_page_are_not_stale():
    assert write_types.TARGET.read_text("utf-8") == write_types.write_messages(), "run python tools/write_types.py"


def test_the_bone_names_of_the_page_are_those_of_python():
    assert write_bones.TARGET.read_text("utf-8") == write_bones.write_tables(), "run python tools/write_bones.py"


def test_requests_may_leave_out_what_has_a_default_and_answers_do_not():
    text = write_types.write_messages()
    assert "  intensity?: number;" in text
    assert "  hint: string;" in text
    assert '  type: "queued" | "progress" | "done" | "error" | "cancelled";' in text
