"""All limits of inputs, in one place: bytes, seconds, frames, joints, words. docs/security.md has them as a table.

All limits are ours: each is far above what usual files need, and far below what fills a machine. A file beyond a limit is
refused before memory is allocated for it, with an error of one line that names the limit.
"""

from typing import NamedTuple

__all__ = [
    "AVATAR_METRES", "AVATAR_SHAPE_NUMBERS", "AVATAR_VERTICES", "BLOCK_TIMEOUT", "BONE_MAP_BYTES", "BUNDLE_CARD_BYTES",
    "BUNDLE_GRAPH_BYTES", "BUNDLE_MANIFEST_BYTES", "BUNDLE_MEMBERS", "BUNDLE_WEIGHTS_BYTES", "CHANNELS",
    "CORPUS_TABLE_BYTES", "CORPUS_TEXT_BYTES", "DECODER_CPU_SECONDS", "DECODER_MEMORY", "EMOTION_BYTES", "EMOTION_ROWS",
    "FACE_JSON_BYTES", "FBX_CORNERS", "FBX_DEPTH", "FBX_FREE_UNPACKED", "FBX_NODES", "FBX_SHAPE_POINTS", "FBX_UNPACKED",
    "FBX_UNPACKED_PER_BYTE", "FREE_JOINT_FRAMES", "GLTF_JSON_VALUES", "GLTF_NODES", "GLTF_VALUES", "GLTF_ZEROS", "HDF5_BYTES",
    "HDF5_LMDB_TIMEOUT", "HDF5_MEMORY", "HDF5_OBJECTS", "JOINTS", "JOINT_FRAMES", "JOINT_FRAMES_PER_BYTE", "JSON_VALUES",
    "LIMITS", "LINE_CHARACTERS", "LONGEST_ENTRY_BYTES", "LONGEST_MESSAGE_BYTES", "MOTION_BYTES", "MOTION_RATES", "NPZ_BYTES",
    "NPZ_MEMBERS", "OPEN_TIMEOUT", "PIPED_BYTES", "PLAN_BYTES", "PLAN_VALUES",
    "PLAUSIBLE_SECONDS", "RECIPE_BYTES", "RUN_BYTES", "SECONDS_IN_MEMORY",
    "SOUND_RATES", "SPEAKERS", "SPEECH_RATES", "STORE_INDEX_BYTES", "TENSORS_HEAD_BYTES", "TEXTURES_PIXELS", "TEXTURE_PIXELS",
    "TOML_DOTS", "TRANSCRIPT_BYTES", "TRANSCRIPT_JSON_VALUES", "URDF_BYTES", "WORDS", "WORD_VECTOR_WIDTH", "Limit",
    "most_joint_frames",
]  # fmt: skip


class Limit(NamedTuple):
    """A row of the table: what is limited, the limit, its unit and its reason."""

    what: str
    value: float
    unit: str
    why: str


# ---- sound that comes in ----

PIPED_BYTES = 4 << 30
"""Of a sound file on standard input, which is copied to a file: six hours of uncompressed stereo at 48 kHz."""

# ---- motion files ----

