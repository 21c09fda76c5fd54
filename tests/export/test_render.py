"""The rasteriser against geometry done by hand; cameras, framing, films and strips by their laws."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.export.mannequin import Character, Part
from cospeech.export.render import raster
from cospeech.export.render.camera import CAMERAS, Camera, find_view
from cospeech.export.render.frames import BACKDROP, FrameStream
from cospeech.export.render.framing import FramedPose, Framing, PoseStage, box_of
from cospeech.export.render.keyframes import Keyframes
from cospeech.export.render.light import develop, draw_backdrop, from_srgb
from cospeech.export.render.patch import Patch
from cospeech.export.render.points import find_points
from cospeech.export.render.scene import Scene
from cospeech.export.render.worker import FrameRenderer, Helper, Look, pack
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import humanoid
from tests.support.motions import gesturing

WIDTH, HEIGHT = 120, 90


def see(points, triangles, width=WIDTH, height=HEIGHT):
    target = raster.Raster(np.array(points, np.float32), np.array(triangles, np.intp).reshape(-1, 3).T, width, height)
    visible = target.see(np.arange(width * height, dtype=np.int32))
    return visible._replace(triangle=target.number[visible.triangle])


def coverage(visible, width=WIDTH, height=HEIGHT):
    """Samples per pixel, (H, W)."""
    return np.bincount(visible.sample >> 2, minlength=width * height).reshape(height, width)


def test_area_of_a_triangle():
    corners = [(10.3, 5.2, 1), (100.7, 33.1, 1), (47.9, 80.6, 1)]
    (ax, ay, _), (bx, by, _), (cx, cy, _) = corners
    area = abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)) / 2
    assert coverage(see(corners, [(0, 1, 2)])).sum() / 4 == pytest.approx(area, rel=4e-3)


def test_exactly_the_samples_inside_a_triangle_are_covered():
    corners = np.array([(10.3, 5.2), (100.7, 33.1), (47.9, 80.6)])
    every = np.arange(WIDTH * HEIGHT * 4, dtype=np.int32)
    x, y = raster.sample_positions(every, WIDTH)
    edges = [
        (b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1]) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)
    ]
    inside = (np.array(edges) > 0).all(0)
    visible = see([(*c, 1) for c in corners], [(0, 1, 2)])
    assert np.array_equal(every[inside], visible.sample)


@pytest.mark.slow
def test_a_mesh_without_cracks_or_double_samples():
    rng = np.random.default_rng(3)
    side = 24
    grid = np.stack(np.meshgrid(np.linspace(-5, WIDTH + 5, side), np.linspace(-5, HEIGHT + 5, side)), -1)
    grid[1:-1, 1:-1] += rng.uniform(-1.5, 1.5, (side - 2, side - 2, 2))
    points = np.concatenate([grid.reshape(-1, 2), np.ones((side * side, 1))], 1)
    at = np.arange(side * side).reshape(side, side)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
    assert (coverage(see(points, triangles)) == 4).all()
    alone = sum(len(see(points, triangles[k : k + 1]).sample) for k in range(len(triangles)))
    assert alone == WIDTH * HEIGHT * 4  # each sample belongs to one triangle only


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_triangle_wins_in_any_order(order):
    points = [(0, 0, 0.5), (WIDTH, 0, 0.5), (0, HEIGHT, 0.5), (0, 0, 0.4), (WIDTH, 0, 0.9), (0, HEIGHT, 0.4)]
    triangles = np.array([(0, 1, 2), (3, 4, 5)])[list(order)]
    visible = see(points, triangles)
    x, _ = raster.sample_positions(visible.sample, WIDTH)
    second = np.array(order)[visible.triangle] == 1
    cross = WIDTH * 0.2  # 0.4 + 0.5 x / WIDTH = 0.5
    clear = np.abs(x - cross) > 0.1
    assert np.array_equal(second[clear], (x > cross)[clear])


def test_many_layers_settle_on_the_nearest():
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, 0.1], [WIDTH, HEIGHT, 1.1], (900, 3))
    triangles = np.arange(900).reshape(-1, 3)
    visible = see(points, triangles)
    best = np.zeros(WIDTH * HEIGHT * 4)
    for k in range(len(triangles)):
        one = see(points, triangles[k : k + 1])
        best[one.sample] = np.maximum(best[one.sample], one.inverse)
    assert np.allclose(best[visible.sample], visible.inverse, rtol=1e-4)
    assert np.count_nonzero(best) == len(visible.sample)


def test_depth_is_that_of_the_plane():
    camera = Camera(np.zeros(3), np.array([0.0, 0.0, -1.0]), 0.5, WIDTH, HEIGHT)
    corners = np.array([(-1.0, -0.8, -2.0), (1.5, -0.5, -4.0), (0.0, 1.2, -3.0)])
    visible = see(camera.project(corners), [(0, 1, 2)])
    x, y = raster.sample_positions(visible.sample, WIDTH)
    ray = np.stack([(x - WIDTH / 2) / camera.focal, (HEIGHT / 2 - y) / camera.focal, -np.ones(len(x))])
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    depth = (normal @ corners[0]) / (normal @ ray)
    assert np.allclose(1 / visible.inverse, depth, rtol=2e-5)


def test_all_outlines_and_borders_are_looked_at_by_samples():
    rng = np.random.default_rng(5)
    corners = rng.uniform([0, 0, 0.2], [WIDTH, HEIGHT, 0.9], (8, 1, 3)) + rng.uniform(-1, 1, (8, 3, 3)) * (25, 25, 0.0)
    triangles, part = np.arange(24).reshape(8, 3).T, np.arange(8)
    target = raster.Raster(corners.reshape(-1, 3).astype(np.float32), triangles, WIDTH, HEIGHT)
    every = target.see(np.arange(WIDTH * HEIGHT))
    in_samples = np.full(WIDTH * HEIGHT * 4, -1)
    in_samples[every.sample] = every.triangle
    in_samples = in_samples.reshape(-1, 4)
    points = find_points(target, part[target.number], np.zeros(8, bool))
    is_edge = np.zeros(len(in_samples), bool)
    is_edge[points.edge] = True
    assert np.array_equal(np.flatnonzero(is_edge), points.edge)
    assert np.array_equal(points.coverage, (in_samples[is_edge] >= 0).sum(1))
    assert np.array_equal(points.sample_triangle, in_samples[is_edge][in_samples[is_edge] >= 0])
    some = (in_samples >= 0).any(1)
    left_out = some & ~is_edge
    left_out[points.whole] = False  # thinner than a pixel, between four middles
    wrong = (in_samples[points.whole] != points.triangle[:, None]).any(1)
    assert left_out.sum() + wrong.sum() < 0.005 * some.sum()


def test_empty_and_outside():
    assert len(see([(0, 0, 1)], np.zeros((0, 3), int)).sample) == 0
    far = [(-50, -50, 1), (-10, -50, 1), (-30, -10, 1), (500, 10, 1), (600, 10, 1), (500, 60, 1)]
    assert len(see(far, [(0, 1, 2), (3, 4, 5)]).sample) == 0
    assert coverage(see([(-1e4, -1e4, 1), (3e4, -1e4, 1), (-1e4, 3e4, 1)], [(0, 1, 2)])).min() == 4


def test_which_side_is_the_front():
    camera = Camera(np.array([0, 0, 5.0]), np.array([0.0, 0.0, -1.0]), 0.5, WIDTH, HEIGHT)
    corners = np.array([(-1.0, -1, 0), (1, -1, 0), (0, 1, 0), (0, 0, 6.0)])
    triangles = np.array([(0, 1, 2), (0, 2, 1), (0, 1, 3)])
    both_sides = [raster.Raster(camera.project(corners), triangles.T, WIDTH, HEIGHT, side) for side in (1, -1)]
    assert [set(side.number[side.see_middles().triangle].tolist()) for side in both_sides] == [{0}, {1}]


def test_projection_by_hand():
    camera = Camera(np.array([0, 1.0, 4.0]), np.array([0.0, 0.0, -1.0]), 0.5, 200, 100)
    (x, y, inverse), behind = camera.project(np.array([(1.0, 1.5, 2.0), (0.0, 0.0, 9.0)]))
    assert (x, y, inverse) == pytest.approx((100 + 1 / 2 / 0.5 * 50, 50 - 0.5 / 2 / 0.5 * 50, 0.5))
    assert behind[2] < 0


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("size", [(120, 120), (320, 90), (60, 200)])
def test_a_view_shows_the_whole_box_and_no_more_than_needed(name, size):
    low, high = np.array([-0.7, 0.3, -0.3]), np.array([0.6, 1.9, 0.8])
    camera = find_view(name).camera(low, high, *size)
    corners = np.array([[(low, high)[k >> a & 1][a] for a in range(3)] for k in range(8)])
    x, y, inverse = camera.project(corners).T
    assert (inverse > 0).all()
    spare = [x.min(), size[0] - x.max(), y.min(), size[1] - y.max()]
    assert min(spare) > -0.01
    assert min(spare[0] + spare[1], spare[2] + spare[3]) < 0.02  # touches on both sides of one direction
    assert spare[0] == pytest.approx(spare[1], abs=0.02)
    assert spare[2] == pytest.approx(spare[3], abs=0.02)


def ball(radius=0.5, rings=48):
    """A ball around the head joint, as a character of one part."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, rings), np.linspace(0, 2 * np.pi, 2 * rings), indexing="ij")
    normals = np.stack([np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], -1).reshape(-1, 3)
    at = np.arange(len(normals)).reshape(polar.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel()
    triangles = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)]).astype(np.int32)
    skeleton = humanoid()
    centre = skeleton.tpose[skeleton.index["head"]]
    joints = np.full((len(normals), 4), skeleton.index["head"], np.int32)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(normals), 1))
    vertices = (centre + radius * normals).astype(np.float32)
    part = Part("ball", vertices, normals.astype(np.float32), triangles, joints, weights, np.full(3, 0.4, np.float32), 0.6)
    return Character(skeleton, (part,)), centre


