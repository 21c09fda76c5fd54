"""What a format cannot do is an error and is not ignored: options that it lacks, and maps of other joints."""

from __future__ import annotations

import pytest

from cospeech.errors import InputError
from cospeech.export import FORMATS, load, save
from cospeech.export.avatar import load_avatar
from cospeech.export.keyword_options import check_options
from cospeech.export.target_skeleton import find_target
from cospeech.motion.skeleton import humanoid
from tests.support.motions import gesturing


@pytest.mark.parametrize("suffix", sorted(FORMATS.ours))
def test_an_option_that_a_format_lacks_is_no_option(suffix, tmp_path):
    with pytest.raises(InputError, match=rf"a {suffix} file is written without an option 'colour' \(.*audio"):
        save(gesturing(3), tmp_path / f"a{suffix}", colour="red")
    assert not list(tmp_path.iterdir())


def test_the_nearest_option_is_named_even_where_another_class_takes_it(tmp_path):
    with pytest.raises(InputError, match="did you mean 'background'"):
        save(gesturing(3), tmp_path / "a.mp4", backgrund=(0, 0, 0))


def test_readers_say_what_they_take(tmp_path):
    for suffix, hint in ((".bvh", "did you mean 'units'"), (".vrma", "there are none")):
        save(gesturing(3), tmp_path / f"a{suffix}")
        with pytest.raises(InputError, match=f"a {suffix} file is read without an option 'unit' .{hint}"):
            load(tmp_path / f"a{suffix}", unit="m")


def test_a_function_that_takes_all_keywords_takes_all():
    check_options(lambda path, **anything: None, {"colour": "red"}, ".new", "read")


@pytest.mark.parametrize("suffix", [".bvh", ".glb"])
@pytest.mark.parametrize(
    ("bones", "words"), [({"head": "haed"}, "did you mean 'head'"), ({"haed": "head"}, "'haed' is none of our")]
)
def test_a_map_with_a_slip_is_no_map(suffix, bones, words, tmp_path):
    save(gesturing(3), tmp_path / f"a{suffix}")
    with pytest.raises(InputError, match=words):
        load(tmp_path / f"a{suffix}", bone_map=bones)


@pytest.mark.parametrize(
    ("bones", "words"), [({"head": "haed"}, "did you mean 'head'"), ({"haed": "head"}, "'haed' is none of our")]
)
def test_rigs_and_avatars_take_no_map_with_a_slip(bones, words, tmp_path):
    for suffix in (".bvh", ".glb"):
        save(gesturing(3), tmp_path / f"a{suffix}")
    for take, of in ((load_avatar, tmp_path / "a.glb"), (find_target, tmp_path / "a.glb"), (find_target, tmp_path / "a.bvh")):
        with pytest.raises(InputError, match=words):
            take(of, bones)
    for of in ("mixamo", humanoid()):
        with pytest.raises(InputError, match="bone map: 'haed'"):
            find_target(of, {"head": "haed"})


def test_a_map_may_be_a_file(tmp_path):
    save(gesturing(3), tmp_path / "a.bvh")
    (tmp_path / "names.toml").write_text('[bones]\nhead = "head"\nneck = ""\n')
    motion = load(tmp_path / "a.bvh", bone_map=tmp_path / "names.toml")
    assert (motion.skeleton.bone_map["head"], "neck" in motion.skeleton.bone_map) == ("head", False)