MOTION_BYTES = 1 << 30
"""Of a motion file or a character: 4 hours of any of our formats."""
FACE_JSON_BYTES = 256 << 20
"""Of face weights as JSON, which are parsed in memory at some ten times their size: 5 hours of ours."""
JOINTS = 5000
"""Of a skeleton; film rigs have some hundreds."""
JOINT_FRAMES = 40_000_000
"""Frames × joints of a motion in memory, after resampling: 6.7 hours of our 55 joints at 30 frames per second, an hour of 75
joints at 120 with room to spare; a face is read onto a body of 55 joints."""
FREE_JOINT_FRAMES = 2_000_000
"""Frames × joints that a file of any size may grow to (20 minutes of ours at 30 fps): 200 MB when it is worked on."""
JOINT_FRAMES_PER_BYTE = 4
"""Added to it for each byte of the file. Our files have up to 3.4, if only the times have a value for each frame."""
MOTION_RATES = (1e-4, 1e4)
"""Frames per second of motion: a frame in three hours … ten times the fastest motion capture."""
LINE_CHARACTERS = 1 << 20
"""Of a line of a BVH; a row of 5,000 joints has 200,000."""
GLTF_VALUES = 1 << 27
"""Numbers in one accessor of a glTF file; 3 hours of 55 joints have 18 million per set of tracks."""
GLTF_ZEROS = 1 << 22
"""Numbers in an accessor of zeros, which costs the file nothing."""
GLTF_NODES = 20_000
"""Nodes of a glTF file."""
GLTF_JSON_VALUES = 4_000_000
"""Commas, lists and objects in the JSON of a glTF file; a dressed VRM character has some 100,000."""
FBX_NODES = 1_000_000
"""Records of an FBX file; a dressed character with all its curves has some 100,000."""
FBX_CORNERS = 8_000_000
"""Corners of all polygons of an FBX file, and points of a mesh; characters of games have 100,000 to 400,000 corners."""
FBX_SHAPE_POINTS = 200_000_000
"""Points × shapes of all meshes of an FBX file; 500 shapes of 100,000 points have 50 million. A mesh counts as a shape, and a
shape as 20,000 points at least."""
FBX_DEPTH = 64
"""Records of an FBX file in each other; files have some ten."""
FBX_UNPACKED = 1 << 30
"""Bytes of all arrays of an FBX file after unpacking: 3 hours of all our curves."""
FBX_FREE_UNPACKED = 64 << 20
"""Bytes that all arrays of an FBX file of any size may become: a character with 100,000 vertices."""
FBX_UNPACKED_PER_BYTE = 64
"""Added to it for each byte of the file; curves that stand still are packed to a thirtieth."""
AVATAR_VERTICES = 400_000
"""Of all meshes of a character that is drawn; those of games have 20,000 to 100,000."""
AVATAR_SHAPE_NUMBERS = 60_000_000
"""Shapes × vertices × 3 of a character that is drawn; 52 shapes of 100,000 vertices have 16 million."""
AVATAR_METRES = 2.4
"""From the middle of a character that is drawn to its farthest point; a staff or wings stay within."""
TEXTURE_PIXELS = 1 << 26
"""Of one texture: 8192 × 8192."""
TEXTURES_PIXELS = 1 << 28
"""Of all textures of a character: sixteen of 4096 × 4096."""
JSON_VALUES = 40_000_000
"""Commas, lists and objects in face weights; 5 hours at 30 fps have 30 million."""
NPZ_BYTES = 1 << 30
"""Of all arrays of an .npz after unpacking: 11 hours of poses at 30 fps."""
NPZ_MEMBERS = 100
"""Arrays in an .npz; ours have nine."""
PLAUSIBLE_SECONDS = 1e7
"""A time in a file: 115 days, beyond which it is a mistake."""

# ---- speech ----

SOUND_RATES = (8_000, 384_000)
"""Samples per second of a sound file: telephone … the highest that recorders offer."""
SPEECH_RATES = (100, 10_000_000)
"""Samples per second of a `Speech` made in a program; below and beyond it is a mistake."""
CHANNELS = 1024
"""Of a sound file; libsndfile's own limit."""
SPEAKERS = 64
"""Persons in a conversation: each is heard alone, and listens to all others. A large meeting has some 30."""
SECONDS_IN_MEMORY = 2 * 3600.0
"""Of speech that is read as a whole: 460 MB at 16 kHz. Speech of any length can be streamed."""
OPEN_TIMEOUT = 30.0
"""Seconds until a decoder has found the sound: it scans a long MP3 as a whole before its first sample."""
BLOCK_TIMEOUT = 10.0
"""Seconds without a block from a decoder; one takes some milliseconds."""
DECODER_MEMORY = 1 << 30
"""Bytes of address space of a decoder; it needs some 300 MiB, most of that libraries."""
DECODER_CPU_SECONDS = 3600
"""Processor time of a decoder; a day of MP3 takes some 100 s."""
LONGEST_MESSAGE_BYTES = 1 << 24
"""In one message of a decoder; a block is 512 KiB, FFmpeg's frames are smaller."""

