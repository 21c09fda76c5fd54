"""Functions are verbs, values are no participles, and names that were given up stay out of code, recipes, tests, documents."""

import ast
import re
import subprocess
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

from cospeech.errors import InputError
from cospeech.models.chain_of_generation import ChainConfig
from cospeech.models.registry import ENTRIES
from cospeech.models.speech2gesture import Speech2GestureConfig
from cospeech.training.recipe import Data, build, read_recipe
from cospeech.training.renamed import RENAMED, suggest_key

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "cospeech"
FOLDERS = (PACKAGE, *(ROOT / name for name in ("tools", "benchmarks", "blender", "tests")))

IRREGULAR = frozenset({
    "begun", "bent", "born", "bought", "bound", "broken", "brought", "built", "caught", "chosen", "dealt", "done", "drawn",
    "driven", "eaten", "fallen", "fed", "felt", "forgotten", "fought", "found", "frozen", "given", "gone", "grown", "heard",
    "held", "hidden", "hung", "kept", "known", "laid", "learnt", "led", "left", "lent", "lost", "made", "meant", "met",
    "paid", "ridden", "risen", "said", "seen", "sent", "shown", "slept", "sought", "spent", "spoken", "stood", "stolen",
    "sung", "swept", "swum", "taken", "taught", "thought", "thrown", "told", "torn", "understood", "won", "worn", "woken",
    "wound", "written",
})  # fmt: skip
"""Past participles without -ed that are no infinitive; "cut", "put", "read", "run", "set", "spread" and the like are one."""
NO_PARTICIPLE = frozenset(
    {"bed", "bleed", "embed", "exceed", "feed", "need", "proceed", "red", "seed", "shed", "speed", "ted", "reseed"}
)
"""Words in -ed that are none; "ted" is the corpus."""
FIELD_TERMS = frozenset({
    "aligned", "balanced", "bound", "centred", "closed", "frozen", "hidden", "locked", "mirrored", "muted", "normalized",
    "padded", "paired", "seated", "shuffled", "unpaced", "voiced",  # states, masks and rows of tables
    "left",  # the side
    "averted", "aimed",  # of eyes
    "coded", "expected", "generated", "given", "preserved", "spoken", "trained", "transferred",  # known to papers and plug-ins
})  # fmt: skip
"""Participles that name values all the same."""
PREDICATES = ("is", "has", "was")
PAPER_SUFFIX = "published"
"""The last word of functions of `cospeech.metrics` that follow a paper's code to the letter: they carry the metric's name."""


def participle(word: str) -> bool:
    """Whether a word is a past participle and no infinitive."""
    return word in IRREGULAR or (word.endswith("ed") and word not in NO_PARTICIPLE)


def bare_participle(name: str) -> bool:
    """Whether a function's name is a participle, or begins or ends with one, and is no predicate."""
    words = [word for word in name.strip("_").split("_") if not word.isdigit()]
    return bool(words) and words[0] not in PREDICATES and (participle(words[0]) or participle(words[-1]))


def values(source: str) -> Iterator[str]:
    """Name of each value in the functions of a source: of parameters, and of what is assigned."""
    for function in ast.walk(ast.parse(source)):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            for node in ast.walk(function):
                if isinstance(node, ast.arg):
                    yield node.arg
                elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                    yield node.id