def still():
    skeleton = humanoid()
    return np.tile(np.array([0, 0, 0, 1.0]), (len(skeleton), 1)), skeleton.tpose


def test_a_ball_is_round_and_lit_from_the_key():
    character, centre = ball()
    size, tangent = 200, 0.2
    camera = Camera(centre + np.array([0, 0, 6.0]), np.array([0.0, 0.0, -1.0]), tangent, size, size)
    picture = Scene(character, size, size, (0, 255, 0)).draw(camera, *still()).astype(int)
    is_ball = picture[..., 0] > 60  # the backdrop has no red
    radius = 0.5 / np.sqrt(36 - 0.25) * camera.focal  # outline of a ball in perspective
    rows, columns = np.nonzero(is_ball)
    assert is_ball.sum() == pytest.approx(np.pi * radius**2, rel=0.02)
    assert (rows.mean(), columns.mean()) == pytest.approx((99.5, 99.5), abs=0.3)
    top_left, bottom_right = picture[75, 75].sum(), picture[125, 125].sum()
    assert top_left > 1.3 * bottom_right


def test_shading_is_symmetric_about_the_light():
    from cospeech.export.render.light import KEY, shade

    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    across = np.cross(KEY, [0, 1, 0.0])
    across /= np.linalg.norm(across)
    up = np.cross(across, KEY)
    ring = np.cos(0.7) * KEY[:, None] + np.sin(0.7) * (across[:, None] * np.cos(angle) + up[:, None] * np.sin(angle))
    ones, zeros = np.ones(64, np.float32), np.zeros(64, np.float32)
    sight = np.repeat(KEY[:, None], 64, 1)
    light = shade(ring.astype(np.float32), sight, np.ones((3, 64), np.float32) * 0.5, ones, zeros, ones)
    assert np.ptp(light, axis=1).max() < 1e-4 * light.max()
    assert (shade(ring.astype(np.float32), sight, np.ones((3, 64), np.float32), ones, zeros, zeros) < 1e-6).all()