# ---- words and emotions ----

TRANSCRIPT_BYTES = 64 << 20
"""Of a transcript: a day of speech with word times as JSON is some 30 MB."""
TRANSCRIPT_JSON_VALUES = 4_000_000
"""Commas, lists and objects in a transcript as JSON; a day of Whisper's has 2 million."""
WORDS = 500_000
"""Of a transcript: a day and a half of fast speech without a pause."""
EMOTION_BYTES = 16 << 20
"""Of an emotion track."""
EMOTION_ROWS = 100_000
"""Of an emotion track: an hour at 25 rows a second."""
PLAN_BYTES = 64 << 20
"""Of a plan of gestures: a day of speech has some 40 MB."""
PLAN_VALUES = 4_000_000
"""Commas, lists and objects in a plan of gestures: a day of speech has some 2 million."""

# ---- settings, bundles, runs ----

URDF_BYTES = 16 << 20
"""Of a robot's URDF; a large robot has some 200 kB."""
BONE_MAP_BYTES = 1 << 16
"""Of a file for ``--map``; one that names all joints has 2 kB."""
RECIPE_BYTES = 1 << 18
"""Of a recipe; the longest of ours has 2 kB."""
TOML_DOTS = 500
"""In a line of TOML: reading a key takes the square of its parts; a list of 500 numbers has as many."""
BUNDLE_MEMBERS = 32
"""Files in a bundle; ours have seven."""
BUNDLE_MANIFEST_BYTES = 1 << 20
"""Of the manifest of a bundle."""
BUNDLE_CARD_BYTES = 1 << 20
"""Of its card."""
BUNDLE_GRAPH_BYTES = 1 << 20
"""Of one of its graphs, which are without weights; the largest of ours has 25 kB. It is looked through field by field."""
BUNDLE_WEIGHTS_BYTES = 1 << 30
"""Of its weights or statistics: twice a network of 120 million numbers."""
TENSORS_HEAD_BYTES = 1 << 20
"""Of the list of arrays at the head of a safetensors file; ours have 13 kB at most."""
RUN_BYTES = 1 << 26
"""Of the config.json of a training run."""
STORE_INDEX_BYTES = 1 << 30
"""Of the index of a store: some million clips."""
WORD_VECTOR_WIDTH = 4096
"""Numbers of a word's vector; fastText's are 300."""

# ---- corpora ----

CORPUS_TEXT_BYTES = 16 << 20
"""Of a file of annotations; those of an hour have some hundred kB."""
CORPUS_TABLE_BYTES = 1 << 28
"""Of a table of intervals; that of PATS has 14 MB."""
HDF5_BYTES = 1 << 28
"""Of one HDF5 file, unpacked; an interval of PATS has 1 MiB."""
HDF5_OBJECTS = 2000
"""Data sets of one HDF5 file; PATS has some 12."""
HDF5_MEMORY = 2 << 30
"""Bytes of address space while HDF5 is read."""
HDF5_LMDB_TIMEOUT = 30.0
"""Seconds without a message from the reader of HDF5 and LMDB; a file of PATS takes some milliseconds."""
LONGEST_ENTRY_BYTES = 1 << 30
"""Of one entry of an LMDB; a video of TED takes some 20 MB."""


def most_joint_frames(size: int) -> int:
    """How many frames × joints a file of ``size`` bytes may become.

    >>> most_joint_frames(1_000_000)
    6000000
    """
    return min(JOINT_FRAMES, FREE_JOINT_FRAMES + JOINT_FRAMES_PER_BYTE * size)