def is_property(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    names = [ast.unparse(decorator).rsplit(".", 1)[-1] for decorator in function.decorator_list]
    return any(name in ("property", "cached_property") for name in names)


def functions(source: str) -> Iterator[tuple[str, bool]]:
    """Name of each function of a source, nested ones and methods too, and whether it is a property."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, is_property(node)


@pytest.mark.parametrize(
    "name", ["made", "_told", "nothing_given", "kept", "_kept_1", "named_chain", "shipped", "made_by", "mirrored"]
)
def test_the_rule_finds_participles(name):
    assert bare_participle(name)


@pytest.mark.parametrize(
    "name", ["embed", "read_ted", "is_shared", "has_moved", "speed", "spread", "seed", "_find_files", "put_back"]
)
def test_the_rule_leaves_verbs_and_nouns(name):
    assert not bare_participle(name)


def test_no_value_is_named_by_a_past_participle_alone():
    """`made` or `found` tells nobody what it is. Fields are left out: some are keys of files."""
    names = {
        f"{path.relative_to(ROOT)}: {name}"
        for folder in FOLDERS
        for path in sorted(folder.rglob("*.py"))
        for name in values(path.read_text("utf-8"))
        if "_" not in name.strip("_") and participle(name.strip("_")) and name.strip("_") not in FIELD_TERMS
    }
    assert sorted(names) == []


def test_no_function_is_named_by_a_past_participle():
    problems = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for name, noun in functions(path.read_text("utf-8")):
            words = name.strip("_").split("_")
            is_allowed = (words[-1] == PAPER_SUFFIX and path.parent.name == "metrics") or (noun and len(words) > 1)
            if bare_participle(name) and not is_allowed and name != "_remove_abandoned":  # a verb, and whom it is about
                problems.append(f"{path.relative_to(PACKAGE)}: {name}")
    assert not problems, "\n".join(problems)


OLD = (
    r"\bwordless\b", r"\bunseeded\b", r"\bby_clip\b", r"\bjudge_poses\b", r"\bjudge_channels\b", r"\bjudge_loss\b",
    r"\bJUDGINGS\b", r"\bPoseJudge\b", r"\bEARS\b", r"\b(Own|Wav2Vec)Ear\b", r"\bEarConfig\b", r"\bspeech_ears\b",
    r"\bnudged?s?\b", r"\bfooled\b", r"\bblend_manners\b", r"\bheard_of\b", r"\btwin_of\b", r"\btwin_maker\b", r"\bTWINS\b",
    r"\|twin-", r"\b[Vv]aults?\b", r"\bcasting\b", r"\bCasting\b", r"\b[Aa]rtist\b", r"\bFilm\b", r"\b_understood\b",
    r"\bwish(es)?\b(?!\.)", r"\bnothing_given\b", r"\bread_given\b", r"\bunpacked\(", r"\bnamed_(chain|window|skeleton)\b",
    r"\bmade_by\b", r"\bcounted_from\b", r"\bstored_clips\b(?<!load_stored_clips)", r"\bview_named\b",
    r"\bspoken_setting\b", r"\bshipped_(mouth|bundle)\b", r"\.units\(", r"\.due\(", r"\bstrays\b(?! |$)",
    r"\blive_(made|gains)\b", r"\bmade_(mean|std)\b", r"\bPULLS\b", r"\bAvatarStage\b", r"\bCharacterStage\b",
    r"\b[Hh]eeding\b", r"\bHeed\b", r"model\.(ear|judge|manner|gain|faced|labelled|borrowed|taught)\b", r"train\.judge\b",
    r"tables\.stages\b", r"\brules\.(places|track|rests)\b", r"on stage\b", r"\bthe ear\b(?! [^'])",
)  # fmt: skip
"""Names that were given up, so that they cannot come back."""
WORDS = [name.removeprefix(r"\b") for name in OLD if name[0] != "\\" or name.startswith(r"\b")]
OLD_NAMES = re.compile("|".join([rf"\b(?:{'|'.join(WORDS)})", *(name for name in OLD if name[:2] in (r"\.", r"\|"))]))
"""All of them; most begin at the edge of a word, which is looked for once."""
FREE = (
    "CHANGELOG.md",
    "tests/house/test_names.py",
    "src/cospeech/training/renamed.py",
    "benchmarks/tables/",
    "tools/mannequin/",
    "uv.lock",
    "src/cospeech/assets/",
)
"""What may hold them: the history, this test and its table, tables as they were made, and the anatomy of the mannequin."""
ENDINGS = (".py", ".md", ".toml", ".yml")


def test_old_names_are_gone():
    files = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    pattern, problems = OLD_NAMES, []
    for name in files:
        if name.startswith(FREE) or not name.endswith(ENDINGS) or not (ROOT / name).is_file():
            continue
        for number, line in enumerate((ROOT / name).read_text("utf-8").splitlines(), 1):
            if not line.endswith("# old name"):  # an error speaks of it
                problems += [f"{name}:{number}: {match.group()}" for match in pattern.finditer(line)]
    assert not problems, "\n".join(problems)


def test_an_old_key_of_a_recipe_is_refused_with_its_new_name():
    with pytest.raises(InputError, match=r"no key data\.by_clip .*'per_clip_normalisation' now"):
        read_recipe({"model": {"name": "mix-stage"}, "data": {"by_clip": True}})
    with pytest.raises(InputError, match=r"no key model\.ear .*'speech_encoder' now"):
        build(ChainConfig, {"ear": "own"}, "model")
    with pytest.raises(InputError, match=r"no key model\.judge .*'discriminator_channels' now"):
        build(Speech2GestureConfig, {"judge": 8}, "model")
    assert "'discriminator' now" in suggest_key("judge", ["classifier", "discriminator", "gestures"])


def test_every_renamed_key_is_a_key_of_a_model_or_an_objective():
    """The table of old keys is about keys that there are."""
    keys = {*Data.__dataclass_fields__, "discriminator"}
    for entry in ENTRIES.values():
        if entry.trains and entry.where.startswith("cospeech."):
            module, _, attribute = entry.where.partition(":")
            keys |= {*getattr(import_module(module), attribute).Config.__dataclass_fields__}
    assert {new for names in RENAMED.values() for new in names} <= keys
