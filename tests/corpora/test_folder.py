"""What a folder of recordings leaves out: hidden things, links, media that cannot be read."""

from __future__ import annotations

from pathlib import Path

import pytest

from cospeech.corpora import Dropped, folder
from cospeech.errors import InputError

LINK = "a link to a folder; links are not followed"


def list_reasons(root: Path) -> list[tuple[str, str]]:
    return [(item.name, item.reason) for item in folder.read(root) if isinstance(item, Dropped)]


def put(root: Path, *names: str) -> None:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(b"never opened")


def test_media_that_can_be_read_are_sounds_and_others_are_told(tmp_path):
    names = ["a.mov", "b.MKV", "c.m4v", "d.avi", "e.aac", "f.caf", "g.wma", "h.3gp"]
    put(tmp_path, *names, "i.mts", "a.mts", "notes.txt")  # of a there is a sound
    left_out: list[Dropped] = []
    assert [path.name for _, path in folder.sounds(tmp_path, left_out)] == names
    reason = "media of this kind cannot be read; save it as WAV"
    assert left_out == [Dropped("i.mts", reason)]
    assert ("i.mts", reason) in list_reasons(tmp_path)


def test_nothing_hidden_is_read(tmp_path):
    put(tmp_path, "Ana/a.wav", ".git/b.wav", "Ana/.cospeech-0f/0.wav", "Ana/.parts/1.npz")
    assert [name for name, _ in folder.sounds(tmp_path, [])] == ["Ana/a"]
    assert [name for name, _ in list_reasons(tmp_path)] == ["Ana/a"]  # damaged


def test_a_link_to_a_folder_is_told(tmp_path):
    put(tmp_path, "all/a.wav")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "Ana").symlink_to(tmp_path / "all")
    with pytest.raises(InputError, match=f"no sound file in .* .Ana: {LINK}"):
        folder.read(tmp_path / "mine")
    put(tmp_path, "mine/b.wav")
    assert ("Ana", LINK) in list_reasons(tmp_path / "mine")