def test_edges_are_blended_in_linear_light():
    character, centre = ball()
    camera = Camera(centre + np.array([0, 0, 6.0]), np.array([0.0, 0.0, -1.0]), 0.2, 64, 64)
    picture = Scene(character, 64, 64, (0, 255, 0)).draw(camera, *still())
    background = Scene(character, 64, 64, (0, 255, 0)).draw(
        Camera(centre + np.array([0, 0, 6.0]), np.array([0.0, 0.0, 1.0]), 0.2, 64, 64), *still()
    )
    assert (background[..., 0] == 0).all()
    assert (np.abs(np.diff(background.astype(int), axis=1)) == 0).all()
    red = from_srgb(picture[22:42, :32, 0] / 255)  # the left edge, at columns 18 … 22
    inside = red[:, 25:26]
    shares = (red[:, :24] / inside)[(red[:, :24] > 0.1 * inside) & (red[:, :24] < 0.85 * inside)]
    assert len(shares) >= 10  # pixels that are partly ball, partly backdrop
    near = np.abs(shares[:, None] - [0.25, 0.5, 0.75]).min(1)
    assert np.median(near) < 0.08


def test_srgb_there_and_back():
    levels = np.arange(0, 215)  # above, highlights are compressed
    assert np.array_equal(develop(from_srgb(levels / 255).astype(np.float32)), levels)
    assert develop(np.array([-1, 0, 9, 99], np.float32)).tolist() == [0, 0, 255, 255]