LIMITS = (
    Limit("motion file or character", MOTION_BYTES, "bytes", "4 hours of any of our formats"),
    Limit("face weights as JSON", FACE_JSON_BYTES, "bytes", "the whole file is parsed in memory; 5 hours of our files"),
    Limit("face weights as JSON, values", JSON_VALUES, "commas, lists and objects", "5 hours have 30 million"),
    Limit("skeleton", JOINTS, "joints", "film rigs have some hundreds"),
    Limit("motion after resampling", JOINT_FRAMES, "frames × joints", "6.7 hours of 55 joints at 30 fps"),
    Limit(
        "motion of a small file",
        FREE_JOINT_FRAMES,
        "frames × joints",
        "20 minutes of 55 joints at 30 fps; larger files get more:",
    ),
    Limit("motion, for each byte of the file", JOINT_FRAMES_PER_BYTE, "frames × joints", "all our files have fewer"),
    Limit("motion, lowest frame rate", MOTION_RATES[0], "frames per second", "one frame in three hours"),
    Limit("motion, highest frame rate", MOTION_RATES[1], "frames per second", "ten times the fastest motion capture"),
    Limit("line of a BVH", LINE_CHARACTERS, "characters", "a row of 5,000 joints has 200,000"),
    Limit("glTF accessor", GLTF_VALUES, "numbers", "hours of all joints"),
    Limit("glTF accessor without data", GLTF_ZEROS, "numbers", "it stands for zeros, and takes no bytes of the file"),
    Limit("glTF file", GLTF_NODES, "nodes", "characters have some hundreds"),
    Limit("JSON of a glTF file", GLTF_JSON_VALUES, "commas, lists and objects", "a dressed character has some 100,000"),
    Limit("FBX file", FBX_NODES, "records", "a dressed character has some 100,000"),
    Limit("FBX file, records in each other", FBX_DEPTH, "levels", "files have some ten"),
    Limit("FBX file, polygons", FBX_CORNERS, "corners", "characters of games have 100,000 to 400,000"),
    Limit("FBX file, shapes", FBX_SHAPE_POINTS, "points × shapes", "500 shapes of 100,000 points have 50 million"),
    Limit("FBX file, unpacked", FBX_UNPACKED, "bytes", "3 hours of all our curves"),
    Limit("small FBX file, unpacked", FBX_FREE_UNPACKED, "bytes", "larger files get more:"),
    Limit("FBX file, unpacked, for each byte of the file", FBX_UNPACKED_PER_BYTE, "bytes", "curves are packed to a thirtieth"),
    Limit("character that is drawn", AVATAR_VERTICES, "vertices", "characters of games have 20,000 to 100,000"),
    Limit("character that is drawn, shapes", AVATAR_SHAPE_NUMBERS, "numbers", "52 shapes of 100,000 vertices have 16 million"),
    Limit("character that is drawn, reach", AVATAR_METRES, "metres", "at a height of 1.72 m; enough for staffs and wings"),
    Limit("texture", TEXTURE_PIXELS, "pixels", "8192 × 8192"),
    Limit("textures of a character", TEXTURES_PIXELS, "pixels", "sixteen of 4096 × 4096"),
    Limit(".npz, unpacked", NPZ_BYTES, "bytes", "11 hours of poses at 30 fps"),
    Limit(".npz", NPZ_MEMBERS, "arrays", "our files have nine"),
    Limit("time in a file", PLAUSIBLE_SECONDS, "seconds", "115 days; a later time is taken for a mistake"),
    Limit("sound file, lowest rate", SOUND_RATES[0], "samples per second", "the rate of telephones"),
    Limit("sound file, highest rate", SOUND_RATES[1], "samples per second", "the highest rate of recorders"),
    Limit("Speech made in Python, lowest rate", SPEECH_RATES[0], "samples per second", "a lower rate is taken for a mistake"),
    Limit("Speech made in Python, highest rate", SPEECH_RATES[1], "samples per second", "a higher rate is taken for a mistake"),
    Limit("sound file", CHANNELS, "channels", "libsndfile's own limit"),
    Limit("conversation", SPEAKERS, "persons", "a large meeting has some 30"),
    Limit("speech read as a whole", SECONDS_IN_MEMORY, "seconds", "streams have no limit"),
    Limit("decoder, until the first sound", OPEN_TIMEOUT, "seconds", "a long MP3 is scanned first"),
    Limit("sound on standard input", PIPED_BYTES, "bytes", "6 hours of uncompressed stereo"),
    Limit("decoder, between blocks", BLOCK_TIMEOUT, "seconds", "a block takes some milliseconds"),
    Limit("decoder, memory", DECODER_MEMORY, "bytes of address space", "it needs some 300 MiB"),
    Limit("decoder, processor time", DECODER_CPU_SECONDS, "seconds", "a day of MP3 takes 100"),
    Limit("decoder, one message", LONGEST_MESSAGE_BYTES, "bytes", "a block is 512 KiB"),
    Limit("transcript", TRANSCRIPT_BYTES, "bytes", "a day of word times as JSON has 30 MB"),
    Limit("transcript as JSON", TRANSCRIPT_JSON_VALUES, "commas, lists and objects", "a day of speech has 2 million"),
    Limit("transcript", WORDS, "words", "a day and a half of speech without a pause"),
    Limit("emotion track", EMOTION_BYTES, "bytes", "an hour has 2 MB"),
    Limit("emotion track", EMOTION_ROWS, "rows", "an hour at 25 rows a second"),
    Limit("plan of gestures", PLAN_BYTES, "bytes", "a day of speech has some 40 MB"),
    Limit("plan of gestures", PLAN_VALUES, "commas, lists and objects", "a day of speech has some 2 million"),
    Limit("bone map (--map)", BONE_MAP_BYTES, "bytes", "a map of all joints has 2 kB"),
    Limit("URDF of a robot", URDF_BYTES, "bytes", "a large robot has some 200 kB"),
    Limit("recipe", RECIPE_BYTES, "bytes", "our longest recipe has 2 kB"),
    Limit("line of a bone map or recipe", TOML_DOTS, "dots", "the time to read a key grows with the square of its dots"),
    Limit("bundle", BUNDLE_MEMBERS, "members", "our bundles have seven"),
    Limit("bundle, manifest", BUNDLE_MANIFEST_BYTES, "bytes", "our bundles have 20 kB"),
    Limit("bundle, card", BUNDLE_CARD_BYTES, "bytes", "our bundles have 5 kB"),
    Limit("bundle, graph", BUNDLE_GRAPH_BYTES, "bytes", "weights lie elsewhere; our graphs have 25 kB at most"),
    Limit("bundle, weights", BUNDLE_WEIGHTS_BYTES, "bytes", "twice a network of 120 million numbers"),
    Limit("list of arrays in safetensors", TENSORS_HEAD_BYTES, "bytes", "our files have 13 kB at most"),
    Limit("config.json of a run", RUN_BYTES, "bytes", "usually some kB"),
    Limit("index of a store", STORE_INDEX_BYTES, "bytes", "enough for some million clips"),
    Limit("word vectors", WORD_VECTOR_WIDTH, "numbers per word", "fastText's have 300"),
    Limit("corpus, annotations", CORPUS_TEXT_BYTES, "bytes", "an hour has some hundred kB"),
    Limit("corpus, table of intervals", CORPUS_TABLE_BYTES, "bytes", "the table of PATS has 14 MB"),
    Limit("corpus, HDF5 unpacked", HDF5_BYTES, "bytes", "an interval of PATS has 1 MiB"),
    Limit("corpus, HDF5", HDF5_OBJECTS, "data sets", "PATS has some 12"),
    Limit("corpus, reader of HDF5", HDF5_MEMORY, "bytes of address space", "most of it is taken by libraries"),
    Limit("corpus, reader of HDF5 and LMDB", HDF5_LMDB_TIMEOUT, "seconds without a message", "a file takes some milliseconds"),
    Limit("corpus, entry of an LMDB", LONGEST_ENTRY_BYTES, "bytes", "a video of TED takes 20 MB"),
)
"""The table of docs/security.md."""
