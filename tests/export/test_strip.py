"""Strips: figures stand on one scale, as large as fits, each in a picture as wide as its pose."""

from itertools import pairwise

import numpy as np
import pytest
import soundfile
from PIL import Image

from cospeech.audio.speech import Speech
from cospeech.errors import InputError
from cospeech.export import mannequin
from cospeech.export.png import Writer
from cospeech.export.render.camera import find_view
from cospeech.export.render.crops import crop_poses
from cospeech.export.render.framing import PoseStage
from cospeech.export.render.strip import StripLayout, draw_strip
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_identity
from cospeech.motion.skeleton import humanoid

HEIGHT = 400


def stand(*down):
    """One frame for each number: degrees by which both arms are below those of the T-pose."""
    skeleton = humanoid()
    rotations = np.tile(quat_identity(len(skeleton)), (len(down), 1, 1))
    for k, degrees in enumerate(down):
        for side, sign in (("left", -1), ("right", 1)):
            turn = axis_angle_to_quat(np.array([0.0, 0.0, sign]), np.radians(degrees))
            rotations[k, skeleton.index[f"{side}UpperArm"]] = turn
    return Motion(10.0, rotations, np.tile(skeleton.offsets[0], (len(down), 1)))


def crop(camera, room, *down):
    poses = PoseStage(humanoid(), 10.0).place(stand(*down))
    each = [type(poses)(*(values[k] for values in poses)) for k in range(len(down))]
    return crop_poses(find_view(camera), mannequin.build(), each, room, HEIGHT)


@pytest.mark.parametrize("camera", ["full", "body", "hands"])
@pytest.mark.parametrize("room", [300, 1000, 3000])
def test_pictures_fill_the_room(camera, room):
    crops = crop(camera, room, 75, 0, 75, 30)
    widths = [right - left for left, right in crops.columns]
    assert sum(widths) == room
    assert all(0 <= left < right <= crops.width for left, right in crops.columns)
    assert widths[1] > widths[3] > widths[0] > 0  # spread arms take more than hanging ones
    assert abs(widths[0] - widths[2]) <= 2


def test_the_camera_stands_back_only_where_it_must():
    assert crop("full", 3000, 75, 75).far == 1
    assert crop("full", 400, 75, 0).far > 1.2


def test_cameras_show_different_strips():
    boxes = {camera: crop(camera, 3000, 20, 25).box for camera in ("full", "body", "hands")}
    heights = {camera: box[4] - box[1] for camera, box in boxes.items()}
    assert heights["full"] > 1.4 * heights["body"] > 1.4 * 1.4 * heights["hands"]
    assert boxes["full"][1] < 0  # feet and floor
    assert boxes["body"][1] > 0.3


def test_edges_of_pictures_of_own_widths():
    layout = StripLayout(400, 300, 3, widths=(50, 100, 70))
    assert [layout.edge_of(k + 1) - layout.edge_of(k) - layout.gap for k in range(2)] == [50, 100]
    assert layout.middle_of(2) == layout.edge_of(2) + 35
    assert layout.edge_of(0) == layout.margin


def find_figures(picture, layout):
    """The columns of the pictures of a strip (without sound) in which something stands out from the backdrop."""
    high = layout.cell[1]
    pixels = picture[layout.margin : layout.margin + high].astype(int)
    backdrop = pixels[:, layout.margin + 1][:, None]
    return (np.abs(pixels - backdrop).sum(2) > 60).any(0) & (pixels.min((0, 2)) < 250)


def test_nobody_touches_the_border_of_a_picture(tmp_path):
    """Arms that are spread far stay within their own picture."""
    path, motion = tmp_path / "strip.png", stand(*[75] * 10, *[10] * 10, *[75] * 10)
    with Writer(path, skeleton=humanoid(), fps=10.0, pictures=3, size=(900, 500)) as writer:
        writer.write(motion)
    picture = np.asarray(Image.open(path).convert("RGB"))
    assert picture.shape == (500, 900, 3)
    gaps = np.flatnonzero((picture[20:100] > 250).all((0, 2)))  # paper: margins, and gaps between pictures
    starts = [a + 1 for a, b in pairwise(gaps) if b - a > 1]
    stops = [b for a, b in pairwise(gaps) if b - a > 1]
    assert len(starts) == 3
    layout = StripLayout(900, 500, 3)
    has_figure = find_figures(picture, layout)
    for start, stop in zip(starts, stops, strict=True):
        columns = np.flatnonzero(has_figure[start:stop])
        assert columns[0] > 2
        assert columns[-1] < stop - start - 3
    widths = [stop - start for start, stop in zip(starts, stops, strict=True)]
    assert widths[1] > 1.5 * widths[0]


@pytest.mark.parametrize(("camera", "least", "most"), [("full", 6, 7), ("hands", 4, 5), ("face", 5, 5)])
def test_as_many_moments_as_leave_the_figures_large(tmp_path, camera, least, most):
    path = tmp_path / "strip.png"
    with Writer(path, skeleton=humanoid(), fps=10.0, camera=camera, size=(1600, 640)) as writer:
        writer.write(stand(*np.tile([75, 40], 20)))
    picture = np.asarray(Image.open(path).convert("RGB"))
    paper = (picture[30:100] > 250).all((0, 2))
    count = int((np.diff(paper.astype(int)) == -1).sum())
    assert least <= count <= most


def test_the_speech_may_be_a_speech(tmp_path):
    speech = Speech(np.sin(np.arange(48_000) / 9).astype(np.float32) / 2, 24_000)
    soundfile.write(tmp_path / "said.wav", speech.samples, speech.rate, subtype="FLOAT")
    for name, audio in (("a", speech), ("b", tmp_path / "said.wav"), ("c", None)):
        stand(*[60] * 20).save(tmp_path / f"{name}.png", audio=audio, size=(400, 200))
    first, second, without = ((tmp_path / f"{name}.png").read_bytes() for name in "abc")
    assert first == second != without
    with pytest.raises(InputError, match="audio is of type ndarray"):
        stand(*[60] * 20).save(tmp_path / "d.png", audio=speech.samples)
    assert not (tmp_path / "d.png").exists()


@pytest.mark.parametrize("count", [3, 24])
def test_times_do_not_overlap(count):
    layout = StripLayout(1600, 640, count)
    pictures = np.full((count, layout.cell[1], layout.cell[0], 3), 200, np.uint8)
    sheet = draw_strip(layout, pictures, np.arange(count) + 10.25, count + 20.0)
    below = layout.margin + layout.cell[1]
    has_ink = (sheet[below + round(0.5 * layout.unit) : below + round(2 * layout.unit)] < 100).all(-1).any(0)
    ends = np.flatnonzero(np.diff(np.flatnonzero(has_ink)) > layout.unit)  # between two times
    assert len(ends) + 1 == min(count, 12)