def test_nothing_in_view_is_the_backdrop_and_drawing_twice_gives_the_same():
    character, centre = ball()
    scene = Scene(character, 80, 60, BACKDROP)
    camera = Camera(centre + np.array([0, 0, 3.0]), np.array([0.0, 0.0, -1.0]), 0.3, 80, 60)
    first, second = scene.draw(camera, *still()), scene.draw(camera, *still())
    assert np.array_equal(first, second)
    away = Camera(centre + np.array([0, 0, 3.0]), np.array([0.0, 0.0, 1.0]), 0.3, 80, 60)
    empty = scene.draw(away, *still())
    assert (empty == empty[:, :1]).all()
    assert np.abs(empty.astype(int) - BACKDROP).max() < 25
    assert np.array_equal(scene.draw(camera, *still()), first)


def frames_of(motion, pieces, look, rate):
    with FrameStream(look, motion.fps, rate) as frames:
        out = []
        for a, b in zip((0, *pieces), (*pieces, len(motion)), strict=True):
            out += frames.push(motion[a:b])
        blank = draw_backdrop(look.width, look.height, look.background)
        return np.array([patch.paste(blank.copy()) for patch in (*out, *frames.flush())])


@pytest.fixture(scope="module")
def look():
    return Look(48, 40, find_view("body"), BACKDROP)


@pytest.mark.slow
def test_film_is_the_same_in_pieces_and_from_helpers(look, monkeypatch):
    motion = gesturing(40)
    with_helpers = frames_of(motion, (), look, 30)
    monkeypatch.setattr("cospeech.export.render.frames.cores", lambda: 1)
    alone = frames_of(motion, (0, 7, 8, 8, 31), look, 30)  # empty pieces too
    assert with_helpers.shape == (40, 40, 48, 3)
    assert np.array_equal(with_helpers, alone)


@pytest.mark.parametrize(("fps", "rate", "count"), [(30, 30, 17), (60, 30, 9), (25, 30, 21), (30, 12.5, 8), (29.97, 29.97, 17)])
def test_film_is_as_long_as_the_motion(look, monkeypatch, fps, rate, count):
    monkeypatch.setattr(
        "cospeech.export.render.frames.FrameRenderer.draw", lambda self, rows: [Patch(0, 0, np.zeros((40, 48, 3), np.uint8))]
    )
    assert len(frames_of(gesturing(17, fps), (5,), look, rate)) == count == np.ceil(17 / fps * rate - 1e-6)


BLANK = Patch(0, 0, np.zeros((40, 48, 3), np.uint8))


def test_film_shows_the_frame_of_its_time(look, monkeypatch):
    poses = []
    monkeypatch.setattr(
        FrameRenderer,
        "draw",
        lambda self, rows: poses.append(rows[0, :220].copy()) or [Patch(0, 0, np.zeros((2, 2, 3), np.uint8))],
    )
    motion = gesturing(20, 60)
    frames_of(motion, (), look, 20)
    world = PoseStage(humanoid(), 60).place(motion).rotations
    assert np.allclose(poses, world[::3].reshape(7, -1), atol=1e-6)


@pytest.mark.parametrize("size", [(0, 40), (48, 100_000), (-3, 5)])
def test_film_of_no_sensible_size(size):
    with pytest.raises(InputError, match="pixels"):
        FrameStream(Look(*size, find_view("body"), BACKDROP), 30, 30)


def test_unknown_camera_lists_those_known():
    with pytest.raises(InputError, match=r"'drone'.*body.*face"):
        find_view("drone")


@pytest.mark.slow
def test_helpers_end_with_the_film(look):
    frames = FrameStream(look, 30, 30)

    def interrupt():
        with frames:
            list(frames.push(gesturing(340)))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert frames._all_helpers
    assert all(helper._worker.process.poll() is not None for helper in frames._all_helpers)


def test_a_dead_helper_is_an_internal_error(look):
    helper = Helper(look)
    helper._worker.process.kill()
    helper._worker.process.wait()
    with pytest.raises(Exception, match="ended early"):
        helper.draw(np.zeros((1, 443), np.float32))
    helper.close()


def test_helpers_end_when_their_parent_is_killed(tmp_path):
    code = (
        "from cospeech.export.render.worker import Helper, Look\n"
        "from cospeech.export.render.camera import find_view; import time\n"
        "h = Helper(Look(48, 40, find_view('body'), (9, 9, 9))); print(h._worker.process.pid, flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    child = int(parent.stdout.readline())
    parent.send_signal(signal.SIGTERM)
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        try:
            os.kill(child, 0)
        except ProcessLookupError:
            return
        status = Path(f"/proc/{child}/status")
        if status.exists() and "State:\tZ" in status.read_text(encoding="utf-8"):  # ended; nobody has asked how
            return
        time.sleep(0.1)
    pytest.fail("a helper outlived its parent by 20 s")


def walking(frames, fps=30.0):
    motion = gesturing(frames, fps)
    t = np.arange(frames) / fps
    return Motion(fps=fps, rotations=motion.rotations, root=motion.root + np.stack([1.2 * t, 0 * t, 0.5 * t], 1))


def test_stage_follows_one_who_walks_and_not_one_who_sways():
    hips = PoseStage(humanoid(), 30).place(walking(300)).positions[:, 0]
    assert np.abs(hips[:, [0, 2]]).max() < 0.8
    swaying = gesturing(300)
    on_stage = PoseStage(humanoid(), 30).place(swaying).positions[:, 0]
    difference = on_stage - on_stage[0] - (swaying.root - swaying.root[0])
    assert np.ptp(on_stage[:, 0]) > 0.03
    assert np.abs(difference[:, 1]).max() < 1e-9


def test_stage_turns_the_first_frame_to_the_camera():
    motion = gesturing(3)
    rotations = motion.rotations.copy()
    from cospeech.motion.rotations import axis_angle_to_quat, quat_multiply, quat_rotate

    rotations[:, 0] = quat_multiply(axis_angle_to_quat((0, 1, 0), 2.0), rotations[:, 0])
    on_stage = PoseStage(humanoid(), 30).place(Motion(fps=30, rotations=rotations, root=motion.root + np.array([5, 0, 3])))
    ahead = quat_rotate(on_stage.rotations[0, 0], np.array([0, 0, 1.0]))
    assert ahead == pytest.approx([0, ahead[1], np.sqrt(1 - ahead[1] ** 2)], abs=1e-9)
    assert on_stage.positions[0, 0, [0, 2]] == pytest.approx([0, 0], abs=1e-9)


@pytest.mark.parametrize(("lift", "stays"), [(0.0, True), (0.2, True), (-0.95, False), (1.4, False)])
def test_stage_finds_the_floor_of_files_that_have_another(lift, stays):
    motion = gesturing(4)
    on_stage = PoseStage(humanoid(), 30).place(
        Motion(fps=30, rotations=motion.rotations, root=motion.root + np.array([0, lift, 0]))
    )
    lowest = on_stage.positions[0, :, 1].min()
    assert lowest == pytest.approx(humanoid().tpose[:, 1].min() + (lift if stays else 0.0), abs=0.02)


@pytest.mark.parametrize("pieces", [1, 7])
def test_hands_never_leave_the_picture_and_the_camera_moves_smoothly(pieces):
    fps, view, skeleton = 30.0, find_view("body"), humanoid()
    motion = gesturing(900, fps)
    rotations = motion.rotations.copy()
    rotations[600:, skeleton.index["leftUpperArm"]] = [0, 0, np.sin(0.6), np.cos(0.6)]  # up, all at once
    stage, framing = PoseStage(skeleton, fps), Framing(view, skeleton, fps)
    motion = Motion(fps=fps, rotations=rotations, root=motion.root)
    frames = []
    for k in range(0, 900, 900 // pieces):
        for pose in map(FramedPose, *stage.place(motion[k : k + 900 // pieces])):
            frames += framing.push(pose)
    frames += framing.flush()
    assert len(frames) == 900
    boxes = np.array([box for _, box in frames])
    least_boxes = np.array([box_of(view, skeleton, pose.positions[None]) for pose, _ in frames])
    assert (boxes[:, :3] <= least_boxes[:, :3] + 1e-9).all()
    assert (boxes[:, 3:] >= least_boxes[:, 3:] - 1e-9).all()
    assert np.ptp(boxes[:250], axis=0).max() < 1e-9
    assert boxes[-1, 4] > boxes[0, 4] + 0.2
    assert np.abs(np.diff(boxes, axis=0)).max() < 0.02


def test_moments_are_the_telling_ones_in_constant_memory():
    fps = 30.0
    motion = gesturing(3000, fps)  # the right hand is up at 1 s, 3 s, 5 s …
    stage, moments = PoseStage(humanoid(), fps), Keyframes(humanoid(), fps)
    for k in range(0, 3000, 111):
        moments.push(stage.place(motion[k : k + 111]))
    assert len(moments._entries) <= 192
    best = moments.best(6)
    frames = [frame for frame, _ in best]
    assert frames == sorted(frames)
    assert min(np.diff(frames)) > 100
    phase = np.array(frames) / fps % 2
    assert np.abs(phase - 1).max() < 0.35
    frame, pose = best[2]
    assert np.allclose(pose.rotations, PoseStage(humanoid(), fps).place(motion[: frame + 1]).rotations[frame], atol=1e-9)


@pytest.mark.parametrize("frames", [1, 3, 50])
def test_moments_of_short_motion(frames):
    moments = Keyframes(humanoid(), 30)
    moments.push(PoseStage(humanoid(), 30).place(gesturing(frames)))
    assert [frame for frame, _ in moments.best(7)] == sorted({frame for frame, _ in moments.best(7)})
    assert len(moments.best(7)) == min(7, frames)


def test_a_row_says_all_about_a_picture(look):
    stage = PoseStage(humanoid(), 30)
    on_stage = stage.place(gesturing(2))
    poses = list(map(FramedPose, *on_stage))
    box = box_of(look.view, humanoid(), on_stage.positions)
    pictures = FrameRenderer(look).pictures(np.stack([pack(pose, box) for pose in poses]))
    assert pictures.shape == (2, 40, 48, 3)
    assert pictures.std(axis=(1, 2)).min() > 5
